"""What given settings attain: the least tau_P for which they keep the demand at all frequencies.

The skewed level p*(omega) of settings that are fixed gives the tau_P that each frequency permits;
the greatest of these on the whole axis is the least tau_P of the settings. A fine grid with refined
peaks finds it, and the proof over all frequencies has the last word, as for settings that a search
found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.errors import InvalidInputError
from solver.model.frequencies import corners
from solver.model.peaks import highest, local_peaks
from solver.model.transfer_function import LARGEST
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep
from solver.robustness.axis import proven_peaks
from solver.robustness.curves import LoopAnalysis
from solver.stability.closed_loop import is_stable
from solver.tuning.goals import Goal, MuGoal, TauGoal
from solver.tuning.judged_loop import FORBIDDEN
from solver.tuning.record import ROUNDING as MET
from solver.tuning.specification import Objective, Specification

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.peaks import Peak
    from solver.model.weights import Performance
    from solver.robustness.record import Curves, Guarantee, Peaks
    from solver.tuning.scenarios import Case

__all__ = ["Attained", "attained", "attained_by_all", "one_case", "slowest_demand"]

ABOVE = 2e-8  # relative excess of the proven peak that is rounding of the kernel
ROUNDING = 1e-9  # relative addition to tau_P that keeps mu <= 1 under rounding
OVERFLOW = 700.0  # s whose exponential is no number any more
RAISED = 30  # times that tau_P is raised to what a new peak demands


@dataclass(frozen=True)
class Attained:
    """What settings attain: the demand with their least tau_P, or the given one, and mu there."""

    performance: Performance
    peaks: Peaks
    curves: Curves
    guarantee: Guarantee

    @property
    def meets(self) -> bool:
        """Whether they keep the demand."""
        return self.peaks.robust_performance.value <= 1 + MET


def attained(specification: Specification, loops: Sequence[Controller]) -> Attained | None:
    """Return what settings attain of a task.

    Parameters
    ----------
    specification : Specification
        The task. For the objective MU its tau_P is that of the result.
    loops : sequence of Controller
        One a unit, of any kind.

    Returns
    -------
    Attained or None
        None where the loops are unstable, or where no tau_P is long enough.

    """
    if not is_stable(specification.plant, loops):
        return None
    performance = specification.performance
    if specification.objective is Objective.MU:
        return _at(specification, performance, loops)
    fixed = _Fixed(specification, tuple(loops), TauGoal(performance))
    s = fixed.least()
    for _ in range(RAISED):
        tau_p = math.exp(s) * (1 + ROUNDING) if s < OVERFLOW else math.inf
        found = None
        if tau_p <= LARGEST:
            found = _at(specification, performance.with_tau_p(tau_p), loops)
        if found is None:
            return None
        top = found.peaks.robust_performance
        if top.value <= 1 + ABOVE:
            return found
        s = max(s, float(fixed.needed(np.array([top.omega]))[0]))
    return None


def one_case(specification: Specification, case: Case) -> Specification:
    """Return the task for the plant of one case alone; settings that are given are all it needs."""
    return Specification(
        case.plant, case.uncertainty,
        replace(case.performance, tau_p=specification.performance.tau_p),
        kind=specification.kind, objective=specification.objective,
    )  # fmt: skip


def attained_by_all(
    specification: Specification, cases: Sequence[Case], loops: Sequence[Controller]
) -> tuple[Attained, ...] | None:
    """Return what settings attain of each case at the tau_P that serves all; None if none does.

    Parameters
    ----------
    specification : Specification
        The task.
    cases : sequence of Case
        The plants that the settings must serve.
    loops : sequence of Controller
        One a unit of the task.

    """
    found = []
    for case in cases:
        own = attained(one_case(specification, case), case.loops(loops))
        if own is None:
            return None
        found.append(own)
    tau_p = max(each.performance.tau_p or 0.0 for each in found)
    for index, (case, own) in enumerate(zip(cases, found, strict=True)):
        if own.performance.tau_p == tau_p:
            continue
        slower = own.performance.with_tau_p(tau_p)
        again = _at(one_case(specification, case), slower, case.loops(loops))
        if again is None:
            return None
        found[index] = again
    return tuple(found)


def slowest_demand(specification: Specification, loops: Sequence[Controller]) -> Peak:
    """Return the peak of mu of stable loops under an infinitely slow demand, w_P = 1/M."""
    slow = replace(specification.performance, tau_p=None)
    fixed = _Fixed(specification, tuple(loops), MuGoal(slow))
    omega = fixed.omega(1 / fixed.slowest)

    def mu(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.exp(0.5 * fixed.needed(points)))

    return highest(lambda parts: [mu(parts[0])], [(omega, mu(omega))])[0]


def _at(
    specification: Specification, performance: Performance, loops: Sequence[Controller]
) -> Attained | None:
    """Return what the loops do with this demand; None where they leave an offset it forbids."""
    try:
        axis = proven_peaks(specification.plant, specification.uncertainty, performance, loops)
    except InvalidInputError:
        return None
    return Attained(performance, axis.peaks, axis.curves, axis.guarantee)


@dataclass(frozen=True)
class _Fixed:
    """A loop with fixed settings, and the level that each frequency leaves to the demand."""

    specification: Specification
    loops: tuple[Controller, ...]
    goal: Goal

    @cached_property
    def blocks(self) -> tuple[LoopBlocks, tuple[Controller, ...]]:
        """Blocks and the controller of each group."""
        task = self.specification
        return group_loops(task.plant, self.loops, task.uncertainty, task.performance.output_scale)

    @property
    def slowest(self) -> float:
        """The loop's lowest corner, rad per time unit."""
        return float(
            corners(self.specification.plant, self.specification.uncertainty, self.loops)[0]
        )

    def omega(self, tau_p: float) -> NDArray[np.float64]:
        """Return a grid that resolves the loop and the demand."""
        demand = self.specification.performance.with_tau_p(min(tau_p, LARGEST))
        return LoopAnalysis(*self.blocks, self.specification.uncertainty, demand).omega

    def level(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Level at any frequencies, (k,), as `LoopObjective.levels`."""
        blocks, controllers = self.blocks
        y = np.zeros((omega.size, blocks.n_scales))
        c = np.stack([each.response(omega) for each in controllers], axis=-1)
        u = blocks.squared(self.specification.uncertainty, omega) / self.goal.target**2
        b = np.abs(self.goal.weight.response(omega)) ** 2
        every, cold = not self.goal.skewed, True  # named here: positional booleans say nothing
        found, _, _ = sweep(blocks.packed(omega), c, u, b, blocks.layout, every, FINE, cold, y)
        return np.asarray(np.maximum(found, FORBIDDEN))

    def needed(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Least s that each frequency permits, (k,)."""
        return self.goal.attained(self.level(omega), omega)

    def least(self) -> float:
        """Return the least s of the whole axis, as a fine grid with refined peaks sees it."""
        # The grid depends on tau_P, so it is made once more for the one that it finds.
        omega = self.omega(1 / self.slowest)
        s = float(self.needed(omega).max())
        if not s < OVERFLOW:
            return math.inf
        omega = self.omega(math.exp(s))
        s = float(self.needed(omega).max())
        for _ in range(2):  # the peaks of the demand's excess move little with s
            if not s < OVERFLOW:
                return math.inf

            def excess(points: NDArray[np.float64], at: float = s) -> NDArray[np.float64]:
                return self.goal.demand(at, points)[0] - self.level(points)

            peaks, _ = local_peaks(excess, omega, excess(omega))
            s = max(s, float(self.needed(peaks).max()))
        return s
