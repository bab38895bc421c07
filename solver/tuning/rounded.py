"""The best settings among the numbers that a controller accepts.

Rounding each setting by itself is not safe, in neither direction: with 45, 100, 18, 2.4 for 47.66,
101.2, 18.90, 2.361 ("lower, to be safe") mu is 1.037. So the numbers around the optimum are
searched: all roundings of it; those found by fixing the coarsest setting first and tuning the
others anew, one after the other, from other optima too; and from the best of these on to the
neighbours, one and two settings at a time. What comes out is proven as it is typed.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np

from solver.mu.kernel import FINE
from solver.tuning.attained import Attained, attained_by_all
from solver.tuning.beside import PriceOfResolution
from solver.tuning.nearby import fine_objective
from solver.tuning.settle import SPREAD_ROUNDS, WORSE
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.clock import Clock
    from solver.tuning.phases import Phases
    from solver.tuning.resolution import Resolution
    from solver.tuning.search import GroupingSearch
    from solver.tuning.settle import Settled
    from solver.tuning.solutions import Solutions
    from solver.tuning.specification import Specification

__all__ = ["rounded", "too_coarse"]

OTHERS = 4  # local optima that the search starts from
ALL_ROUNDINGS = 8  # settings up to which every rounding is tried, 2^8
PAIRS = 12  # settings up to which two are moved at a time
FROM = 3  # points that the search of neighbours goes out from
KEPT_OFF = 1e-4  # of mu: a peak between the points of the grid exceeds them by less
HELD = 1e-9  # half width, in log, of the box of a setting that is held
MOST_EVALUATIONS = 4_000
INFEASIBLE = 1e3  # in s: behind everything feasible, ordered by what is missing
WITHIN = 1e-8  # in log: rounding of a bound that is itself one of the numbers
PROVEN = 6  # of the best points: the axis between the grid's points may change their order

_Point = tuple[Decimal, ...]


def rounded(
    specification: Specification,
    solutions: Solutions,
    search: GroupingSearch,
    end: Settled,
    clock: Clock,
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

    """
    assert specification.resolution is not None  # noqa: S101 - for the type checker
    lattice = _Lattice(specification.resolution, search, clock)
    best: Settled | None = None
    for seen, point in lattice.best(_optima(solutions, search, end)):
        if best is not None and seen >= best.candidate.value:
            break
        typed = lattice.polished(point)
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


class _Lattice:
    """The numbers that may be typed in, and what the search's objective makes of them."""

    def __init__(self, resolution: Resolution, search: GroupingSearch, clock: Clock) -> None:
        self.resolution = resolution
        self.search = search
        self.clock = clock
        self.names = search.objective.kind.parameters * len(search.groups)
        self.objective = fine_objective(search)
        self.known: dict[_Point, float] = {}

    def theta(self, point: _Point) -> NDArray[np.float64]:
        """Return the parameters of the search."""
        return np.asarray(np.log([float(value) for value in point]))

    def controllers(self, point: _Point) -> tuple[Controller, ...]:
        """Return the controllers as they are typed in, one a group: no digit of rounding more."""
        per = self.search.objective.per_controller
        found = []
        for index, controller in enumerate(self.search.objective.controllers(self.theta(point))):
            typed = map(float, point[index * per : (index + 1) * per])
            settings = dict(zip(self.names, typed, strict=False))
            settings["gain"] = math.copysign(settings["gain"], controller.gain)
            found.append(replace(controller, **settings))
        return tuple(found)

    def best(self, optima: Sequence[NDArray[np.float64]]) -> list[tuple[float, _Point]]:
        """Return the best points found, feasible on the search's axis, with their s, best first."""
        starts = {point for theta in optima for point in self._one_by_one(theta)}
        starts.update(self._roundings(optima[0]))
        for point in sorted(starts, key=self._value)[:FROM]:
            self._descend(point)
        order = sorted(self.known, key=self.known.__getitem__)
        least = ((self.known[point], point) for point in order[:PROVEN])
        return [(value, point) for value, point in least if value < INFEASIBLE]

    def polished(self, point: _Point) -> _Point:
        """Return a point with the settings that need no rounding as good as they can be."""
        free = [i for i, name in enumerate(self.names) if not self.resolution.limits(name)]
        if not free:
            return point
        held = {i: value for i, value in enumerate(point) if i not in free}
        phases, theta = self._holding(held, self.theta(point))
        exact = replace(self.search.exact, phases=phases)
        found = exact.descend(theta)
        if found is None:
            return point
        return tuple(held.get(i, _decimal(value)) for i, value in enumerate(found.theta))

    def _sides(self, index: int, log_value: float) -> list[Decimal]:
        """Return the numbers beside a setting, at most two."""
        name, value = self.names[index], _decimal(log_value)
        sides = (self.resolution.below(name, value), self.resolution.above(name, value))
        return list(dict.fromkeys(side for side in sides if side is not None))

    def _roundings(self, theta: NDArray[np.float64]) -> Iterator[_Point]:
        sides = [self._sides(index, value) for index, value in enumerate(theta)]
        if len(sides) <= ALL_ROUNDINGS:
            yield from itertools.product(*sides)
            return
        logs = [np.log([float(side) for side in pair]) for pair in sides]
        yield tuple(
            pair[int(np.abs(log - value).argmin())]
            for pair, log, value in zip(sides, logs, theta, strict=True)
        )

    def _one_by_one(self, theta: NDArray[np.float64]) -> Iterator[_Point]:
        """Fix the coarsest setting to its better side, tune the others anew, and so on."""
        fixed: dict[int, Decimal] = {}
        goal = self.objective.goal
        # Settings that need no rounding must not end where the next frequency exceeds the level.
        kept = replace(goal, target=goal.target * (1 - KEPT_OFF))
        objective = self.objective.having(nu=FINE, goal=kept)
        while len(fixed) < theta.size:
            sides = {i: self._sides(i, theta[i]) for i in range(theta.size) if i not in fixed}
            index = max(sides, key=lambda i: math.log(sides[i][-1]) - math.log(sides[i][0]))
            best = None
            for side in sides[index]:
                phases, start = self._holding({**fixed, index: side}, theta)
                here = objective.evaluate(start)
                if math.isfinite(here.merit):
                    here = phases.best(objective, here, 1e-6)
                if best is None or here.merit < best[1].merit:
                    best = side, here
            if best is None:
                return
            fixed[index] = best[0]
            if math.isfinite(best[1].merit):
                theta = best[1].theta
        yield tuple(fixed[index] for index in range(theta.size))

    def _holding(
        self, held: Mapping[int, Decimal], theta: NDArray[np.float64]
    ) -> tuple[Phases, NDArray[np.float64]]:
        """Return how to descend with some settings held, and where to start."""
        box = self.search.box
        low, high, start = box.low.copy(), box.high.copy(), theta.copy()
        for place, number in held.items():
            start[place] = math.log(number)
            low[place], high[place] = start[place] - HELD, start[place] + HELD
        narrow = replace(box, low=low, high=high)
        return replace(self.search.phases, box=narrow), narrow.clip(start)

    def _descend(self, point: _Point) -> None:
        """Move to better neighbours until there is none."""
        while len(self.known) < MOST_EVALUATIONS:
            here = self._value(point)
            better = next((p for p in self._neighbours(point) if self._value(p) < here), None)
            if better is None:
                return
            point = better

    def _neighbours(self, point: _Point) -> Iterator[_Point]:
        moves = [self._moves(name, value) for name, value in zip(self.names, point, strict=True)]
        for index, options in enumerate(moves):
            for option in options:
                yield (*point[:index], option, *point[index + 1 :])
        if len(point) > PAIRS:
            return
        for i, j in itertools.combinations(range(len(point)), 2):
            for a, b in itertools.product(moves[i], moves[j]):
                moved = list(point)
                moved[i], moved[j] = a, b
                yield tuple(moved)

    def _moves(self, name: str, value: Decimal) -> Sequence[Decimal]:
        if not self.resolution.limits(name):
            return ()
        below = self.resolution.below(name, value, strictly=True)
        above = self.resolution.above(name, value, strictly=True)
        return (above,) if below is None else (below, above)

    def _value(self, point: _Point) -> float:
        """Return s of a point; behind all of them what keeps no demand, by what is missing."""
        if point not in self.known:
            self.clock.tick()
            self.known[point] = self._evaluated(self.theta(point))
        return self.known[point]

    def _evaluated(self, theta: NDArray[np.float64]) -> float:
        box = self.search.box
        outside = np.maximum(box.low - theta, theta - box.high).max()
        if box.rows is not None and box.limits is not None:
            outside = max(outside, float((box.rows @ theta - box.limits).max()))
        if outside > WITHIN:
            return INFEASIBLE + 1e6 * float(outside)
        here = self.objective.evaluate(theta)
        return here.value if math.isfinite(here.value) else INFEASIBLE + here.merit


def _decimal(log_value: float) -> Decimal:
    return Decimal(repr(math.exp(log_value)))
