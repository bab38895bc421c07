"""Peaks of a curve between the points of its grid."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

__all__ = ["Peak", "greatest", "highest", "local_peaks", "maxima", "slices", "tops", "zoom"]

SECTIONS = 32  # of a bracket; each round keeps two of them
WITHIN = 0.1  # of the greatest value: lower maxima are not refined
ROUNDS = 3  # 16^3 = 4,096: a smooth peak is then right to 1e-8 of its drop over the bracket,
FINE_ROUNDS = 4  # 16^4: a kink to 1e-5 of it


@dataclass(frozen=True)
class Peak:
    """Greatest `value` of a curve, and `omega` (rad per time unit) where it is reached."""

    value: float
    omega: float


def local_peaks(
    curve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    within: float = WITHIN,
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
    low, high, top, height = _brackets(omega, values, within)
    return zoom(
        lambda _, points: curve(points.ravel()).reshape(points.shape),
        low, high, top, height, sections=SECTIONS, rounds=rounds,
    )  # fmt: skip


def tops(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether a sample is a local maximum of its curve (..., k); the last one of equals is."""
    ends = np.full((*values.shape[:-1], 1), -np.inf)
    padded = np.concatenate([ends, values, ends], axis=-1)
    return np.asarray((values >= padded[..., :-2]) & (values > padded[..., 2:]))


def _brackets(
    omega: NDArray[np.float64], values: NDArray[np.float64], within: float
) -> tuple[NDArray[np.float64], ...]:
    """Brackets (log low, log high) of the local maxima of a curve, and omega and value there."""
    found = np.flatnonzero(tops(values) & (values >= values.max() - within))
    low = np.log(omega[np.maximum(found - 1, 0)])
    high = np.log(omega[np.minimum(found + 1, omega.size - 1)])
    return low, high, omega[found], values[found]


def zoom(
    curve: Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.float64]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    sections: int,
    rounds: int,
    rivals: NDArray[np.intp] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Refine maxima inside their brackets; each round keeps two of a bracket's sections.

    Parameters
    ----------
    curve : callable
        Values (s, q) of the maxima with the indices (s,), ascending, at frequencies (s, q).
    low, high : (r,)
        Brackets, log of rad per time unit.
    omega, values : (r,)
        The maxima so far.
    sections, rounds : int
        Sections that a bracket is cut into, and how often.
    rivals : (r,) or None
        Maxima with the same number compete: what cannot become the greatest is refined no more.

    Returns
    -------
    omega, values : (r,)
        The greatest values found, and where.

    """
    fractions = np.arange(sections + 1) / sections
    low, high, omega, values = low.copy(), high.copy(), omega.copy(), values.copy()
    open_ = np.arange(omega.size)
    for _ in range(rounds):
        points = low[open_, None] + (high - low)[open_, None] * fractions
        here = curve(open_, np.exp(points))
        rows, index = np.arange(open_.size), here.argmax(axis=1)
        better = here[rows, index] > values[open_]
        omega[open_] = np.where(better, np.exp(points[rows, index]), omega[open_])
        values[open_] = np.where(better, here[rows, index], values[open_])
        left, right = np.maximum(index - 1, 0), np.minimum(index + 1, sections)
        low[open_], high[open_] = points[rows, left], points[rows, right]
        if rivals is not None:
            # A curve that is concave around its peak rises over the next section by no more than
            # over the last one.
            rise = here[rows, index] - np.minimum(here[rows, left], here[rows, right])
            greatest = np.full(rivals[-1] + 1, -np.inf)
            np.maximum.at(greatest, rivals, values)
            open_ = open_[values[open_] + rise >= greatest[rivals[open_]]]
    return omega, values


def highest(
    curves: Callable[[list[NDArray[np.float64]]], list[NDArray[np.float64]]],
    grids: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[Peak, ...]:
    """Return the greatest refined peak of each of several curves; parameters as for `maxima`."""
    return tuple(greatest(*found) for found in maxima(curves, grids))


def greatest(omega: NDArray[np.float64], values: NDArray[np.float64]) -> Peak:
    """Return the highest of several maxima (r,)."""
    best = int(values.argmax())
    return Peak(float(values[best]), float(omega[best]))


def maxima(
    curves: Callable[[list[NDArray[np.float64]]], list[NDArray[np.float64]]],
    grids: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the maxima of each of several curves, zoomed into side by side.

    Those that cannot be a curve's greatest are not refined to the end.

    Parameters
    ----------
    curves : callable
        Values of each curve, (k_i,), at frequencies of its own, (k_i,).
    grids : sequence of (k_i,), (k_i,)
        Ascending frequencies for each curve, and the curve there.

    Returns
    -------
    list of (r_i,), (r_i,)
        For each curve the frequencies of its maxima, and the values there.

    """
    brackets = [_brackets(omega, values, WITHIN) for omega, values in grids]
    owner = np.repeat(np.arange(len(grids)), [bracket[0].size for bracket in brackets])

    def side_by_side(rows: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
        ends = np.searchsorted(owner[rows], np.arange(1, len(grids)))
        parts = [part.ravel() for part in np.split(points, ends)]
        return np.concatenate(curves(parts)).reshape(points.shape)

    where, heights = zoom(
        side_by_side, *(np.concatenate(column) for column in zip(*brackets, strict=True)),
        sections=SECTIONS, rounds=FINE_ROUNDS, rivals=owner,
    )  # fmt: skip
    return [(where[owner == index], heights[owner == index]) for index in range(len(grids))]


def slices(arrays: Sequence[NDArray[np.float64]]) -> list[slice]:
    """Return where each of the arrays (k_i,) is in their concatenation."""
    ends = np.cumsum([0, *(array.size for array in arrays)]).tolist()
    return [slice(first, end) for first, end in itertools.pairwise(ends)]
