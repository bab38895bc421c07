"""What a limit returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.model.mode_controller import ModeController

if TYPE_CHECKING:
    from solver.limits.lower_bound import LowerBound
    from solver.model.state_space import StateSpace
    from solver.robustness.centralised import Centralised

__all__ = ["Limit", "LimitStatus", "Realised"]


class LimitStatus(StrEnum):
    """How the search for the limit ended.

    FOUND: the best controller found meets the demand. INFEASIBLE: none was found that keeps mu at
    1 or below, however slow; try (a) less uncertainty, (b) a larger permitted sensitivity peak.
    UNLIMITED: nothing in the model ends the bandwidth; give a dead time, or an uncertainty whose
    weight passes 1. TIME_LIMIT: the search was ended early; its value, if any, is the best by then.
    """

    FOUND = "found"
    INFEASIBLE = "infeasible"
    UNLIMITED = "unlimited"
    TIME_LIMIT = "time_limit"


@dataclass(frozen=True)
class Realised:
    """A controller that can be built, and what the analysis of it says.

    Attributes
    ----------
    controller : StateSpace or ModeController
        u = C e with integral action; a mode controller for a parallel plant.
    states : int
        Of the controller, each mode once.
    tau_p : float
        Time constant (time units) that it reaches, or for which mu was minimised.
    robustness : Centralised
        Peaks and curves over a dense grid of the whole axis, dead time exact.

    """

    controller: StateSpace | ModeController
    states: int
    tau_p: float
    robustness: Centralised

    @property
    def unstable_poles(self) -> int:
        """Number of the controller's own poles in the right half plane, integrators apart."""
        own = self.controller
        parts = (own.total, own.difference) if isinstance(own, ModeController) else (own,)
        return sum(int(np.count_nonzero(part.poles.real > 0)) for part in parts)


@dataclass(frozen=True, repr=False)
class Limit:
    """What a multivariable controller could do.

    Attributes
    ----------
    status : LimitStatus
        Read it first.
    objective : str
        "tau_p" or "mu".
    value : float or None
        Least tau_P (time units), or least mu, found over all controllers: a local optimum, the
        controller being a function of frequency without limit of its order.
    lower_bound : LowerBound
        What no linear controller can pass.
    realised : Realised or None
        A controller of limited order near it.
    reason : str or None
        Why there is no value.
    warnings : tuple of str
        What to look at twice.

    """

    status: LimitStatus
    objective: str
    value: float | None
    lower_bound: LowerBound
    realised: Realised | None = None
    reason: str | None = None
    warnings: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        """Return what was found, its bound and what is built, in a line."""
        value = "none" if self.value is None else f"{self.value:.5g}"
        parts = [self.status.value, f"{self.objective} {value}"]
        if self.realised is not None:
            built = self.realised
            peaks = built.robustness.peaks
            reached = f"{built.states} states at tau_p {built.tau_p:.5g}"
            if peaks is not None:
                reached += f", mu {peaks.robust_performance.value:.4g}"
            parts.append(f"built of {reached}")
        parts.append(f"lower bound {self.lower_bound.value:.5g}")
        return f"Limit({', '.join(parts)})"

    @property
    def gap(self) -> float | None:
        """Value over its lower bound, minus 1; None without either."""
        if self.value is None or not self.lower_bound.value > 0:
            return None
        return self.value / self.lower_bound.value - 1
