"""The last descent: the peaks of the demand's excess are followed between the grid's points.

What it ends with is measured on the whole axis, as far as a fine grid with refined peaks sees it;
`solver.robustness.axis` has the last word.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import KNOWN
from solver.model.frequencies import corners, grid, low_end, resonances
from solver.model.peaks import local_peaks
from solver.mu.kernel import FINE
from solver.tuning.judged_loop import BESIDE
from solver.tuning.objective import Evaluation
from solver.tuning.phases import EXACT, Phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.tuning.objective import LoopObjective
    from solver.tuning.together import Together

__all__ = ["TRIFLE", "WEAKEST", "Candidate", "ExactDescent"]

POINTS_PER_DECADE = 22
SETTLED = 1e-8  # excess of the demand anywhere on the axis at which the last descent may end
TRIFLE = 1e-5  # of s, for which no other optimum is made exact
NEARLY_ACTIVE = 0.05  # excess of the demand from which a peak is followed
WEAKEST = 1e-12  # gain of a direction over that of the strongest one
FAR_FROM_ACTIVE = 1.0  # excess below which no peak of a loop is followed
FIRST_ZOOMS = 2  # rounds of zooming before a peak is followed
ROUNDS = 10
UNMOVED = 1e-6  # change of s that moves a peak by as little, and its value by the square of that


@dataclass(frozen=True)
class Candidate:
    """Settings with their exact value: s right between the grid points too.

    `peaks` are the frequencies where it is attained, loop by loop, `excess` is the most by which
    they miss the level that the estimate of s demanded.
    """

    theta: NDArray[np.float64]
    value: float
    peaks: tuple[NDArray[np.float64], ...]
    excess: float


@dataclass(frozen=True)
class ExactDescent:
    """Last descents of one search.

    Parameters
    ----------
    objective : Together
        What is made small, on the grids of the search.
    phases : Phases
        How to descend.

    """

    objective: Together
    phases: Phases

    def descend(
        self, theta: NDArray[np.float64], beaten: float = math.inf, *, tolerance: float = EXACT
    ) -> Candidate | None:
        """Descend with the peaks followed, until the value is that of the whole axis.

        None where no settings near `theta` meet the demand between the grid's points too. Ends
        early where the value does not fall below `beaten` by a trifle.
        """
        parts = self.objective.parts
        omega = [part.omega for part in parts]
        seen = self.objective.evaluate(theta).of_each
        peaks = [self._peaks_between(*both) for both in zip(parts, seen, strict=True)]
        enough = max(tolerance, SETTLED)
        best: Candidate | None = None
        candidate: Candidate | None = None
        for _ in range(ROUNDS):
            objective = self.objective.having(nu=FINE).at(omega, peaks)
            here = self._begun(objective, theta)
            if here is None or not math.isfinite(here.merit):
                break
            if math.isfinite(beaten):
                here = self.phases.best(objective, here, TRIFLE)
            if not here.merit > beaten - TRIFLE:
                here = self.phases.best(objective, here, tolerance)
            before, candidate = candidate, self.measure(here.theta, here.s)
            if best is None or candidate.value < best.value:
                best = candidate
            stuck = before is not None and abs(candidate.value - before.value) < enough
            # Here is the least value for fewer frequencies than there are.
            if stuck or candidate.excess <= enough or here.merit > beaten - TRIFLE:
                break
            # Some peak was not followed, or is a kink, which no parabola meets: follow it from now
            # on, and hold it at its place too.
            for index, (part, own) in enumerate(zip(parts, here.of_each, strict=True)):
                missed = self._missed(part, own, omega[index], candidate.peaks[index])
                far = np.abs(np.log(missed[:, None] / own.peaks)) > BESIDE
                peaks[index] = np.append(own.peaks, missed[far.all(axis=1)])
                omega[index] = np.union1d(omega[index], candidate.peaks[index])
            theta = here.theta
        return best if best is not None and math.isfinite(best.value) else None

    def _peaks_between(self, part: LoopObjective, here: Evaluation) -> NDArray[np.float64]:
        """Return the peaks of the demand's excess between the points of a loop's grid.

        None where the loop is far from its demand.
        """
        omega = part.omega
        shown = (here.demand - here.level)[: omega.size]
        if shown.max() < -FAR_FROM_ACTIVE:
            return np.empty(0)
        peaks, _ = local_peaks(
            lambda points: self._excess(part, here, points), omega, shown,
            within=NEARLY_ACTIVE, rounds=FIRST_ZOOMS,
        )  # fmt: skip
        return self._missed(part, here, omega, peaks)

    def _missed(
        self,
        part: LoopObjective,
        here: Evaluation,
        omega: NDArray[np.float64],
        peaks: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Those of the peaks that the fixed frequencies `omega` of an evaluation do not show.

        A plateau, or an end of the axis, is shown.
        """
        shown = (here.demand - here.level)[: omega.size]
        right = np.clip(np.searchsorted(omega, peaks), 1, omega.size - 1)
        highest = np.maximum(shown[right - 1], shown[right])
        return peaks[self._excess(part, here, peaks) > highest + SETTLED]

    @staticmethod
    def _excess(
        part: LoopObjective, here: Evaluation, omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Demand less level at any frequencies, (k,), for the settings and s of an evaluation."""
        return part.goal.demand(here.s, omega)[0] - part.levels(here.theta, omega)

    def measure(self, theta: NDArray[np.float64], s: float) -> Candidate:
        """Return the exact value of given parameters near `s`, by refining every peak."""
        axes = [_axis(part, theta) for part in self.objective.parts]
        levels = [
            part.levels(theta, omega)
            for part, omega in zip(self.objective.parts, axes, strict=True)
        ]
        missed = []
        for _ in range(2):  # the peaks of the demand's excess move little with s
            found, worst, values, before = [], -math.inf, [], s
            for part, omega, level in zip(self.objective.parts, axes, levels, strict=True):

                def excess(
                    points: NDArray[np.float64], part: LoopObjective = part, at: float = s
                ) -> NDArray[np.float64]:
                    return part.goal.demand(at, points)[0] - part.levels(theta, points)

                shown = part.goal.demand(s, omega)[0] - level
                peaks, missing = local_peaks(excess, omega, shown)
                found.append(peaks)
                worst = max(worst, float(missing.max()))
                values.append(float(_attained(part, theta, peaks).max()))
            missed.append(worst)
            s = max(values)
            if not math.isfinite(s) or abs(s - before) < UNMOVED:
                break
        return Candidate(theta, s, tuple(found), missed[0])

    def attained(
        self, theta: NDArray[np.float64], omega: NDArray[np.float64], part: int = 0
    ) -> NDArray[np.float64]:
        """Least s that each frequency (k,) permits one of the loops, (k,).

        As exact as the kernel gives it.
        """
        return _attained(self.objective.parts[part], theta, omega)

    def _begun(self, objective: Together, theta: NDArray[np.float64]) -> Evaluation | None:
        """Return where a descent with followed peaks begins: settings that miss no level.

        What is missing between the grid's points is little as a rule; its price leads back. None
        where no tau_P serves any settings nearby.
        """
        here = objective.evaluate(theta)
        if math.isfinite(here.value) or not objective.goal.skewed:
            return here
        if math.isfinite(here.merit):
            here = self.phases.best(objective, here, TRIFLE)
        return here if math.isfinite(here.value) else self._restored(objective, theta)

    def _restored(self, objective: Together, theta: NDArray[np.float64]) -> Evaluation | None:
        """Return a neighbour for which some tau_P exists at the frequencies of `objective`.

        None where the first phase ends with a peak of mu above 1: nothing is to be had from there.
        """
        feasibility = objective.having(goal=self.phases.feasibility.goal)
        phases = replace(self.phases, feasibility=feasibility)
        found = phases.feasible(feasibility.evaluate(theta))
        if 0 < found.value < math.inf:
            return None
        return objective.evaluate(found.theta)


def _axis(part: LoopObjective, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a fine grid over all of a loop's frequencies."""
    plant = part.blocks.plant
    controllers = part.controllers(theta)
    used = {channel for block in part.blocks.blocks for channel in block.channels} - {KNOWN}
    bends = corners(plant, part.uncertainty, [controllers[channel] for channel in sorted(used)])
    low = low_end(
        lambda points: np.exp(_attained(part, theta, points)),
        min(1e-4 * bends[0], part.omega[0]),
        WEAKEST * bends[0],
    )
    high = max(1e2 * bends[-1], part.omega[-1])
    return grid(low, high, POINTS_PER_DECADE, [resonances(plant), bends, part.omega])


def _attained(
    part: LoopObjective, theta: NDArray[np.float64], omega: NDArray[np.float64]
) -> NDArray[np.float64]:
    return part.goal.attained(part.levels(theta, omega), omega)
