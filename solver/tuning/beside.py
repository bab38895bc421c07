"""What a result tells of settings beside its own: those of today, typed ones, moved ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.robustness.margins import LoopMargins
    from solver.robustness.record import Peaks

__all__ = ["AsFound", "PriceOfResolution", "SettingMove", "SettingRange", "SettingsTolerance"]


@dataclass(frozen=True)
class AsFound:
    """What given settings do, judged as those that were found.

    Attributes
    ----------
    tau_p : float or None
        The least tau_P for which they keep the demand at all frequencies, time units; for the
        objective 'mu' the given one, if they keep it. None: there is none.
    peaks : Peaks or None
        Of mu under the demand of the result, its tau_P included; without a result, under their own.
        None for unstable loops and where mu has no bound.
    nominally_stable : bool
        Whether they stabilise the model.
    margins : tuple of LoopMargins
        Of each different loop.
    reason : str or None
        Why there is no `tau_p`.
    active : str or None
        With scenarios or a spread, of which the corners are looked at: the one that decides, to
        which all but the margins belongs. None without them.

    """

    tau_p: float | None
    peaks: Peaks | None
    nominally_stable: bool
    margins: tuple[LoopMargins, ...]
    reason: str | None = None
    active: str | None = None


@dataclass(frozen=True)
class PriceOfResolution:
    """What it costs to take numbers that the controller accepts.

    `tau_p_exact` and `tau_p_rounded`, time units, and the peaks `mu_exact` and `mu_rounded`: one
    pair differs, that of the objective.
    """

    tau_p_exact: float
    tau_p_rounded: float
    mu_exact: float
    mu_rounded: float


@dataclass(frozen=True)
class SettingRange:
    """How far one setting may be moved while all others stay.

    `parameter` of the loops of `group`, counted from 0, now at `value`, may go from `low` to
    `high`; None: ten times as far, at least.
    """

    group: int
    parameter: str
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class SettingMove:
    """Relative `change` of one `parameter` of a `group` in a joint move; -0.03: 3 per cent less."""

    group: int
    parameter: str
    change: float


@dataclass(frozen=True)
class SettingsTolerance:
    """How far the settings may be moved before mu exceeds `mu` at `tau_p`.

    Attributes
    ----------
    tau_p, mu : float
        The demand: time constant (time units) and level.
    alone : tuple of SettingRange
        Of each setting.
    together : tuple of SettingMove
        The least joint change found that exceeds it, empty if there is none nearby.
    lower_gains : float or None
        mu at the result's own tau_P with all gains 5 per cent lower; None: unstable.

    """

    tau_p: float
    mu: float
    alone: tuple[SettingRange, ...]
    together: tuple[SettingMove, ...]
    lower_gains: float | None
