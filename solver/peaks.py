"""Peaks of a curve between the points of its grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.results import Peak

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["highest", "local_peaks", "zoom"]

SECTIONS = 32  # of a bracket; each round keeps two of them
ROUNDS = 3  # 16^3 = 4,096: a smooth peak is then right to 1e-8 of its drop over the bracket


def local_peaks(
    curve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    within: float = 0.1,
    rounds: int = ROUNDS,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies and values of the local maxima, refined by zooming in.

    Works for kinks as well as for smooth peaks; a peak narrower than the grid's step can be
    missed, which is why the grid must resolve the plant's resonances.

    Parameters
    ----------
    curve : callable
        Values (k,) at frequencies (k,).
    omega, values : (k,)
        Ascending grid, and the curve on it.
    within : float
        Maxima lower than the greatest value by more than this are left out.
    rounds : int
        Rounds of zooming; each leaves a sixteenth of the brackets.

    Returns
    -------
    omega, values : (peaks,)
        Ascending in frequency. An end of the grid counts if the curve is highest there.

    """
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    top = (padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:])
    found = np.flatnonzero(top & (values >= values.max() - within))
    last = omega.size - 1
    low = np.log(omega[np.maximum(found - 1, 0)])
    high = np.log(omega[np.minimum(found + 1, last)])
    return zoom(
        lambda points: curve(points.ravel()).reshape(points.shape),
        low, high, omega[found], values[found], sections=SECTIONS, rounds=rounds,
    )  # fmt: skip


def zoom(
    curve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    sections: int,
    rounds: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Refine maxima inside their brackets; each round keeps two of a bracket's sections.

    Parameters
    ----------
    curve : callable
        Values (r, q) at frequencies (r, q), a row for each maximum.
    low, high : (r,)
        Brackets, log of rad per time unit.
    omega, values : (r,)
        The maxima so far.
    sections, rounds : int
        Sections that a bracket is cut into, and how often.

    Returns
    -------
    omega, values : (r,)
        The greatest values found, and where.

    """
    fractions = np.arange(sections + 1) / sections
    rows = np.arange(omega.size)
    for _ in range(rounds):
        points = low[:, None] + (high - low)[:, None] * fractions
        here = curve(np.exp(points))
        index = here.argmax(axis=1)
        better = here[rows, index] > values
        omega = np.where(better, np.exp(points[rows, index]), omega)
        values = np.where(better, here[rows, index], values)
        low = points[rows, np.maximum(index - 1, 0)]
        high = points[rows, np.minimum(index + 1, sections)]
    return omega, values


def highest(
    curve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
) -> Peak:
    """Return the greatest refined peak of a curve."""
    where, heights = local_peaks(curve, omega, values)
    index = int(heights.argmax())
    return Peak(float(heights[index]), float(where[index]))
