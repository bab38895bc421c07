"""The last word on settings: their peak over the whole axis, and the search that goes on from it.

What the search saw is a grid with refined peaks. Where the proven peak is above the level, its
frequency joins the grid and the search goes on; settings whose peak is above the level are never
returned as meeting it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST
from solver.robustness.axis import proven_peaks
from solver.tuning.endless import extended
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.robustness.record import Curves, Guarantee, Peaks
    from solver.tuning.clock import Clock
    from solver.tuning.exact import Candidate
    from solver.tuning.search import GroupingSearch
    from solver.tuning.specification import Specification

__all__ = ["Settled", "settled"]

ROUNDING = 1e-9  # relative addition to tau_P that keeps mu <= 1 under rounding
ABOVE = 2e-8  # relative excess of the proven peak that is rounding of the kernel
ROUNDS = 6  # of the search with the peaks that the proof found
NEARLY = 0.02  # relative distance below the peak of maxima that are as good as active
MOST_PLACES = 50  # of them that join the grid in one round
RAISED = 30  # times that tau_P of the same settings is raised to what a new peak demands


@dataclass(frozen=True)
class Settled:
    """Settings, what they reach, and the peaks over the whole here."""

    candidate: Candidate
    performance: Performance
    loops: tuple[Controller, ...]
    peaks: Peaks
    curves: Curves
    guarantee: Guarantee


def settled(
    specification: Specification, search: GroupingSearch, candidate: Candidate, clock: Clock | None
) -> Settled | None:
    """Return the settings near a candidate that keep the level on the whole here.

    Parameters
    ----------
    specification, search : Specification, GroupingSearch
        The task, and where the candidate comes from.
    candidate : Candidate
        Settings with their value as the search sees it.
    clock : Clock or None
        None: there is no time to search on.

    Returns
    -------
    Settled or None
        None where no tau_P serves these settings after all.

    Raises
    ------
    InvalidInputError
        tau_P is too large a number.
    OutOfTimeError
        The time limit has passed.

    """
    if clock is not None:
        candidate = extended(search, candidate)
        for _ in range(ROUNDS):
            clock.tick()
            here = _looked_at(specification, search, candidate)
            if _above(search, candidate, here) <= ABOVE:
                return here
            search.look_at(_high_places(here))
            found = search.exact.descend(candidate.theta)
            if found is None or not search.accepts(found.theta):
                break
            candidate = found
    for _ in range(RAISED):
        here = _looked_at(specification, search, candidate)
        if _above(search, candidate, here) <= ABOVE:
            return here
        top = np.array([here.peaks.robust_performance.omega])
        needed = float(search.exact.attained(candidate.theta, top)[0])
        value = max(needed, candidate.value)
        if not math.isfinite(value):
            return None
        candidate = replace(candidate, value=value)
    return None


def _looked_at(
    specification: Specification, search: GroupingSearch, candidate: Candidate
) -> Settled:
    """Return the candidate with its peaks over the whole here."""
    theta = search.canonical(candidate.theta)
    loops = search.blocks.expand(search.objective.controllers(theta))
    performance = specification.performance
    if specification.objective is Objective.TAU_P:
        value = math.exp(candidate.value) * (1 + ROUNDING)
        if value > LARGEST:
            message = f"tau_P would be {value:.3g}: take a longer unit of time"
            raise InvalidInputError(message, "/plant")
        performance = performance.with_tau_p(value)
    axis = proven_peaks(specification.plant, specification.uncertainty, performance, loops)
    kept = replace(candidate, theta=theta)
    return Settled(kept, performance, loops, axis.peaks, axis.curves, axis.guarantee)


def _above(search: GroupingSearch, candidate: Candidate, here: Settled) -> float:
    """Relative excess of the peak over what the candidate claims."""
    goal = search.objective.goal
    claimed = goal.target if goal.skewed else math.exp(candidate.value / 2)
    return float(here.peaks.robust_performance.value / claimed - 1)


def _high_places(here: Settled) -> NDArray[np.float64]:
    """Frequencies of the peak and of maxima nearly as high, rad per time unit."""
    mu, omega = here.curves.robust_performance, here.curves.omega
    padded = np.concatenate([[0.0], mu, [0.0]])
    top = here.peaks.robust_performance
    high = (mu >= padded[:-2]) & (mu >= padded[2:]) & (mu >= (1 - NEARLY) * top.value)
    places = np.flatnonzero(high)
    highest = places[np.argsort(-mu[places])[:MOST_PLACES]]
    return np.append(omega[highest], top.omega)
