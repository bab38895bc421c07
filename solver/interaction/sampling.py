"""Samples of a frequency response, fine enough to read stability and peaks off, and refined."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners_of, resonances_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from solver.interaction.weighted_sum import WeightedSum
    from solver.model.transfer_function import TransferFunction

    _Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]

__all__ = ["dense_frequencies", "local_minima", "refine_minima", "sample", "turns"]

_POINTS = 1000  # even in logarithm
_DECADES = 3  # beyond the corners on both sides
_DEAD_TIME_STEP = 0.15  # rad of the longest dead time between samples ...
_DEAD_TIME_REACH = 10.0  # ... up to that over the shortest one
_DEAD_TIME_POINTS = (1000, 5000)  # least and greatest number of these samples
_STEP = 0.1  # relative change of the process between samples
_SMALL = 0.02  # relative size of the process below which larger changes are let pass
_HALVINGS = 12
_MAX_POINTS = 6000


def sample(process: WeightedSum) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return frequencies (k,) and the response (k,) there, as fine as the response bends.

    From `dense_frequencies`, halved until the response changes by at most a tenth from one
    sample to the next where it is not small.
    """
    omega = dense_frequencies(process.active_terms)
    response = process.response(omega)
    for _ in range(_HALVINGS):
        change = np.abs(np.diff(response))
        size = np.maximum(np.abs(response[1:]), np.abs(response[:-1]))
        # Far above the resonances only dead time turns: sampled evenly already.
        coarse = np.flatnonzero((change > _STEP * size) & (size > _SMALL * np.max(size)))
        if not coarse.size or omega.size > _MAX_POINTS:
            break
        middle = np.sqrt(omega[coarse] * omega[coarse + 1])
        omega = np.insert(omega, coarse + 1, middle)
        response = np.insert(response, coarse + 1, process.response(middle))
    return omega, response


def dense_frequencies(terms: Iterable[TransferFunction]) -> NDArray[np.float64]:
    """Return frequencies (rad per time unit) that resolve every corner, resonance and dead time.

    Even in logarithm from three decades below the lowest to three above the highest corner,
    finer around lightly damped poles and zeros, and evenly spaced as far as dead time turns.
    """
    elements = tuple(terms)
    bends = corners_of(elements)
    low, high = float(bends[0]) / 10**_DECADES, float(bends[-1]) * 10**_DECADES
    parts = [np.geomspace(low, high, _POINTS), resonances_of(elements)]
    dead_times = [element.dead_time for element in elements if element.dead_time]
    if dead_times:
        step = _DEAD_TIME_STEP / max(dead_times)
        count = np.clip(_DEAD_TIME_REACH / min(dead_times) / step, *_DEAD_TIME_POINTS)
        parts.append(step * np.arange(1, int(count)))
    merged = np.unique(np.concatenate(parts))
    return np.asarray(merged[merged > 0], dtype=np.float64)


def local_minima(values: NDArray[np.float64], at_most: float) -> NDArray[np.intp]:
    """Return indices of local minima up to a value; NaN counts as infinite."""
    padded = np.concatenate([[math.inf], np.where(np.isnan(values), math.inf, values), [math.inf]])
    inner = padded[1:-1]
    lowest = (inner <= padded[:-2]) & (inner <= padded[2:])
    return np.flatnonzero(lowest & (inner <= at_most))


def refine_minima(
    function: _Function, omega: NDArray[np.float64], indices: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Refine minima between samples by parabolas in log omega; NaN counts as infinite.

    For smooth functions, in three rounds; maxima of mu have corners: `solver.model.peaks.zoom`
    brackets those.

    Parameters
    ----------
    function : callable
        Values at frequencies, any shape.
    omega : (k,)
        The samples, rad per time unit, ascending.
    indices : (m,)
        Samples at which the function has local minima.

    Returns
    -------
    omega, values : (m,)
        Refined places and values.

    """
    t = np.log(omega[indices])
    log_omega = np.log(omega)
    left = t - log_omega[np.maximum(indices - 1, 0)]
    right = log_omega[np.minimum(indices + 1, omega.size - 1)] - t
    step = np.maximum(left, right)
    best_t, best = t, np.full(t.shape, math.inf)
    for _ in range(3):
        points = best_t + step * np.array([[-1.0], [0.0], [1.0]])
        values = function(np.exp(points))
        with np.errstate(invalid="ignore", divide="ignore"):
            curvature = values[0] - 2 * values[1] + values[2]
            shift = 0.5 * (values[0] - values[2]) / curvature
        vertex = best_t + step * np.where(curvature > 0, np.clip(shift, -1, 1), 0.0)
        points = np.concatenate([points, vertex[None, :]])
        values = np.concatenate([values, function(np.exp(vertex[None, :]))])
        values = np.where(np.isnan(values), math.inf, values)
        choice = np.argmin(values, axis=0)
        columns = np.arange(choice.size)
        better = values[choice, columns] < best
        best_t = np.where(better, points[choice, columns], best_t)
        best = np.where(better, values[choice, columns], best)
        step = step / 15
    return np.exp(best_t), best


def turns(arguments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turns between samples of an argument (k,), each the shorter way round, (k-1,)."""
    return (np.diff(arguments) + math.pi) % (2 * math.pi) - math.pi
