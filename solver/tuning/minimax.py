"""Trust-region sequential method for the minimax problem, keeping to stabilising settings.

At the present point the levels are linearised in the parameters, the demands in s, and

    minimise  ds + d'B d/2   subject to  demand_k + demand_k' ds <= level_k + gradient_k d,
    |d| <= radius, bounds on the parameters

is solved by a dual active-set method. A step counts only if the exact minimax value falls by a
tenth of what the model promises, so every iterate is feasible and stable. B follows the
curvature of the Lagrangian by damped BFGS updates (Powell 1978). The method ends at a point from
which no descent of first order exists, a local optimum; it knows nothing of other ones.
"""

from __future__ import annotations

from ctypes import c_int
from dataclasses import dataclass
from typing import TYPE_CHECKING

import daqp
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.tuning.objective import Evaluation, LoopObjective

__all__ = ["Box", "minimise"]

FIRST_RADIUS = 0.5  # in log parameter: a factor of 1.6
LARGEST_RADIUS = 2.0
SMALLEST_RADIUS = 1e-9
CURVATURE_OF_S = 1e-2  # makes the program strictly convex; of no effect as ds goes to 0
FEASIBILITY = 1e-11  # constraints of the program hold to this, below any tolerance in s
NEAR_ACTIVE = 4.0  # frequencies with more room than this cannot become active in one step


@dataclass(frozen=True)
class Box:
    """Lower and upper bounds of the parameters, (m,) each."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def clip(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest point inside."""
        return np.clip(theta, self.low, self.high)


def minimise(
    objective: LoopObjective,
    start: Evaluation,
    box: Box,
    *,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    good_enough: float = -np.inf,
    checkpoint: Callable[[float], None] = lambda _: None,
) -> Evaluation:
    """Descend from `start` to a local minimum of the minimax value.

    Parameters
    ----------
    objective : LoopObjective
        The levels and their gradients.
    start : Evaluation
        A point with a finite value.
    box : Box
        Bounds of the parameters.
    tolerance : float
        The descent ends when the model promises less than this in s.
    max_iterations : int
        Most evaluations.
    good_enough : float
        The descent also ends at a value below this.
    checkpoint : callable
        Called with the value at every iteration; may raise to stop.

    Returns
    -------
    Evaluation
        The best point found.

    """
    here = start
    radius = FIRST_RADIUS
    size = here.theta.size
    B = np.eye(size) * 0.1
    for _ in range(max_iterations):
        checkpoint(here.value)
        if here.value <= good_enough:
            break
        step = _subproblem(objective, here, B, box, radius)
        if step is None or step.promise < tolerance:
            break
        there = objective.evaluate(here.theta + step.d, near=here)
        fall = here.value - there.value
        if not fall > 0.1 * step.promise and np.isfinite(there.value):
            # Second-order correction: the model's constants taken from the trial point.
            corrected = _subproblem(objective, here, B, box, radius, there, step.d)
            if corrected is not None:
                again = objective.evaluate(here.theta + corrected.d, near=there)
                if again.value < there.value:
                    there, fall = again, here.value - again.value
                    step = _Step(corrected.d, step.promise, step.multipliers)
        length = float(np.abs(step.d).max())
        if fall > 0.1 * step.promise:
            B = _update(B, step, here, there)
            if fall > 0.7 * step.promise and length > 0.5 * radius:
                radius = min(2 * radius, LARGEST_RADIUS)
            here = there
        else:
            radius = 0.3 * min(radius, length)
            if radius < SMALLEST_RADIUS:
                break
    return here


@dataclass(frozen=True)
class _Step:
    """Step d (m,), promised fall of s, multipliers of the frequencies (k,)."""

    d: NDArray[np.float64]
    promise: float
    multipliers: NDArray[np.float64]


def _subproblem(
    objective: LoopObjective,
    here: Evaluation,
    B: NDArray[np.float64],
    box: Box,
    radius: float,
    trial: Evaluation | None = None,
    taken: NDArray[np.float64] | None = None,
) -> _Step | None:
    size = here.theta.size
    demand, slope = objective.goal.demand(here.value, objective.omega)
    level = here.level
    if trial is not None and taken is not None:
        level = np.minimum(trial.level, 1e6) - here.gradient @ taken
    active = np.flatnonzero(here.level - demand < NEAR_ACTIVE)
    H = np.zeros((size + 1, size + 1))
    H[:size, :size] = B
    H[size, size] = CURVATURE_OF_S
    f = np.zeros(size + 1)
    f[size] = 1.0
    A = np.empty((active.size, size + 1))
    A[:, :size] = -here.gradient[active]
    A[:, size] = slope[active]
    upper = np.concatenate([
        np.minimum(box.high - here.theta, radius), [3.0], (level - demand)[active],
    ])  # fmt: skip
    lower = np.concatenate([
        np.maximum(box.low - here.theta, -radius), [-3.0], np.full(active.size, -1e30),
    ])  # fmt: skip
    sense = np.zeros(upper.size, dtype=c_int)
    x, _, flag, info = daqp.solve(H, f, A, upper, lower, sense, primal_tol=FEASIBILITY, eps_prox=0)
    if flag < 1:
        return None
    multipliers = np.zeros(objective.omega.size)
    multipliers[active] = np.abs(info["lam"][size + 1 :])
    return _Step(np.asarray(x[:size]), -float(x[size]), multipliers)


def _update(
    B: NDArray[np.float64], step: _Step, here: Evaluation, there: Evaluation
) -> NDArray[np.float64]:
    """Powell's damped BFGS update with the Lagrangian -sum multipliers * level."""
    d = step.d
    change = -(step.multipliers @ (there.gradient - here.gradient))
    Bd = B @ d
    curvature = float(d @ Bd)
    if not curvature > 0:
        return B
    inner = float(d @ change)
    if inner < 0.2 * curvature:
        weight = 0.8 * curvature / (curvature - inner)
        change = weight * change + (1 - weight) * Bd
        inner = float(d @ change)
    return np.asarray(B - np.outer(Bd, Bd) / curvature + np.outer(change, change) / inner)
