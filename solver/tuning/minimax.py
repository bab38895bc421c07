"""Trust-region sequential method for the minimax problem, keeping to stabilising settings.

At the present point the levels are linearised in the parameters, the demands in s, and

    minimise  ds + penalty e + d'B d/2
    subject to  demand_k + demand_k' ds <= level_k + gradient_k d + e,  e >= 0,
    |d| <= radius, bounds on the parameters

is solved by a dual active-set method. A level is the least of those of several blocks, so it may
bend sharply: the planes of recently rejected points stand beside the present ones, as in a bundle
method, and those of the present point with two like controllers in each other's place. A step
counts only if the exact merit falls by a tenth of what the model promises, so every iterate is
stable. B follows the curvature of the Lagrangian by damped BFGS updates (Powell 1978). The method
ends at a point from which no descent of first order exists, a local optimum; it knows nothing of
other ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import daqp
import numpy as np

from solver.tuning.program import NEAR_ACTIVE, mirrored_planes, program, room_planes, updated

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.tuning.objective import Evaluation
    from solver.tuning.together import Together

__all__ = ["Box", "minimise"]

FIRST_RADIUS = 0.5  # in log parameter: a factor of 1.6
FIRST_CURVATURE = 0.1
BUNDLE = 4  # rejected points whose planes are kept,
NEAR = 0.1  # while they are so near
ENOUGH = 0.1  # share of the promise that makes a step count
LARGEST_RADIUS = 2.0
SMALLEST_RADIUS = 1e-9
FEASIBILITY = 1e-11  # constraints of the program hold to this, below any tolerance in s
PROJECTIONS = 50  # onto one plane after the other; each has three parameters at most
ON_PLANE = 1e-9  # a relative excess that is rounding


@dataclass(frozen=True)
class Box:
    """Lower and upper bounds of the parameters, (m,) each, and planes that they stay below.

    `rows @ theta <= limits`, rows (r, m).
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    rows: NDArray[np.float64] | None = None
    limits: NDArray[np.float64] | None = None

    def clip(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a point inside: the nearest one of the bounds, moved below the planes."""
        inside = np.minimum(np.maximum(theta, self.low), self.high)
        if self.rows is None or self.limits is None:
            return inside
        for _ in range(PROJECTIONS):
            above = self.rows @ inside - self.limits
            if not (above > ON_PLANE).any():
                break
            for row, limit in zip(self.rows, self.limits, strict=True):
                excess = float(row @ inside) - limit
                if excess > 0:
                    inside -= row * (excess / float(row @ row))
            inside = np.clip(inside, self.low, self.high)
        return inside


def minimise(
    objective: Together,
    start: Evaluation,
    box: Box,
    *,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    enough: Callable[[Evaluation], bool] = lambda _: False,
    checkpoint: Callable[[float], None] = lambda _: None,
) -> Evaluation:
    """Descend from `start` to a local minimum of the minimax value.

    Parameters
    ----------
    objective : Together
        The levels and their gradients.
    start : Evaluation
        A point with a finite merit.
    box : Box
        Bounds of the parameters.
    tolerance : float
        The descent ends when the model promises less than this in s.
    max_iterations : int
        Most evaluations.
    enough : callable
        The descent also ends at an evaluation of which this is true.
    checkpoint : callable
        Called with the value at every iteration; may raise to stop.

    Returns
    -------
    Evaluation
        The best point found.

    """
    here = start
    radius = FIRST_RADIUS
    B = np.eye(here.theta.size) * FIRST_CURVATURE
    bundle: list[Evaluation] = []
    mirrored = bool(objective.alike.size)
    for _ in range(max_iterations):
        checkpoint(here.value)
        if enough(here):
            break
        model = _Model(objective, box, B, radius, bundle, mirrored)
        step = model.step(here)
        if step is None or step.promise < tolerance:
            if not bundle and not mirrored:
                break
            # Planes of points too far off may hide a descent, and so may the curvature that
            # gradients on both sides of a bend pretend.
            bundle, mirrored, B = [], False, np.eye(here.theta.size) * FIRST_CURVATURE
            continue
        there = objective.evaluate(box.clip(here.theta + step.d), near=here)
        if not here.merit - there.merit > ENOUGH * step.promise:
            step, there = _corrected(model, here, step, there)
        length = float(np.abs(step.d).max())
        fall = here.merit - there.merit
        if fall > ENOUGH * step.promise:
            B = updated(B, step.d, step.multipliers, here.gradient, there.gradient)
            if fall > 0.7 * step.promise and length > 0.5 * radius:
                radius = min(2 * radius, LARGEST_RADIUS)
            here, mirrored = there, bool(objective.alike.size)
            bundle = [e for e in bundle if np.abs(e.theta - here.theta).max() < NEAR]
            continue
        seen, here = here, _seen_anew(objective, here, there, tolerance)
        if here is seen:
            radius = 0.3 * min(radius, length)
            bundle = [*bundle, *[there] * math.isfinite(there.merit)][-BUNDLE:]
        if radius < SMALLEST_RADIUS:
            break
    return here


@dataclass(frozen=True)
class _Step:
    """Step d (m,), promised fall of the merit, multipliers of the frequencies (k,)."""

    d: NDArray[np.float64]
    promise: float
    multipliers: NDArray[np.float64]


@dataclass(frozen=True)
class _Model:
    """The linearised problem; the bundle's planes stand beside those of the present point.

    So do, where `mirrored`, those of like controllers in each other's place.
    """

    objective: Together
    box: Box
    B: NDArray[np.float64]
    radius: float
    bundle: Sequence[Evaluation]
    mirrored: bool

    def step(self, here: Evaluation, trial: Evaluation | None = None) -> _Step | None:
        """Return the model's best step from `here`, or None if the program has no solution.

        With a `trial` point the levels at `here` are replaced by those that the model's slopes
        and the levels at the trial imply.
        """
        size, slope = here.theta.size, here.demand_slope
        room = base = here.level - here.demand
        if trial is not None:
            base = self._room(trial, here) - here.gradient @ (trial.theta - here.theta)
        below = 0 if self.box.limits is None else self.box.limits.size
        alike = self.objective.alike if self.mirrored else self.objective.alike[:0]
        A = np.empty(((1 + len(alike) + len(self.bundle)) * room.size + below, size + 2))
        limits = np.empty(len(A))
        first = filled = room_planes(here.gradient, room, room, base, slope, A, limits, 0)
        filled = mirrored_planes(
            here.gradient, room, slope, here.theta, self.objective.per_controller, alike, A, limits,
            filled,
        )  # fmt: skip
        for other in self.bundle:
            # Where the level is a minimum of smooth pieces, this is the piece on the other side. It
            # must not cut off the present point, as the tangent of a convex level would.
            seen = self._room(other, here)
            there = np.maximum(seen + other.gradient @ (here.theta - other.theta), room)
            filled = room_planes(other.gradient, room, seen, there, slope, A, limits, filled)
        if self.box.rows is not None and self.box.limits is not None:
            A[filled : filled + below] = np.pad(self.box.rows, ((0, 0), (0, 2)))
            # Rounding must not leave the program without a solution.
            left = self.box.limits - self.box.rows @ here.theta
            limits[filled : filled + below] = np.maximum(left, 0.0)
            filled += below
        H, f, lower, upper = program(
            self.B, self.objective.penalty, here.theta, self.box.low, self.box.high, self.radius,
            limits[:filled],
        )  # fmt: skip
        sense = np.zeros(upper.size, dtype=np.int32)
        x, _, flag, info = daqp.solve(
            H, f, A[:filled], upper, lower, sense, primal_tol=FEASIBILITY, eps_prox=0
        )
        if flag < 1:
            return None
        multipliers = np.zeros(room.size)
        multipliers[room < NEAR_ACTIVE] = np.abs(info["lam"][size + 2 : size + 2 + first])
        promise = here.merit - here.s - float(x[size]) - self.objective.penalty * float(x[size + 1])
        return _Step(np.asarray(x[:size]), promise, multipliers)

    def _room(self, other: Evaluation, here: Evaluation) -> NDArray[np.float64]:
        """Level of another point less the demand of `here`, (k,), at that point's frequencies."""
        demand = here.demand.copy()
        if other.peaks.size:  # the last frequencies, which move
            demand[-other.peaks.size :] = self.objective.goal.demand(here.s, other.peaks)[0]
        return other.level - demand


def _seen_anew(
    objective: Together, here: Evaluation, there: Evaluation, tolerance: float
) -> Evaluation:
    """Return `here` with its followed peaks sought from a point beside it, if they are higher so.

    A long step moves a peak out of sight; then no step from there, however short, does better.
    """
    if not here.peaks.size or not math.isfinite(there.merit):
        return here
    again = objective.evaluate(here.theta, near=there)
    return again if again.merit > here.merit + tolerance else here


def _corrected(
    model: _Model, here: Evaluation, step: _Step, there: Evaluation
) -> tuple[_Step, Evaluation]:
    """Second-order correction of a step that fell short, if it does better."""
    if math.isfinite(there.merit):
        corrected = model.step(here, there)
        if corrected is not None:
            again = model.objective.evaluate(model.box.clip(here.theta + corrected.d), near=there)
            if again.merit < there.merit:
                return _Step(corrected.d, step.promise, step.multipliers), again
    return step, there
