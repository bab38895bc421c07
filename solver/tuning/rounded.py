"""The best settings among the numbers that a controller accepts.

Rounding each setting by itself is not safe, in neither direction: with 45, 100, 18, 2.4 for 47.66,
101.2, 18.90, 2.361 ("lower, to be safe") mu is 1.037. So the numbers around the optimum are
searched (`solver.tuning.lattice`), and what comes out is proven as it is typed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.tuning.attained import Attained, attained_by_all
from solver.tuning.beside import PriceOfResolution
from solver.tuning.lattice import Lattice
from solver.tuning.nearby import fine_objective
from solver.tuning.settle import SPREAD_ROUNDS, WORSE
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.clock import Clock
    from solver.tuning.phases import Phases
    from solver.tuning.search import GroupingSearch
    from solver.tuning.settle import Settled
    from solver.tuning.solutions import Solutions
    from solver.tuning.specification import Specification

__all__ = ["rounded", "too_coarse"]

OTHERS = 4  # local optima that the search starts from


def rounded(
    specification: Specification,
    solutions: Solutions,
    search: GroupingSearch,
    end: Settled,
    clock: Clock,
    *,
    hurried: bool = False,
) -> tuple[Settled, PriceOfResolution] | None:
    """Return the best settings that can be typed in, and what they cost; None: none were found.

    Parameters
    ----------
    specification : Specification
        The task, with a resolution.
    solutions : Solutions
        All searches: a coarse resolution may favour another optimum.
    search : GroupingSearch
        Where the settings come from.
    end : Settled
        The best settings without a resolution.
    clock : Clock
        Asked for time; may raise to stop.
    hurried : bool
        Whether to look around the best settings only, and to make do with what time permits.

    """
    assert specification.resolution is not None  # noqa: S101 - for the type checker

    def descend(phases: Phases, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        own = replace(search.exact, phases=phases).descend(theta)
        return None if own is None else own.theta

    lattice = Lattice(
        specification.resolution, fine_objective(search), search.phases, descend, clock.tick
    )
    best: Settled | None = None
    if hurried:
        points = lattice.hurried(end.candidate.theta)
    else:
        points = lattice.best(_optima(solutions, search, end))
    for seen, point in points:
        if best is not None and seen >= best.candidate.value:
            break
        typed = point if hurried else lattice.polished(point)
        theta = lattice.theta(typed)
        if not search.accepts(theta):
            continue
        loops = search.blocks.expand(lattice.controllers(typed))
        found = attained_by_all(specification, search.cases, loops)
        if found is not None:
            now = _settled(specification, end, theta, loops, found)
            if best is None or now.candidate.value < best.candidate.value:
                best = now
    if best is not None:
        best = _over_the_spread(specification, search, best, clock)
    if best is None:
        return None
    exact, now_exact = end.performance.tau_p, best.performance.tau_p
    assert exact is not None  # noqa: S101 - for the type checker
    assert now_exact is not None  # noqa: S101 - for the type checker
    tops = (max(axis.peaks.robust_performance.value for axis in each.axes) for each in (end, best))
    return best, PriceOfResolution(exact, now_exact, *tops)


def _over_the_spread(
    specification: Specification, search: GroupingSearch, best: Settled, clock: Clock
) -> Settled | None:
    """Return typed settings with what the worst plants of a spread make of them."""
    for _ in range(SPREAD_ROUNDS):
        clock.tick()
        worst = search.worst_of_spread(best.candidate)
        if worst is None:
            return best
        case, outcome, s = worst
        best = replace(best, spread=outcome)
        if s <= best.candidate.value + WORSE:
            return best
        search.include(case)
        found = attained_by_all(specification, search.cases, best.loops)
        if found is None:
            return None
        best = _settled(specification, best, best.candidate.theta, best.loops, found)
    return best


def too_coarse(end: Settled) -> str:
    """Say that exact settings exist, but none that the controllers accept."""
    return (
        "no numbers that the resolution permits were found that keep the demand; with exact ones "
        f"mu = {end.peaks.robust_performance.value:.6g} at tau_p = {end.performance.tau_p:.6g}"
    )


def _optima(
    solutions: Solutions, search: GroupingSearch, end: Settled
) -> list[NDArray[np.float64]]:
    """Return the best optimum, the next best ones, and the best identical settings."""
    found = [end.candidate.theta, *(optimum.theta for optimum in search.optima[1:OTHERS])]
    one = solutions.identical()
    if one is not None and one.candidate is not None and one.search is not search:
        found.append(np.tile(one.candidate.theta, len(search.groups)))
    return found


def _settled(
    specification: Specification,
    end: Settled,
    theta: NDArray[np.float64],
    loops: tuple[Controller, ...],
    found: tuple[Attained, ...],
) -> Settled:
    """Return the settings in the place of the exact ones, by what they attain of each case."""
    performance = found[0].performance
    assert performance.tau_p is not None  # noqa: S101 - for the type checker
    tops = [each.peaks.robust_performance for each in found]
    value = 2 * math.log(max(top.value for top in tops))
    if specification.objective is Objective.TAU_P:
        value = math.log(performance.tau_p)
    peaks = tuple(np.array([top.omega]) for top in tops)
    candidate = replace(end.candidate, theta=theta, value=value, peaks=peaks)
    axes = tuple(
        replace(end.axes[0], peaks=each.peaks, curves=each.curves, guarantee=each.guarantee)
        for each in found
    )
    performance = end.performance.with_tau_p(performance.tau_p)
    return replace(end, candidate=candidate, performance=performance, loops=loops, axes=axes)
