"""The last descent: the peaks of the demand's excess are followed between the grid's points.

What it ends with is measured on the whole axis, as far as a fine grid with refined peaks sees it;
`solver.robustness.axis` has the last word.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners, grid, low_end, resonances
from solver.model.peaks import local_peaks
from solver.mu.kernel import FINE
from solver.tuning.objective import BESIDE, Evaluation, LoopObjective
from solver.tuning.phases import EXACT, Phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.tuning.specification import Specification

__all__ = ["WEAKEST", "Candidate", "ExactDescent"]

POINTS_PER_DECADE = 22
SETTLED = 1e-8  # excess of the demand anywhere on the axis at which the last descent may end
TRIFLE = 1e-5  # of s, for which no other optimum is made exact
NEARLY_ACTIVE = 0.05  # excess of the demand from which a peak is followed
WEAKEST = 1e-12  # gain of a direction over that of the strongest one
FIRST_ZOOMS = 2  # rounds of zooming before a peak is followed
ROUNDS = 10


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


@dataclass(frozen=True)
class ExactDescent:
    """Last descents of one search.

    Parameters
    ----------
    specification : Specification
        The task.
    objective : LoopObjective
        What is made small, on the grid of the search.
    phases : Phases
        How to descend.

    """

    specification: Specification
    objective: LoopObjective
    phases: Phases

    def descend(self, theta: NDArray[np.float64], beaten: float = math.inf) -> Candidate | None:
        """Descend with the peaks followed, until the value is that of the whole axis.

        None where no settings near `theta` meet the demand between the grid's points too. Ends
        early where the value does not fall below `beaten` by a trifle.
        """
        omega = self.objective.omega
        peaks = self._peaks_between(self.objective.evaluate(theta))
        best: Candidate | None = None
        candidate: Candidate | None = None
        for _ in range(ROUNDS):
            objective = replace(self.objective, omega=omega, nu=FINE, followed=peaks)
            here = objective.evaluate(theta)
            if not math.isfinite(here.value) and objective.goal.skewed:
                here = self._restored(objective, theta)
            if not math.isfinite(here.merit):
                break
            if math.isfinite(beaten):
                here = self.phases.best(objective, here, TRIFLE)
            if not here.merit > beaten - TRIFLE:
                here = self.phases.best(objective, here, EXACT)
            before, candidate = candidate, self.measure(here.theta, here.s)
            if best is None or candidate.value < best.value:
                best = candidate
            stuck = before is not None and abs(candidate.value - before.value) < SETTLED
            # Here is the least value for fewer frequencies than there are.
            if stuck or candidate.excess <= SETTLED or here.merit > beaten - TRIFLE:
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
            lambda points: self._excess(here, points), omega,
            (here.demand - here.level)[: omega.size], within=NEARLY_ACTIVE, rounds=FIRST_ZOOMS,
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
            lambda points: np.exp(self.attained(theta, points)),
            min(1e-4 * bends[0], self.objective.omega[0]),
            WEAKEST * bends[0],
        )
        high = max(1e2 * bends[-1], self.objective.omega[-1])
        extra = [resonances(self.specification.plant), bends, self.objective.omega]
        omega = grid(low, high, POINTS_PER_DECADE, extra)
        missed = []
        for _ in range(2):  # the peaks of the demand's excess move little with s

            def excess(points: NDArray[np.float64], at: float = s) -> NDArray[np.float64]:
                demand = self.objective.goal.demand(at, points)[0]
                return demand - self.objective.levels(theta, points)

            peaks, missing = local_peaks(excess, omega, excess(omega))
            missed.append(float(missing.max()))
            s = float(self.attained(theta, peaks).max())
            if not math.isfinite(s):
                break
        return Candidate(theta, s, peaks, missed[0])

    def attained(
        self, theta: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Least s that each frequency (k,) permits, (k,), as exact as the kernel gives it."""
        return self.objective.goal.attained(self.objective.levels(theta, omega), omega)

    def _restored(self, objective: LoopObjective, theta: NDArray[np.float64]) -> Evaluation:
        """Return a neighbour for which some tau_P exists at the frequencies of `objective`."""
        feasibility = replace(objective, goal=self.phases.feasibility.goal)
        phases = replace(self.phases, feasibility=feasibility)
        return objective.evaluate(phases.feasible(feasibility.evaluate(theta)).theta)
