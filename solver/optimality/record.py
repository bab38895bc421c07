"""What is known of the distance to the true optimum."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["Optimality", "Proof"]


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
    """A proven lower bound of tau_P.

    Attributes
    ----------
    lower_bound : float
        No settings within the parameter bounds of the search, with as many different controllers,
        meet the demand at a smaller tau_P (time units). 0 where nothing is proven.
    gap : float
        1 - lower_bound/tau_P: the greatest share by which tau_P may still fall.
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
