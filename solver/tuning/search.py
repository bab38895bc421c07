"""Multi-start search for the best settings of one grouping.

Every start descends in two phases. While no tau_P at all can be had, mu at an infinitely slow
loop is made smaller (its peak below 1 means that some tau_P exists); from there the objective
itself. The grid then receives the refined peaks of the best optima until the reported peak no
longer moves. There is no guarantee that the best optimum found is the global one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import reduce
from solver.model.frequencies import corners, grid, low_end, resonances
from solver.model.peaks import local_peaks
from solver.model.plants import ParallelPlant
from solver.model.weights import Performance
from solver.mu.kernel import FINE
from solver.optimality.record import SettingsProblem
from solver.tuning.bounds import gain_signs, parameter_box
from solver.tuning.minimax import minimise
from solver.tuning.objective import BESIDE, Evaluation, Goal, LoopObjective, MuGoal, TauGoal
from solver.tuning.specification import Objective, Specification

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.tuning.groupings import Groups

__all__ = ["Candidate", "GroupingSearch", "Optimum"]

POINTS_PER_DECADE = 11
STARTS_PER_PARAMETER = 3
STARTS_BEFORE_HOPS = 2  # a parameter, where the search goes on from the best optimum
SAME_VALUE = 5e-3  # difference of s below which two optima may be one
SAME_PLACE = 0.05  # and of the log parameters
FLAT = 1e-4  # difference of s between optima that are one to the count of optima
ROUGH = 1e-5  # tolerance in s of a start's descent
ROUGH_NU = 1e-4  # and its barrier parameter
EXACT = 1e-8  # of the last descent
SETTLED = 1e-8  # excess of the demand anywhere on the axis at which the last descent may end
NEARLY_ACTIVE = 0.05  # excess of the demand from which a peak is followed
WEAKEST = 1e-12  # gain of a direction over that of the strongest one
POLISHED = 3  # optima whose exact values are found
FIRST_ZOOMS = 2  # rounds of zooming before a peak is followed
EXACT_ROUNDS = 10
ENOUGH_ROOM = -0.02  # log mu^2 at which the first phase ends
HOP = 1.0  # in log time
GAIN_STEP = 0.3  # an unstable start is tried again with this share of its gains
GAIN_STEPS = 12


@dataclass(frozen=True)
class Optimum:
    """A local optimum and how many starts ended there; of the grid, or exact."""

    theta: NDArray[np.float64]
    value: float
    count: int


@dataclass(frozen=True)
class Candidate:
    """Settings with their exact value: s right between the grid points too.

    `peaks` are the frequencies where it is attained, `excess` is the most by which they miss the
    level that the estimate of s demanded.
    """

    theta: NDArray[np.float64]
    value: float
    peaks: NDArray[np.float64]
    excess: float


_Found = Evaluation | Optimum | Candidate


class GroupingSearch:
    """The search for one grouping.

    Parameters
    ----------
    specification : Specification
        The task.
    groups : Groups
        The partition of the units.
    target : float
        Greatest mu that the settings may have.
    checkpoint : callable
        Called often with the value s so far; may raise to stop.

    """

    def __init__(
        self,
        specification: Specification,
        groups: Groups,
        target: float,
        checkpoint: Callable[[float], None],
    ) -> None:
        self.specification = specification
        self.groups = groups
        self.checkpoint = checkpoint
        plant, uncertainty = specification.plant, specification.uncertainty
        self.blocks = reduce(plant, groups, uncertainty.structure)
        self.box = parameter_box(specification, groups)
        performance = specification.performance
        goal: Goal
        if specification.objective is Objective.TAU_P:
            goal = TauGoal(performance, target)
        else:
            goal = MuGoal(performance)
        bends = corners(plant, uncertainty)
        omega = grid(1e-2 * bends[0], 30 * bends[-1], POINTS_PER_DECADE, [resonances(plant)])
        omega = np.concatenate([self._below(omega[0]), omega])
        signs = gain_signs(plant, groups)
        self.objective = LoopObjective(
            self.blocks, uncertainty, goal, specification.kind, signs, omega, ROUGH_NU
        )
        slow = Performance(performance.max_peak, performance.offset)
        self.feasibility = replace(self.objective, goal=MuGoal(slow, target))
        self.optima: list[Optimum] = []
        self.closest: Evaluation | None = None

    def _below(self, bend: float) -> NDArray[np.float64]:
        """Frequencies down to the limit for omega -> 0, for its value and slope.

        The limit is reached as omega^2, by a weak direction of the plant at lower frequencies.
        """
        blocks = self.blocks.response(bend)
        singular = np.concatenate([np.linalg.svd(G[0], compute_uv=False) for G in blocks])
        weakest = max(singular.min() / singular.max(), WEAKEST)
        low = 1e-2 * bend * weakest
        between = np.geomspace(low, bend, math.ceil(math.log10(bend / low)) + 1)[1:-1]
        return np.concatenate([[low, 2 * low], between])

    @property
    def problem(self) -> SettingsProblem:
        """What is asked for, as a proof of optimality takes it."""
        objective = self.objective
        return SettingsProblem(
            self.blocks, objective.uncertainty, self.specification.performance, objective.signs,
            self.box.low, self.box.high, objective.omega,
        )  # fmt: skip

    @property
    def default_starts(self) -> int:
        """Most starts when no number is asked for: the more parameters, the more optima."""
        each = STARTS_PER_PARAMETER if len(self.groups) == 1 else STARTS_BEFORE_HOPS
        return each * self.box.low.size

    @property
    def settled(self) -> bool:
        """Whether the starts made so far let one expect no further optimum.

        The Bayesian rule of Boender and Rinnooy Kan (1987): with equally likely unknown optima, w
        found by N starts, there are w (N - 1)/(N - w - 2) of them to be expected.
        """
        found = [optimum for optimum in self.optima if optimum.count > 0]
        values = [optimum.value for optimum in found]
        # Places along a flat valley, or permuted ones of nearly equal settings, are one optimum.
        w = len(found) - sum(b - a < FLAT for a, b in pairwise(values))
        N = sum(optimum.count for optimum in found)
        return w > 0 and w * (N - 1) < (w + 0.5) * (N - w - 2)

    def starts(self, count: int) -> NDArray[np.float64]:
        """Return starting points (count, m), well spread over the box, that the seed fixes.

        Multiples of powers of the generalised golden ratio, modulo 1 (Roberts 2018).
        """
        size = self.box.low.size
        ratio = 1.0
        for _ in range(60):
            ratio = (1 + ratio) ** (1 / (size + 1))
        first = np.random.default_rng(self.specification.seed).random(size)
        steps = np.arange(1, count + 1)[:, None] * ratio ** -np.arange(1.0, size + 1)
        return np.asarray(self.box.low + (first + steps) % 1 * (self.box.high - self.box.low))

    def descend(self, theta: NDArray[np.float64], count: int = 1) -> None:
        """Remember the local optimum below one start, if it leads to feasible settings.

        It counts as `count` starts: 0 where the point was not drawn.
        """
        here = self._stable(theta)
        if here is None:
            return
        if self.objective.goal.skewed:
            here = minimise(
                self.feasibility, here, self.box, tolerance=1e-4, max_iterations=80,
                enough=lambda e: e.merit <= ENOUGH_ROOM,
                checkpoint=lambda _: self.checkpoint(math.inf),
            )  # fmt: skip
            if self.closest is None or here.value < self.closest.value:
                self.closest = here
            if here.value >= 0:
                return
            here = self.objective.evaluate(here.theta)
        if math.isfinite(here.merit):
            here = minimise(
                self.objective, here, self.box, tolerance=ROUGH, checkpoint=self.checkpoint,
                enough=lambda e: self._known(e) is not None,
            )  # fmt: skip
        if not math.isfinite(here.value):
            return
        self._remember(here, count)

    def hop(self) -> None:
        """Descend from beside the best optimum, until none better is found.

        Optima of unlike controllers lie in rows, one integral or derivative time after the other
        shorter than the last (monotonic basin hopping, Leary 2000).
        """
        if len(self.groups) == 1:
            return
        times = np.flatnonzero(np.arange(self.box.low.size) % self.objective.per_controller)
        moves = [step * np.eye(self.box.low.size)[i] for i in times for step in (-HOP, HOP)]
        left = list(moves)
        while left and self.optima:
            best = self.optima[0]
            self.descend(self.box.clip(best.theta + left.pop()), count=0)
            if self.optima[0].value < best.value - ROUGH:
                left = list(moves)

    def polish(self) -> list[Candidate]:
        """Replace the best optima of the grid by exact ones, and return those.

        The grid sees less than the whole axis, so an optimum whose value on it is already above an
        exact one stays as it is.
        """
        rough, self.optima = self.optima, []
        found: list[Candidate] = []
        best, attempts = math.inf, 0
        for optimum in rough:
            if optimum.value > best:
                self._remember(optimum, optimum.count)
            elif attempts < POLISHED:
                attempts += 1
                candidate = self.exact(optimum.theta, best)
                if candidate is not None:
                    found.append(candidate)
                    best = min(best, candidate.value)
                    self._remember(candidate, optimum.count)
        return found

    def exact(self, theta: NDArray[np.float64], beaten: float = math.inf) -> Candidate | None:
        """Descend with the peaks followed, until the value is that of the whole axis.

        None where no settings near `theta` meet the demand between the grid's points too. Ends
        early where the value cannot fall below `beaten`.
        """
        peaks = self._peaks_between(self.objective.evaluate(theta))
        omega = self.objective.omega
        best: Candidate | None = None
        candidate: Candidate | None = None
        for _ in range(EXACT_ROUNDS):
            objective = replace(self.objective, omega=omega, nu=FINE, followed=peaks)
            here = objective.evaluate(theta)
            if not math.isfinite(here.merit) and objective.goal.skewed:
                here = self._restored(objective, theta)
            if not math.isfinite(here.merit):
                break
            here = minimise(objective, here, self.box, tolerance=EXACT, checkpoint=self.checkpoint)
            before, candidate = candidate, self.measure(here.theta, here.s)
            if best is None or candidate.value < best.value:
                best = candidate
            stuck = before is not None and abs(candidate.value - before.value) < SETTLED
            # Here is the least value for fewer frequencies than there are.
            if stuck or candidate.excess <= SETTLED or here.merit > beaten:
                break
            # Some peak was not followed, or is a kink, which no parabola meets: follow it from now
            # on, and hold it at its place too.
            missed = self._missed(here, omega, candidate.peaks)
            far = np.abs(np.log(missed[:, None] / here.peaks)) > BESIDE
            peaks = np.append(here.peaks, missed[far.all(axis=1)])
            theta, omega = here.theta, np.union1d(omega, candidate.peaks)
        return best if best is not None and math.isfinite(best.value) else None

    def _peaks_between(self, here: Evaluation) -> NDArray[np.float64]:
        """Return the peaks of the demand's excess between the points of the grid."""
        omega = self.objective.omega
        peaks, _ = local_peaks(
            lambda points: self._excess(here, points), omega, here.demand - here.level,
            within=NEARLY_ACTIVE, rounds=FIRST_ZOOMS,
        )  # fmt: skip
        return self._missed(here, omega, peaks)

    def _missed(
        self, here: Evaluation, omega: NDArray[np.float64], peaks: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Those of the peaks that the fixed frequencies `omega` of an evaluation do not show.

        A plateau, or an end of the axis, is shown.
        """
        shown = (here.demand - here.level)[: omega.size]
        right = np.clip(np.searchsorted(omega, peaks), 1, omega.size - 1)
        highest = np.maximum(shown[right - 1], shown[right])
        return peaks[self._excess(here, peaks) > highest + SETTLED]

    def _excess(self, here: Evaluation, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Demand less level at any frequencies, (k,), for the settings and s of an evaluation."""
        return self.objective.goal.demand(here.s, omega)[0] - self.objective.levels(
            here.theta, omega
        )

    def measure(self, theta: NDArray[np.float64], s: float) -> Candidate:
        """Return the exact value of given parameters near `s`, by refining every peak."""
        bends = corners(
            self.specification.plant,
            self.specification.uncertainty,
            self.objective.controllers(theta),
        )
        low = low_end(
            lambda points: np.exp(self._attained(theta, points)),
            min(1e-4 * bends[0], self.objective.omega[0]),
            WEAKEST * bends[0],
        )
        high = max(1e2 * bends[-1], self.objective.omega[-1])
        extra = [resonances(self.specification.plant), bends, self.objective.omega]
        omega = grid(low, high, 2 * POINTS_PER_DECADE, extra)
        missed = []
        for _ in range(2):  # the peaks of the demand's excess move little with s

            def excess(points: NDArray[np.float64], at: float = s) -> NDArray[np.float64]:
                demand = self.objective.goal.demand(at, points)[0]
                return demand - self.objective.levels(theta, points)

            peaks, missing = local_peaks(excess, omega, excess(omega))
            missed.append(float(missing.max()))
            s = float(self._attained(theta, peaks).max())
            if not math.isfinite(s):
                break
        return Candidate(theta, s, peaks, missed[0])

    def _attained(
        self, theta: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return self.objective.goal.attained(self.objective.levels(theta, omega), omega)

    def _restored(self, objective: LoopObjective, theta: NDArray[np.float64]) -> Evaluation:
        """Return a neighbour for which some tau_P exists at the frequencies of `objective`."""
        feasibility = replace(objective, goal=self.feasibility.goal)
        here = minimise(
            feasibility, feasibility.evaluate(theta), self.box, enough=lambda e: e.merit <= -1e-3,
            checkpoint=lambda _: self.checkpoint(math.inf),
        )  # fmt: skip
        return objective.evaluate(here.theta)

    def canonical(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the permuted copy that stands for all: equal groups by descending gain."""
        rows = theta.reshape(len(self.groups), -1)
        if not isinstance(self.specification.plant, ParallelPlant):
            return theta
        order = sorted(range(len(rows)), key=lambda i: (len(self.groups[i]), *(-rows[i])))
        sizes = [len(group) for group in self.groups]
        # Only groups of equal size may change places.
        result = rows.copy()
        for size in set(sizes):
            places = [i for i in range(len(rows)) if sizes[i] == size]
            for place, source in zip(places, [i for i in order if sizes[i] == size], strict=True):
                result[place] = rows[source]
        return result.ravel()

    def _stable(self, theta: NDArray[np.float64]) -> Evaluation | None:
        """Evaluate a start, its gains lowered until the loop is stable."""
        objective = self.feasibility if self.objective.goal.skewed else self.objective
        gains = np.zeros_like(theta)
        gains[:: self.objective.per_controller] = math.log(GAIN_STEP)
        for _ in range(GAIN_STEPS):
            here = objective.evaluate(self.box.clip(theta))
            if math.isfinite(here.value):
                return here
            theta = theta + gains
        return None

    def _known(self, found: _Found) -> int | None:
        """Index of the optimum that these settings stand for; None: none yet."""
        for index, optimum in enumerate(self.optima):
            if abs(optimum.value - found.value) < SAME_VALUE:
                distance = self.canonical(optimum.theta) - self.canonical(found.theta)
                if np.abs(distance).max() < SAME_PLACE:
                    return index
        return None

    def _remember(self, found: _Found, count: int) -> None:
        index = self._known(found)
        if index is None:
            self.optima.append(Optimum(found.theta, found.value, count))
        else:
            known = self.optima[index]
            better = found if found.value < known.value else known
            self.optima[index] = Optimum(better.theta, better.value, known.count + count)
        self.optima.sort(key=lambda optimum: optimum.value)
