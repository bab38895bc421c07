"""How far settings may be moved: each alone, and all together in the direction that hurts most.

At the optimum mu is 1 at several frequencies, so that almost any change exceeds it. What may be
asked is how far settings may go before mu exceeds 1 at a time constant that is a little longer, or,
where mu itself was made small, before it exceeds what it is by as much. The least joint change in
the logarithms of the settings is found as the design point of reliability theory is (Hasofer and
Lind 1974): along the gradient of the curve that gives way first, turned at each visit of the limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import grid
from solver.model.peaks import tops
from solver.tuning.beside import SettingMove, SettingRange, SettingsTolerance
from solver.tuning.goals import MuGoal
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.model.weights import Performance
    from solver.tuning.objective import Evaluation
    from solver.tuning.search import GroupingSearch
    from solver.tuning.settle import Settled
    from solver.tuning.specification import Specification
    from solver.tuning.together import Together

__all__ = ["fine_objective", "moves", "tolerance"]

ALLOWED = 0.05  # share of tau_P, or of mu, that moves of the settings may cost
POINTS_PER_DECADE = 44  # a peak between them, even a kink, exceeds them by less than 1e-4
STEPS = np.log([1.02, 1.1, 1.4, 2.5, 10.0])  # distances at which the limit is first sought
NARROW = 1e-3  # of the distance: as close as the limit is sought,
REFINED = 12  # in at most so many steps
BEYOND = 0.4 * NARROW  # of where the lines cross the limit: the next step tells on which side it is
FORETOLD = 3  # crossings that are foretold before the next step outwards
VISITS = 4  # of the limit, each with a new direction
SHORTER = 0.98  # share of the least joint move at which single ones are looked at
LOWER = 0.95  # of all gains
NU = 1e-6  # barrier parameter: mu right to about as much
FIRST_TO_GIVE = 3  # curves whose gradients are tried as directions
APART = 0.2  # log omega between them
BESIDE = np.arange(-5, 6)  # points of the fine grid around a maximum, one of the search's in all


def tolerance(
    specification: Specification, search: GroupingSearch, end: Settled
) -> SettingsTolerance:
    """Return how far the settings of a result may be moved.

    Every value is of a fine grid of frequencies, as settings elsewhere on it are stable. Of many
    scenarios those count that the search keeps in sight.
    """
    fine = fine_objective(search)
    peak = max(axis.peaks.robust_performance.value for axis in end.axes)
    return moves(
        specification.objective, search.objective, fine, end.candidate.theta,
        performance=end.performance, peak=peak,
    )  # fmt: skip


def moves(
    sought: Objective,
    coarse: Together,
    fine: Together,
    theta: NDArray[np.float64],
    *,
    performance: Performance,
    peak: float,
) -> SettingsTolerance:
    """Return how far settings may be moved, as the frequencies of an objective tell.

    Parameters
    ----------
    sought : Objective
        What was made small.
    coarse, fine : Together
        Levels of everything that the settings must serve, on the frequencies of a search and on
        more of them, which have the last word.
    theta : (m,)
        The settings.
    performance : Performance
        The demand with the tau_P of the result.
    peak : float
        Of mu, the highest of all.

    """
    tau_p = performance.tau_p
    assert tau_p is not None  # noqa: S101 - for the type checker
    fine = fine.having(alone=None, service=None)
    objective = fine.having(goal=MuGoal(performance))
    if sought is Objective.TAU_P:
        level, longer = 1.0, (1 + ALLOWED) * tau_p
        judged = fine.having(goal=MuGoal(performance.with_tau_p(longer)))
    else:
        level, longer = max(1.0, (1 + ALLOWED) * peak), tau_p
        judged = objective
    names = objective.kind.parameters
    limit = 2 * math.log(level)
    near = _Near.of(coarse, judged, theta, limit)
    ranges = []
    for index, sign in _signs(objective):
        value = sign * math.exp(theta[index])
        axis = np.eye(theta.size)[index]
        ends = [near.distance(way * axis) for way in (-1, 1)]
        low, high = (
            None if end is None else sign * math.exp(theta[index] + way * end)
            for way, end in zip((-1, 1), ends, strict=True)
        )
        group, place = divmod(index, len(names))
        pair = (low, high) if sign > 0 else (high, low)
        ranges.append(SettingRange(group, names[place], value, *pair))
    lower = theta.copy()
    lower[:: len(names)] += math.log(LOWER)
    s = objective.evaluate(lower).value
    return SettingsTolerance(
        tau_p=longer,
        mu=level,
        alone=tuple(ranges),
        together=_together(near),
        lower_gains=math.exp(s / 2) if math.isfinite(s) else None,
    )


def fine_objective(search: GroupingSearch) -> Together:
    """Return the objective of a search on a grid that sees what lies between its points."""
    parts = search.objective.parts
    omega = [grid(p.omega[0], p.omega[-1], POINTS_PER_DECADE, [p.omega]) for p in parts]
    return search.objective.at(omega, [np.empty(0)] * len(parts)).having(nu=NU)


def _signs(objective: Together) -> list[tuple[int, float]]:
    """Return each parameter's index and sign: the gains have one."""
    per = objective.per_controller
    count = per * objective.signs.size
    return [(i, float(objective.signs[i // per]) if i % per == 0 else 1.0) for i in range(count)]


def _fewer(coarse: Together, fine: Together, here: Evaluation) -> Together:
    """Return a fine objective with what is near its maxima `here`, and of the rest the grid."""
    kept = []
    for part, own, at_first in zip(fine.parts, here.of_each, coarse.parts, strict=True):
        top = np.flatnonzero(tops(-own.level))
        near = np.unique(np.clip(top[:, None] + BESIDE, 0, part.omega.size - 1))
        kept.append(np.union1d(part.omega[near], at_first.omega))
    return fine.at(kept, [np.empty(0)] * len(kept))


@dataclass(frozen=True)
class _Seen:
    """What a move along a direction meets: the excess of a limit, and lines that it follows.

    Attributes
    ----------
    step : float
        How far along the direction.
    excess : float
        The greatest of all frequencies; infinite where the loops are unstable.
    heights, slopes : (k,)
        Of each frequency, and how it changes along the direction.

    """

    step: float
    excess: float
    heights: NDArray[np.float64]
    slopes: NDArray[np.float64]

    @property
    def crossing(self) -> float:
        """Where the lines first cross the limit, outwards or back; infinite where they do not."""
        inside = self.excess <= 0
        crossing = self.slopes > 0 if inside else (self.slopes > 0) & (self.heights > 0)
        if not math.isfinite(self.excess) or not crossing.any():
            return math.inf
        return self.step - float((self.heights[crossing] / self.slopes[crossing]).max())

    def or_outside(self, there: _Seen) -> tuple[_Seen, _Seen | None]:
        """Return the last point inside and the first outside, this one being inside."""
        return (there, None) if there.excess <= 0 else (self, there)


@dataclass(frozen=True)
class _Near:
    """By how much moves of settings `theta` exceed a limit: on all frequencies, and on fewer."""

    fine: Together
    few: Together
    theta: NDArray[np.float64]
    limit: float
    fine_here: Evaluation
    few_here: Evaluation

    @classmethod
    def of(
        cls, coarse: Together, fine: Together, theta: NDArray[np.float64], limit: float
    ) -> _Near:
        """Return that of a fine objective, with the frequencies of a coarse one."""
        here = fine.evaluate(theta)
        few = _fewer(coarse, fine, here)
        return cls(fine, few, theta, limit, here, few.evaluate(theta))

    def moved(self, move: NDArray[np.float64], *, fine: bool = False) -> Evaluation:
        """Evaluate a move, on the fewer frequencies or on all."""
        # From scales of their own: those at `theta` are too far off where eigenvalues meet.
        return (self.fine if fine else self.few).evaluate(self.theta + move)

    def distance(self, direction: NDArray[np.float64]) -> float | None:
        """Return how far one may go in a direction; None: ten times as far at least.

        All frequencies have the last word.
        """
        found = self._distance(direction, fine=False)
        last = (STEPS[-1] if found is None else found) * direction
        if self.moved(last, fine=True).value <= self.limit:
            return found
        return self._distance(direction, fine=True)

    def _distance(self, direction: NDArray[np.float64], *, fine: bool) -> float | None:
        """Return how far one may go in a direction; None: ten times as far at least.

        By the lines that the levels follow, from step to step outwards and then between the last
        point inside and the first one outside.
        """

        def look(step: float) -> _Seen:
            return seen(step, self.moved(step * direction, fine=fine))

        def seen(step: float, here: Evaluation) -> _Seen:
            heights, slopes = -here.level - self.limit, -here.gradient @ direction
            return _Seen(step, here.value - self.limit, heights, slopes)

        inside = seen(0.0, self.fine_here if fine else self.few_here)
        if inside.excess > 0:
            return 0.0
        outside: _Seen | None = None
        for step in STEPS.tolist():
            # Where the lines foretell a crossing before the next step, look there first.
            for _ in range(FORETOLD):
                near = inside.crossing * (1 + BEYOND)
                if outside is None and inside.step < near < step:
                    inside, outside = inside.or_outside(look(near))
            if outside is None:
                inside, outside = inside.or_outside(look(step))
            if outside is not None:
                return _between(look, inside, outside)
        return None


def _between(look: Callable[[float], _Seen], inside: _Seen, outside: _Seen) -> float:
    """Return the limit between a point inside and one outside, from inside."""
    for _ in range(REFINED):
        width = outside.step - inside.step
        if width <= NARROW * outside.step:
            break
        step = inside.step + 0.5 * width
        for near in (outside.crossing * (1 - BEYOND), inside.crossing * (1 + BEYOND)):
            if inside.step + NARROW * width < near < outside.step - NARROW * width:
                step = near
                break
        there = look(step)
        inside, outside = (there, outside) if there.excess <= 0 else (inside, there)
    return inside.step


def _together(near: _Near) -> tuple[SettingMove, ...]:
    """Return the least joint change that exceeds the limit, as far as this local search sees it."""
    names, size = near.few.kind.parameters, near.theta.size
    best = _along_gradients(near)
    for single in (way * axis for axis in np.eye(size) for way in (-1.0, 1.0)):
        shortest = float(np.linalg.norm(best)) if best is not None else float(STEPS[-1])
        if near.moved(SHORTER * shortest * single).value > near.limit:
            # One setting alone does it sooner.
            distance = near.distance(single)
            if distance is not None and distance < shortest:
                best = distance * single
    if best is None:
        return ()
    return tuple(
        SettingMove(index // len(names), names[index % len(names)], math.expm1(float(move)))
        for index, move in enumerate(best)
    )


def _along_gradients(near: _Near) -> NDArray[np.float64] | None:
    """Return the shortest move to the limit along gradients, turned at each visit."""
    best: NDArray[np.float64] | None = None
    for first in _gradients(near.few, near.few_here):
        direction = first
        for _ in range(VISITS):
            distance = near.distance(direction)
            if distance is None:
                break
            if best is None or distance < np.linalg.norm(best):
                best = distance * direction
            turned = _gradients(near.few, near.moved(distance * direction))
            if not turned or turned[0] @ direction > 1 - NARROW:
                break
            direction = turned[0]
    return best


def _gradients(objective: Together, here: Evaluation) -> list[NDArray[np.float64]]:
    """Return the directions in which the highest maxima of mu rise `here`, of length one."""
    if not math.isfinite(here.value):
        return []
    s = -here.level
    omega = np.concatenate([part.omega for part in objective.parts])
    found: list[NDArray[np.float64]] = []
    places: list[float] = []
    for index in np.argsort(-s):
        at = math.log(omega[index])
        if any(abs(at - other) < APART for other in places):
            continue
        places.append(at)
        rise = -here.gradient[index]
        length = float(np.linalg.norm(rise))
        if length > 0:
            found.append(rise / length)
        if len(found) == FIRST_TO_GIVE:
            break
    return found
