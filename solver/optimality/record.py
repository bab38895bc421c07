"""What is known of the distance to the true optimum."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.weights import Performance, Uncertainty

__all__ = ["Optimality", "Proof", "SettingsProblem"]


class Proof(StrEnum):
    """How the proof ended.

    REACHED: the gap is at most its goal. STOPPED: time or memory ended first; what is reported is
    proven all the same. Try (a) a longer time limit, (b) narrower bounds of the settings, (c) fewer
    different controllers.
    """

    REACHED = "reached"
    STOPPED = "stopped"


@dataclass(frozen=True)
class Optimality:
    """A proven lower bound of tau_P, or of mu where that is sought.

    Attributes
    ----------
    lower_bound : float
        No settings within the parameter bounds of the search, with as many different controllers,
        meet the demand at a smaller tau_P (time units), or have a smaller peak of mu at the given
        tau_P. 0 where nothing is proven.
    gap : float
        1 - lower_bound over tau_P, or mu: the greatest share by which it may still fall.
    goal : float
        The gap at which the proof ends.
    status : Proof
        Whether it got there.
    boxes : int
        Boxes of settings that were examined.
    points : int
        Points of the right half plane, frequencies for the most part, where the demand was used.

    """

    lower_bound: float
    gap: float
    goal: float
    status: Proof
    boxes: int
    points: int


@dataclass(frozen=True, eq=False)
class SettingsProblem:
    """Which PI or PID settings of one grouping are asked for, and within which bounds.

    Attributes
    ----------
    blocks : LoopBlocks
        Plant and grouping, with at most three different controllers.
    uncertainty : Uncertainty
        Input uncertainty.
    performance : Performance
        M and A of the demand; with a tau_P the least peak of mu is sought, without one tau_P.
    signs : (controllers,)
        Sign of each gain.
    low, high : (2 controllers,) or (3,)
        Bounds of log k and log tau_I of each controller in turn; with PID, of which there is one,
        log tau_D behind them.
    omega : (k,)
        Frequencies to begin with, rad per time unit, ascending.

    """

    blocks: LoopBlocks
    uncertainty: Uncertainty
    performance: Performance
    signs: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    omega: NDArray[np.float64]
