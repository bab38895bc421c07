"""Least squares over the shapes of a row's elements, gains projected out, isolated spikes left out.

Levenberg and Marquardt on the projected residual; the derivative neglects how the projection turns
(Kaufman, BIT 15 (1975) 49), which costs steps and no accuracy. In the dead time the cost has kinks
and several minima: the caller starts from a scan (`solver.identification.start`), and a step is
taken only where it lowers the cost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from solver.identification.elements import HIGHEST_RATIO, LOWEST_RATIO, ElementKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from solver.identification.row import Row, Segment, Solved

__all__ = ["TimeLimits", "fit", "steps", "without_spikes"]

MOST_STEPS = 60
# A step that lowers the cost by less than this part changes no digit that noise leaves.
CONVERGED = 1e-9
FAR = 8.0  # standard deviations: beyond any normal reading, and beyond the tails of common noise
SPIKE_WINDOW = 11  # readings; a spike is shorter than half of it


@dataclass(frozen=True)
class TimeLimits:
    """What the record can tell of times.

    Attributes
    ----------
    shortest, longest : float
        Bounds of the sum of an element's time constants.
    dead_time : float
        Upper bound of dead times.
    sample : float
        Sampling period.
    fixed : mapping of int to tuple of float
        Elements whose shape is not fitted, with that shape.

    """

    shortest: float
    longest: float
    dead_time: float
    sample: float
    fixed: Mapping[int, tuple[float, ...]] = field(default_factory=dict)

    def box(self, kinds: Sequence[ElementKind]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower and upper bounds of all shape parameters."""
        bounds = {
            "log_lag": (math.log(self.shortest), math.log(self.longest)),
            "dead_time": (0.0, self.dead_time),
        }
        # Real lags, unless the form may ring.
        ratios = {
            kind: (LOWEST_RATIO, HIGHEST_RATIO if kind is ElementKind.RESONANT else 1.0)
            for kind in kinds
        }
        pairs: list[tuple[float, float]] = []
        for index, kind in enumerate(kinds):
            if index in self.fixed:
                pairs += [(value, value) for value in self.fixed[index]]
            else:
                pairs += [
                    ratios[kind] if name == "ratio" else bounds[name] for name in kind.shape_names
                ]
        low, high = np.array(pairs).reshape(-1, 2).T
        return low, high


def steps(kinds: Sequence[ElementKind], limits: TimeLimits) -> list[float]:
    """Return half the distance of the differences, for each shape parameter.

    A thousandth of what a record resolves: far above rounding, far below curvature. Of the dead
    time a twentieth of a sample, so that few readings change sides of a kink.
    """
    size = {"log_lag": 1e-4, "ratio": 1e-4, "dead_time": limits.sample / 20}
    return [size[name] for kind in kinds for name in kind.shape_names]


def fit(
    row: Row,
    kinds: Sequence[ElementKind],
    shapes: Sequence[Sequence[float]],
    limits: TimeLimits,
    most_steps: int = MOST_STEPS,
) -> Solved:
    """Return the best fit in the neighbourhood of `shapes`."""
    low, high = limits.box(kinds)
    x = np.clip(np.array([value for shape in shapes for value in shape]), low, high)
    distance = steps(kinds, limits)
    best = row.solve(kinds, split(kinds, x))
    damping = 1e-3
    for _ in range(most_steps if x.size else 0):
        J = row.jacobian(best, distance)
        Q = _basis(best.left)
        J -= Q @ (Q.T @ J)
        gradient, H = J.T @ best.residual, J.T @ J
        stuck = ((x <= low) & (gradient < 0)) | ((x >= high) & (gradient > 0)) | (low == high)
        free = np.flatnonzero(~stuck & (np.diag(H) > 0))
        if not free.size:
            break
        better = None
        while damping < 1e10:
            step = np.zeros(x.size)
            A = H[np.ix_(free, free)] + damping * np.diag(np.diag(H)[free])
            step[free] = np.linalg.lstsq(A, gradient[free], rcond=None)[0]
            moved = np.clip(x + step, low, high)
            better = row.solve(kinds, split(kinds, moved))
            if better.cost < best.cost:
                break
            damping = max(damping, 1e-6) * 5
        if better is None or not better.cost < best.cost:
            break
        gain = best.cost - better.cost
        damping = max(damping / 10, 1e-12)
        x, best = moved, better
        if gain <= CONVERGED * best.cost:
            break
    return best


def split(kinds: Sequence[ElementKind], x: NDArray[np.float64]) -> list[tuple[float, ...]]:
    """Return the shapes of the elements whose parameters stand one after the other."""
    found, first = [], 0
    for kind in kinds:
        count = len(kind.shape_names)
        found.append(tuple(float(value) for value in x[first : first + count]))
        first += count
    return found


def without_spikes(row: Row, solved: Solved) -> Row:
    """Return the row with weight 0 where the residual leaves its neighbours' median far behind.

    Hampel's identifier on the residual, so that neither a step nor a model error is taken for a
    spike. The scale is the median distance from that median, at least the readings' resolution.
    """
    segments = []
    own = row.own_parts(solved)
    for segment, block, part in zip(row.segments, solved.blocks, own, strict=True):
        left = segment.output - block @ solved.gains - part
        away = np.abs(left - median_filter(left, size=min(SPIKE_WINDOW, left.size), mode="nearest"))
        level = 1.4826 * float(np.median(away[segment.weight > 0]))
        limit = FAR * max(level, resolution(segment))
        typical = float(np.max(segment.weight))
        segments.append(replace(segment, weight=np.where(away > limit, 0.0, typical)))
    return replace(row, segments=tuple(segments))


def resolution(segment: Segment) -> float:
    """Return the smallest distance of two different readings, rounding of doubles aside."""
    apart = np.diff(np.unique(segment.output))
    real = apart[apart > 1e-9 * np.ptp(segment.output)]
    return float(real.min()) if real.size else 0.0


def _basis(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(np.linalg.qr(columns[:, size > 0] / size[size > 0])[0])
