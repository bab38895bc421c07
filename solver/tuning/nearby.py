"""How far settings may be moved: each alone, and all together in the direction that hurts most.

At the optimum mu is 1 at several frequencies, so that almost any change exceeds it. What may be
asked is how far settings may go before mu exceeds 1 at a time constant that is a little longer, or,
where mu itself was made small, before it exceeds what it is by as much. The least joint change in
the logarithms of the settings is found as the design point of reliability theory is (Hasofer and
Lind 1974): along the gradient of the curve that gives way first, turned at each visit of the limit.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import grid
from solver.model.peaks import tops
from solver.tuning.beside import SettingMove, SettingRange, SettingsTolerance
from solver.tuning.goals import MuGoal
from solver.tuning.objective import Levels
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.weights import Performance
    from solver.tuning.search import GroupingSearch
    from solver.tuning.settle import Settled
    from solver.tuning.specification import Specification
    from solver.tuning.together import Together

__all__ = ["fine_objective", "moves", "tolerance"]

ALLOWED = 0.05  # share of tau_P, or of mu, that moves of the settings may cost
POINTS_PER_DECADE = 44  # a peak between them, even a kink, exceeds them by less than 1e-4
STEPS = np.log([1.1, 1.4, 2.5, 10.0])  # distances beyond which no limit is foretold
NARROW = 1e-3  # of the distance: as close as the limit is sought,
REACH = 0.3  # log mu^2 below the limit: lower maxima do not exceed it between the frequencies
LOOKS = 40  # in at most so many steps
BEFORE = 0.25 * NARROW  # of where a limit is foretold: the next step is to be inside
VISITS = 4  # of the limit, each with a new direction
LOWER = 0.95  # of all gains
NU = 1e-6  # barrier parameter: mu right to about as much
FIRST_TO_GIVE = 3  # curves whose gradients are tried as directions
APART = 0.2  # log omega between them
BESIDE = np.arange(-5, 6)  # points of the fine grid around a maximum, one of the search's in all


def tolerance(
    specification: Specification, search: GroupingSearch, end: Settled
) -> SettingsTolerance:
    """Return how far the settings of a result may be moved.

    Every value is of a grid of frequencies that is fine around the maxima of the curves; whether
    the loops are stable is as the grid of the search tells. Of many scenarios those count that
    the search keeps in sight.
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
    axes = [way * axis for axis in np.eye(theta.size) for way in (-1.0, 1.0)]
    first = _gradients(near.few, near.here)
    found = near.side_by_side(
        [*(near.distance(axis) for axis in axes), *(near.visited(each) for each in first)]
    )
    ends, joint = found[: len(axes)], found[len(axes) :]
    ranges = []
    for index, sign in _signs(objective):
        low, high = (
            None if end is None else sign * math.exp(theta[index] + end.move[index])
            for end in ends[2 * index : 2 * index + 2]
        )
        group, place = divmod(index, len(names))
        pair = (low, high) if sign > 0 else (high, low)
        value = sign * math.exp(theta[index])
        ranges.append(SettingRange(group, names[place], value, *pair))
    lower = theta.copy()
    lower[:: len(names)] += math.log(LOWER)
    s = objective.evaluate(lower).value
    return SettingsTolerance(
        tau_p=longer,
        mu=level,
        alone=tuple(ranges),
        together=_least(names, [*joint, *ends]),
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


def _fewer(coarse: Together, fine: Together, level: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Return which frequencies of each part are near maxima of `level`, or of the coarse grid."""
    kept = []
    ends = np.cumsum([part.omega.size for part in fine.parts])
    levels = np.split(level, ends[:-1])
    for part, own, at_first in zip(fine.parts, levels, coarse.parts, strict=True):
        top = np.flatnonzero(tops(-own))
        near = np.clip(top[:, None] + BESIDE, 0, part.omega.size - 1).ravel()
        kept.append(np.union1d(near, np.searchsorted(part.omega, at_first.omega)))
    return kept


@dataclass(frozen=True)
class _Seen:
    """What a move meets: the excess of the limit, and curves that it follows along a direction.

    Attributes
    ----------
    move : (m,)
        Of the settings.
    levels : Levels
        What the settings have there.
    step, excess : float
        How far along the direction, and the greatest of all frequencies; infinite where the loops
        are unstable.
    heights, slopes : (k,)
        Of each frequency, and how it changes along the direction.

    """

    move: NDArray[np.float64]
    levels: Levels
    step: float
    excess: float
    heights: NDArray[np.float64]
    slopes: NDArray[np.float64]

    def foretold(self, other: _Seen | None) -> float:
        """Where the curves first cross the limit, outwards or back; infinite where they do not.

        With the curvature that the slopes at another point tell.
        """
        if not math.isfinite(self.excess):
            return math.inf
        slopes, heights = self.slopes, self.heights
        bend = np.zeros_like(slopes)
        if other is not None and math.isfinite(other.excess) and other.step != self.step:
            bend = (slopes - other.slopes) / (self.step - other.step)
        inner = slopes**2 - 2 * bend * heights
        way = slopes + np.sqrt(np.maximum(inner, 0.0))
        crossing = (inner >= 0) & (way > 0)
        if self.excess > 0:
            crossing &= heights > 0
        if not crossing.any():
            return math.inf
        ahead = -2 * heights[crossing] / way[crossing]
        return self.step + float(ahead.min())


@dataclass(frozen=True)
class _Look:
    """A move that is to be looked at on fewer frequencies, or on these of the fine grids."""

    move: NDArray[np.float64]
    rows: list[NDArray[np.intp]] | None = None


_Walk = Generator[_Look, Levels, _Seen | None]


@dataclass(frozen=True)
class _Near:
    """By how much moves of settings `theta` exceed a limit: on all frequencies, and on fewer."""

    fine: Together
    few: Together
    theta: NDArray[np.float64]
    limit: float
    fine_here: Levels
    here: Levels

    @classmethod
    def of(
        cls, coarse: Together, fine: Together, theta: NDArray[np.float64], limit: float
    ) -> _Near:
        """Return that of a fine objective, with the frequencies of a coarse one, among its own."""
        here = fine.levels_at(theta[None])[0]
        kept = _fewer(coarse, fine, here.level)
        omega = [part.omega[own] for part, own in zip(fine.parts, kept, strict=True)]
        few = fine.at(omega, [np.empty(0)] * len(omega))
        first = np.cumsum([0, *(part.omega.size for part in fine.parts[:-1])])
        rows = np.concatenate([start + own for start, own in zip(first, kept, strict=True)])
        few_here = Levels(here.value, here.level[rows], here.gradient[rows])
        return cls(fine, few, theta, limit, here, few_here)

    def side_by_side(self, walks: Sequence[_Walk]) -> list[_Seen | None]:
        """Return what the walks find; all that they look at next is computed at once."""
        found: list[_Seen | None] = [None] * len(walks)
        waiting: dict[int, _Look] = {}

        def go_on(index: int, seen: Levels | None) -> None:
            try:
                waiting[index] = next(walks[index]) if seen is None else walks[index].send(seen)
            except StopIteration as end:
                waiting.pop(index, None)
                found[index] = end.value

        for index in range(len(walks)):
            go_on(index, None)
        while waiting:
            few = [index for index, look in waiting.items() if look.rows is None]
            fine = [index for index in waiting if index not in few]
            for asked, objective in ((few, self.few), (fine, self._at(waiting, fine))):
                moves = [waiting[index].move for index in asked]
                if not moves:
                    continue
                # From scales of their own: those at `theta` are too far off where eigenvalues meet.
                seen = objective.levels_at(self.theta + np.stack(moves))
                for index, each in zip(asked, seen, strict=True):
                    go_on(index, each)
        return found

    def _at(self, waiting: dict[int, _Look], asked: Sequence[int]) -> Together:
        """Return the fine objective with all rows that any of some looks asks for."""
        every = [waiting[index].rows or [] for index in asked]
        omega = [
            part.omega[np.unique(np.concatenate(rows))]
            for part, *rows in zip(self.fine.parts, *every, strict=True)
            if rows
        ]
        return self.fine.at(omega, [np.empty(0)] * len(omega)) if omega else self.fine

    def distance(self, direction: NDArray[np.float64]) -> _Walk:
        """Go in a direction up to the limit; None: ten times as far at least.

        The fine grids have the last word around the maxima, where anything higher may be.
        """
        found = yield from self._distance(direction, fine=False)
        there = yield _Look(found.move, self._around(found))
        if not -there.level.min() <= self.limit:
            found = yield from self._distance(direction, fine=True)
        return found if found.step < STEPS[-1] else None

    def _around(self, seen: _Seen) -> list[NDArray[np.intp]]:
        """Return which frequencies of each fine grid lie beside high maxima of the fewer ones."""
        rows = []
        ends = np.cumsum([part.omega.size for part in self.few.parts])
        heights = np.split(seen.heights, ends[:-1])
        for part, fewer, own in zip(self.fine.parts, self.few.parts, heights, strict=True):
            top = np.flatnonzero(tops(own) & (own > -REACH))
            first = np.searchsorted(part.omega, fewer.omega[np.maximum(top - 1, 0)])
            last = np.searchsorted(part.omega, fewer.omega[np.minimum(top + 1, own.size - 1)])
            beside = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
            rows.append(np.concatenate([*beside, [0, part.omega.size - 1]]).astype(np.intp))
        return rows

    def _distance(
        self, direction: NDArray[np.float64], *, fine: bool
    ) -> Generator[_Look, Levels, _Seen]:
        """Go in a direction up to the limit, or ten times as far.

        By the curves that the levels follow, at first no further than the next of `STEPS`, then
        between the last point inside and the first one outside. The limit is known where it is
        foretold, or seen, as close to a point inside as it is sought.
        """

        def seen(step: float, here: Levels) -> _Seen:
            heights, slopes = -here.level - self.limit, -here.gradient @ direction
            return _Seen(step * direction, here, step, here.value - self.limit, heights, slopes)

        rows = [np.arange(part.omega.size) for part in self.fine.parts] if fine else None
        inside = last = seen(0.0, self.fine_here if fine else self.here)
        before: _Seen | None = None
        outside = math.inf
        if inside.excess > 0:
            return inside
        for _ in range(LOOKS):
            foretold = last.foretold(before)
            end = outside
            if last is inside and before is not None:
                end = min(outside, foretold)
            if end - inside.step <= NARROW * inside.step or inside.step >= STEPS[-1]:
                break
            farthest = min(outside, float(STEPS[np.searchsorted(STEPS, inside.step, "right")]))
            low, high = inside.step, farthest
            if outside < math.inf:
                low, high = low + NARROW * (high - low) / 2, high - NARROW * (high - low) / 2
            step = (1 - BEFORE) * foretold
            if not low < step < high:
                step = farthest if outside > farthest else 0.5 * (inside.step + outside)
            there = seen(step, (yield _Look(step * direction, rows)))
            before, last = last, there
            if there.excess <= 0:
                inside = there
            else:
                outside = step
        return inside

    def visited(self, direction: NDArray[np.float64]) -> _Walk:
        """Return the shortest move to the limit along gradients, turned at each visit."""
        best: _Seen | None = None
        for _ in range(VISITS):
            found = yield from self.distance(direction)
            if found is None:
                break
            if best is None or found.step < best.step:
                best = found
            there = found.levels
            if there.level.size != self.here.level.size:  # of all frequencies
                there = yield _Look(found.move)
            turned = _gradients(self.few, there)
            if not turned or turned[0] @ direction > 1 - NARROW:
                break
            direction = turned[0]
        return best


def _least(names: Sequence[str], found: Sequence[_Seen | None]) -> tuple[SettingMove, ...]:
    """Return the least change that exceeds the limit, as far as this local search sees it.

    Of equal ones the first.
    """
    ends = [each for each in found if each is not None]
    if not ends:
        return ()
    best = min(ends, key=lambda each: each.step)
    return tuple(
        SettingMove(index // len(names), names[index % len(names)], math.expm1(float(move)))
        for index, move in enumerate(best.move)
    )


def _gradients(objective: Together, here: Levels) -> list[NDArray[np.float64]]:
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
