"""PI settings from the ultimate point: Ziegler-Nichols as Johansson used them, and calmer ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.model.controllers import Controller

if TYPE_CHECKING:
    from solver.relay.describing_function import Ultimate

__all__ = ["UltimateSettings", "settings"]


@dataclass(frozen=True)
class UltimateSettings:
    """PI settings by rule.

    Attributes
    ----------
    ziegler_nichols : Controller
        K_c = 0.4 K_u, T_i = 0.8 T_u (Johansson 1993, section 3): fast, poorly damped.
    tyreus_luyben : Controller
        K_c = K_u/3.2, T_i = 2.2 T_u (Tyreus and Luyben, Ind. Eng. Chem. Res. 31 (1992)
        2625-2628): for loops that must leave their neighbours alone.

    """

    ziegler_nichols: Controller
    tyreus_luyben: Controller


def settings(ultimate: Ultimate, direction: float = 1.0) -> UltimateSettings:
    """Return the settings; `direction` is -1 for a process with negative gain."""
    gain, period = direction * ultimate.gain, ultimate.period
    return UltimateSettings(
        ziegler_nichols=Controller(0.4 * gain, 0.8 * period),
        tyreus_luyben=Controller(gain / 3.2, 2.2 * period),
    )
