"""What engineers read off a response, computed on its polynomials: no sample can miss a peak.

Rise and settling time, overshoot, integrals of the error, variation of the input: the measures
of Astrom and Hagglund, Advanced PID Control (2006), section 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from solver.simulation.chebyshev import NODES, QUADRATURE, evaluation_matrix, roots

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.simulation.trajectory import Trajectory, TurningPoints

__all__ = [
    "SETTLED",
    "SetPointMetrics",
    "absolute_integrals",
    "set_point_metrics",
    "square_integral",
    "total_variation",
]

SETTLED = 0.02  # of the set-point change
_LOW, _HIGH = 0.1, 0.9  # of the set-point change: between them the rise time is counted


@dataclass(frozen=True)
class SetPointMetrics:
    """Response of one output to its set-point change.

    Attributes
    ----------
    rise_time : float or None
        From 10 to 90 per cent of the change; None: 90 per cent were not reached.
    settling_time : float or None
        From the change until the error stays within 2 per cent of it; None: it did not.
    overshoot : float
        Largest excess over the set point as a fraction of the change, 0 where there is none.

    """

    rise_time: float | None
    settling_time: float | None
    overshoot: float


def set_point_metrics(points: TurningPoints, change: float, start: float) -> SetPointMetrics:
    """Return the measures of a set-point change.

    Parameters
    ----------
    points : TurningPoints
        Of the signal set point minus output, from right after the change to right before the next
        event.
    change : float
        The set-point change, not zero, made at `start`.
    start : float
        When.

    """
    rest = points.value / change  # 1 at the change, 0 at the set point
    reached = [
        [
            points.passage(int(index), (1 - level) * change)
            for index in np.flatnonzero(rest <= 1 - level)[:1]
        ]
        for level in (_LOW, _HIGH)
    ]
    rise = [high - low for low, high in zip(*reached, strict=False)]
    outside = np.flatnonzero(np.abs(rest) > SETTLED)
    settling: float | None = 0.0
    if outside.size:
        last = int(outside[-1])
        level = float(np.sign(points.value[last])) * SETTLED * abs(change)
        stays = last + 1 < points.time.size
        settling = points.passage(last + 1, level) - start if stays else None
    return SetPointMetrics(
        rise_time=rise[0] if rise else None,
        settling_time=settling,
        overshoot=max(0.0, -float(rest.min(initial=0.0))),
    )


def absolute_integrals(trajectory: Trajectory, signal: int) -> NDArray[np.float64]:
    """Return the integral of |signal| over each step, (steps,)."""
    parts = []
    for length, values in zip(trajectory.lengths, trajectory.nodes(signal), strict=True):
        if values.min() >= 0 or values.max() <= 0:
            parts.append(length * abs(float(values @ QUADRATURE)))
            continue
        total = 0.0
        ends = np.concatenate([[0.0], roots(values), [1.0]])
        for low, high in pairwise(ends):
            piece = evaluation_matrix(low + (high - low) * NODES) @ values
            total += length * (high - low) * abs(float(piece @ QUADRATURE))
        parts.append(total)
    return np.array(parts)


def square_integral(trajectory: Trajectory, signal: int) -> float:
    """Return the integral of the square of a signal over all time."""
    # A square has twice the degree: Gauss points integrate it exactly.
    nodes = trajectory.nodes(signal) @ _GAUSS.T
    return float(trajectory.lengths @ (nodes**2 @ _GAUSS_WEIGHTS))


def total_variation(points: TurningPoints, before: float = 0.0) -> float:
    """Return the total variation of a signal that was `before`, jumps included."""
    return float(np.abs(np.diff(points.value, prepend=before)).sum())


_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(NODES.size)
_GAUSS = evaluation_matrix((1 + _POINTS) / 2)
_GAUSS_WEIGHTS: NDArray[np.float64] = _WEIGHTS / 2
