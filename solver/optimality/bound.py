"""Lower bound of tau_P, or of mu, by branch and bound over the settings, best box first.

A box of settings is excluded at a target where conditions at finitely many points, each of which
every stable tuning that meets the demand satisfies, leave nothing of it
(`solver.optimality.conditions`); else it is cut in two. To leave points out only adds settings, so
the bound stays one.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.optimality.conditions import Conditions, cone, robust_limits
from solver.optimality.record import Optimality, Proof
from solver.optimality.samples import samples
from solver.optimality.settings_box import Demand

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.optimality.record import SettingsProblem

__all__ = ["GOAL", "BranchAndBound"]

GOAL = 0.001  # gap at which the proof ends
# where the peaks of nearly optimal settings are: lightly damped ones are narrow
BESIDE = np.exp([-0.1, -0.03, -0.01, -0.003, -0.001, 0.0, 0.001, 0.003, 0.01, 0.03, 0.1])
RAYS = np.exp(1j * np.pi / 6 * np.arange(3))  # 30 degrees apart, the positive axis the first
EVERY = 3  # of the frequencies, of which there are rays
PASSED_ON = 10  # points that a part of a box tries first: the tightest of the whole
MAX_OPEN = 100_000  # boxes kept at a time, about 100 MB
OUTWARD = 1e-12  # relative widening of the bounds, above the rounding of exp and log


class _Box(NamedTuple):
    """A box that may hold better settings, in the order of its bound of s."""

    s: float
    number: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    first: NDArray[np.int64]


class BranchAndBound:
    """The proof for one grouping with PI controllers, or with one PID controller.

    Parameters
    ----------
    problem : SettingsProblem
        What was tuned. Its frequencies are used, and those between them.
    peaks : (p,)
        Where the tuned settings just meet the demand.
    value : float
        The tuned one, of tau_P or mu.
    goal : float
        The gap at which the proof ends, 0..1.

    """

    def __init__(
        self,
        problem: SettingsProblem,
        *,
        peaks: NDArray[np.float64],
        value: float,
        goal: float = GOAL,
    ) -> None:
        blocks, omega = problem.blocks, problem.omega
        dense = [omega, np.sqrt(omega[1:] * omega[:-1]), np.outer(peaks, BESIDE).ravel()]
        axis = np.unique(np.concatenate(dense))
        s = np.concatenate([1j * axis, np.outer(axis[::EVERY], RAYS).ravel()])
        known = samples(blocks, problem.uncertainty, s)
        performance = problem.performance
        demand = Demand(performance.max_peak, performance.offset, performance.tau_p or 0.0)
        target = math.log(value) + math.log(1 - goal)
        if performance.tau_p is not None:  # mu <= gamma: of N/gamma at most 1
            known = replace(known, u=known.u * math.exp(-2 * target))
        low, high = np.exp(problem.low) * (1 - OUTWARD), np.exp(problem.high) * (1 + OUTWARD)
        # Of each controller k and tau_I; then k and k/tau_I. Behind them tau_D, if there is one.
        own = low.size // problem.signs.size
        shortest, longest = low[1::own].copy(), high[1::own].copy()
        low[1::own], high[1::own] = low[::own] / longest, high[::own] / shortest
        self._value, self._goal = value, goal
        self._conditions = Conditions(
            blocks, known, demand, problem.signs, target,
            cone(blocks, shortest, longest, own),
        )  # fmt: skip
        low, high = low * (1 - OUTWARD), high * (1 + OUTWARD)
        leads = np.stack([low[2::own], high[2::own]], axis=1) if own == 3 else np.empty((0, 2))
        high = np.minimum(high, robust_limits(blocks, known, problem.signs, leads))
        self._open = [_Box(-math.inf, 0, low, high, self._conditions.all_points)]
        self._boxes = self._number = 0

    def run(self, checkpoint: Callable[[], None] = lambda: None) -> Optimality:
        """Examine boxes until the gap reaches its goal, or too many are open.

        Parameters
        ----------
        checkpoint : callable
            Called at every box; what it raises passes through, and `result` holds what is proven.

        """
        while self._open and len(self._open) <= MAX_OPEN:
            checkpoint()
            self._examine(self._open[0])
        return self.result()

    def result(self) -> Optimality:
        """Return what is proven up to now."""
        s = self._open[0].s if self._open else self._conditions.target
        # The demand was lessened by 1e-12 and s is its logarithm: a little less is proven for sure.
        bound = math.exp(s) * (1 - 1e-9)
        return Optimality(
            lower_bound=bound,
            gap=1 - bound / self._value,
            goal=self._goal,
            status=Proof.STOPPED if self._open else Proof.REACHED,
            boxes=self._boxes,
            points=self._conditions.samples.s.size,
        )

    def _examine(self, box: _Box) -> None:
        """Exclude the first box of the heap, or put its halves in its place."""
        self._boxes += 1
        found = self._conditions.examine(box.low, box.high, box.first, box.s)
        everything = self._conditions.all_points
        if found.split is not None and box.first.size < everything.size:
            found = self._conditions.examine(found.low, found.high, everything, found.s)
        if found.split is None:
            heapq.heappop(self._open)
            return
        first = np.sort(found.tightest[:PASSED_ON])
        middle = math.sqrt(found.low[found.split] * found.high[found.split])
        below, above = found.high.copy(), found.low.copy()
        below[found.split] = above[found.split] = middle
        lower = _Box(found.s, self._number + 1, found.low, below, first)
        heapq.heapreplace(self._open, lower)
        heapq.heappush(self._open, _Box(found.s, self._number + 2, above, found.high, first))
        self._number += 2
