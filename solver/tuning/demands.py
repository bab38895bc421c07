"""What an engineer asks of settings beside the objective, each a hard constraint."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST
from solver.model.validation import choice, real, reals, settle

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["NO_DEMANDS", "DemandOutcome", "Demands", "IntegrityDemand"]


class IntegrityDemand(StrEnum):
    """What is asked of every set of loops in service, the others being in manual.

    NONE: nothing. STABLE: nominal stability. ROBUSTLY_STABLE: for every plant of the uncertainty.
    """

    NONE = "none"
    STABLE = "stable"
    ROBUSTLY_STABLE = "robustly_stable"


@dataclass(frozen=True)
class Demands:
    """Hard constraints on settings beside robust performance; None: not asked for.

    Parameters
    ----------
    max_controller_gain : float or None
        Greatest permitted |k| max(1, tau_D/tau_F), input unit per output unit.
    max_load_error : float or None
        Greatest permitted integrated error after a unit step of load at a loop's own input: time
        times output unit, per input unit.
    max_sensitivity_alone : float or None
        Greatest permitted peak of the sensitivity of each loop alone, > 1.
    integrity : IntegrityDemand or str
        What holds for every set of loops in service.
    gain_ratios : tuple of float or None
        Span of the output over that of the input, of each loop, > 0: `max_controller_gain` is then
        in per cent of the one per per cent of the other. None: as the gains are given.

    """

    max_controller_gain: float | None = None
    max_load_error: float | None = None
    max_sensitivity_alone: float | None = None
    integrity: IntegrityDemand = IntegrityDemand.NONE
    gain_ratios: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        settle(self, integrity=choice(IntegrityDemand, self.integrity, "/integrity"))
        if self.gain_ratios is not None:
            ratios = reals(self.gain_ratios, "/gain_ratios")
            for index, ratio in enumerate(ratios):
                if not 0 < ratio <= LARGEST:
                    message = f"must be greater than 0 and at most {LARGEST:g}"
                    raise InvalidInputError(message, f"/gain_ratios/{index}")
            settle(self, gain_ratios=ratios)
        for name in self.names:
            if name == "integrity":
                continue
            value = real(getattr(self, name), f"/{name}")
            settle(self, **{name: value})
            least = 1 if name == "max_sensitivity_alone" else 0
            if not least < value <= LARGEST:
                message = f"must be greater than {least} and at most {LARGEST:g}"
                raise InvalidInputError(message, f"/{name}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is asked for."""
        every = ("max_controller_gain", "max_load_error", "max_sensitivity_alone")
        asked = [name for name in every if getattr(self, name) is not None]
        if self.integrity is not IntegrityDemand.NONE:
            asked.append("integrity")
        return tuple(asked)

    def gain_ratio(self, units: Sequence[int]) -> float:
        """Return the greatest ratio that gains of these units are multiplied by."""
        return 1.0 if self.gain_ratios is None else max(self.gain_ratios[unit] for unit in units)

    @property
    def each_alone(self) -> bool:
        """Whether each loop must be stable with all others in manual."""
        return self.integrity is not IntegrityDemand.NONE or self.max_sensitivity_alone is not None


NO_DEMANDS = Demands()


@dataclass(frozen=True)
class DemandOutcome:
    """What settings make of one demand.

    Attributes
    ----------
    name : str
        Which one: a field of `Demands`.
    limit, value : float
        What was asked for, and what the worst loop has: infinite where one is unstable alone. Of
        integrity: 0 and the number of kinds of unstable sets, or 1 and the greatest mu of robust
        stability.
    met, active : bool
        Whether the value is within the limit, and whether it is at it, so that the demand binds.

    """

    name: str
    limit: float
    value: float
    met: bool
    active: bool
