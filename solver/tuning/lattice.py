"""The numbers that controllers accept around an optimum, and the best of them.

All roundings of the optimum; those found by fixing the coarsest setting first and tuning the others
anew, one after the other, from other optima too; and from the best of these on to the neighbours,
one and two settings at a time.
"""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np

from solver.mu.kernel import FINE
from solver.tuning.clock import OutOfTimeError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.phases import Phases
    from solver.tuning.resolution import Resolution
    from solver.tuning.together import Together

__all__ = ["Lattice", "Point"]

ALL_ROUNDINGS = 8  # settings up to which every rounding is tried, 2^8
PAIRS = 12  # settings up to which two are moved at a time
FROM = 3  # points that the search of neighbours goes out from
KEPT_OFF = 1e-4  # of mu: a peak between the points of the grid exceeds them by less
HELD = 1e-9  # half width, in log, of the box of a setting that is held
MOST_EVALUATIONS = 4_000
INFEASIBLE = 1e3  # in s: behind everything feasible, ordered by what is missing
WITHIN = 1e-8  # in log: rounding of a bound that is itself one of the numbers
PROVEN = 6  # of the best points: the axis between the grid's points may change their order

Point = tuple[Decimal, ...]


class Lattice:
    """The numbers that may be typed in, and what an objective makes of them.

    Parameters
    ----------
    resolution : Resolution
        The numbers.
    objective : Together
        What is made small, on frequencies that see what lies between those of the search.
    phases : Phases
        How to descend, within which box.
    descend : callable
        From phases that hold some settings, and a start, to the best settings; None: none.
    tick : callable
        Asked for time; may raise to stop.

    """

    def __init__(
        self,
        resolution: Resolution,
        objective: Together,
        phases: Phases,
        descend: Callable[[Phases, NDArray[np.float64]], NDArray[np.float64] | None],
        tick: Callable[[], None],
    ) -> None:
        self.resolution = resolution
        self.objective = objective
        self.phases = phases
        self.descend = descend
        self.tick = tick
        self.names = objective.kind.parameters * objective.signs.size
        self.known: dict[Point, float] = {}

    def theta(self, point: Point) -> NDArray[np.float64]:
        """Return the parameters of the search."""
        return np.asarray(np.log([float(value) for value in point]))

    def controllers(self, point: Point) -> tuple[Controller, ...]:
        """Return the controllers as they are typed in, one a group: no digit of rounding more."""
        per = self.objective.per_controller
        found = []
        for index, controller in enumerate(self.objective.controllers(self.theta(point))):
            typed = map(float, point[index * per : (index + 1) * per])
            settings = dict(zip(self.names, typed, strict=False))
            settings["gain"] = math.copysign(settings["gain"], controller.gain)
            found.append(replace(controller, **settings))
        return tuple(found)

    def best(self, optima: Sequence[NDArray[np.float64]]) -> list[tuple[float, Point]]:
        """Return the best points found, feasible on the search's axis, with their s, best first."""
        starts = {point for theta in optima for point in self._one_by_one(theta)}
        starts.update(self._roundings(optima[0]))
        for point in sorted(starts, key=self._value)[:FROM]:
            self._descend(point)
        return self._foremost()

    def hurried(self, theta: NDArray[np.float64]) -> list[tuple[float, Point]]:
        """Return the best of the roundings of one optimum and around, as far as time permits."""
        with suppress(OutOfTimeError):
            self._descend(min(self._roundings(theta), key=self._value))
        return self._foremost()

    def _foremost(self) -> list[tuple[float, Point]]:
        """Return the best feasible ones of the points looked at, with their s, best first."""
        order = sorted(self.known, key=self.known.__getitem__)
        least = ((self.known[point], point) for point in order[:PROVEN])
        return [(value, point) for value, point in least if value < INFEASIBLE]

    def polished(self, point: Point) -> Point:
        """Return a point with the settings that need no rounding as good as they can be."""
        free = [i for i, name in enumerate(self.names) if not self.resolution.limits(name)]
        if not free:
            return point
        held = {i: value for i, value in enumerate(point) if i not in free}
        phases, theta = self._holding(held, self.theta(point))
        found = self.descend(phases, theta)
        if found is None:
            return point
        return tuple(held.get(i, _decimal(value)) for i, value in enumerate(found))

    def _sides(self, index: int, log_value: float) -> list[Decimal]:
        """Return the numbers beside a setting, at most two."""
        name, value = self.names[index], _decimal(log_value)
        sides = (self.resolution.below(name, value), self.resolution.above(name, value))
        return list(dict.fromkeys(side for side in sides if side is not None))

    def _roundings(self, theta: NDArray[np.float64]) -> Iterator[Point]:
        sides = [self._sides(index, value) for index, value in enumerate(theta)]
        if len(sides) <= ALL_ROUNDINGS:
            yield from itertools.product(*sides)
            return
        logs = [np.log([float(side) for side in pair]) for pair in sides]
        yield tuple(
            pair[int(np.abs(log - value).argmin())]
            for pair, log, value in zip(sides, logs, theta, strict=True)
        )

    def _one_by_one(self, theta: NDArray[np.float64]) -> Iterator[Point]:
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
        box = self.phases.box
        low, high, start = box.low.copy(), box.high.copy(), theta.copy()
        for place, number in held.items():
            start[place] = math.log(number)
            low[place], high[place] = start[place] - HELD, start[place] + HELD
        narrow = replace(box, low=low, high=high)
        return replace(self.phases, box=narrow), narrow.clip(start)

    def _descend(self, point: Point) -> None:
        """Move to better neighbours until there is none."""
        while len(self.known) < MOST_EVALUATIONS:
            here = self._value(point)
            better = next((p for p in self._neighbours(point) if self._value(p) < here), None)
            if better is None:
                return
            point = better

    def _neighbours(self, point: Point) -> Iterator[Point]:
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

    def _value(self, point: Point) -> float:
        """Return s of a point; behind all of them what keeps no demand, by what is missing."""
        if point not in self.known:
            self.tick()
            self.known[point] = self._evaluated(self.theta(point))
        return self.known[point]

    def _evaluated(self, theta: NDArray[np.float64]) -> float:
        box = self.phases.box
        outside = np.maximum(box.low - theta, theta - box.high).max()
        if box.rows is not None and box.limits is not None:
            outside = max(outside, float((box.rows @ theta - box.limits).max()))
        if outside > WITHIN:
            return INFEASIBLE + 1e6 * float(outside)
        here = self.objective.evaluate(theta)
        return here.value if math.isfinite(here.value) else INFEASIBLE + here.merit


def _decimal(log_value: float) -> Decimal:
    return Decimal(repr(math.exp(log_value)))
