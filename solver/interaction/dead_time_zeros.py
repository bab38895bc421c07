"""Right-half-plane zeros of matrices whose dead times do not factor out.

The determinant is transcendental and may have infinitely many zeros; those up to a radius are
found by the argument principle. Dead times of whole rows and columns are taken out first.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.interaction.rational_matrix import Root
from solver.interaction.zero_search import Rectangle, zeros_in_box
from solver.model.frequencies import corners_of
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from solver.model.transfer_function import TransferFunction

__all__ = ["SumMatrix", "right_half_plane_zeros", "search_radius"]

SumMatrix = list[list[tuple["TransferFunction", ...]]]
"""Square matrix of sums of transfer functions."""

_REACH = 10.0  # over the highest corner frequency
_ALMOST_ZERO = 1e-60
_LARGEST_RADIUS = 1e13  # its 20th power times a coefficient still is a number
_MAX_PHASE = 60.0  # radians by which dead time may turn the determinant: about ten zeros


def search_radius(rows: SumMatrix) -> float:
    """Return the radius up to which zeros are sought, rad per time unit.

    Ten times the highest corner frequency, less where dead times turn the determinant by more
    than 60 rad before.
    """
    reach = min(_REACH * float(corners_of(_terms(rows))[-1]), _LARGEST_RADIUS)
    longest = float(np.sum(np.max(_remaining_dead_times(rows), axis=(1, 2))))
    return min(reach, _MAX_PHASE / longest) if longest > 0 else reach


def right_half_plane_zeros(
    rows: SumMatrix, factors: tuple[int, ...], radius: float
) -> tuple[Root, ...] | None:
    """Return the zeros with Re >= 0 up to the radius; None where the determinant vanishes.

    Zeros at unstable poles of the elements are not told from these poles and are left out.

    Parameters
    ----------
    rows : SumMatrix
        The matrix; the terms of each sum are weighted with `factors`.
    factors : tuple of int
        One a term.
    radius : float
        In rad per time unit.

    """
    lowest = float(corners_of(_terms(rows))[0])
    margin = 1e-4 * min(lowest, radius)  # lets the box hold zeros on the axes
    matrix = _Delayed.from_sums(rows, factors)
    unstable = _unstable_poles(rows, -2 * margin)

    def determinant(points: NDArray[Any]) -> NDArray[np.complex128]:
        value = np.linalg.det(matrix(points))
        for pole, count in unstable.items():
            value = value * ((points - pole) / (points + radius)) ** count
        return np.asarray(value, dtype=np.complex128)

    # Three points off the axes tell a determinant that vanishes identically.
    probe = matrix(radius * np.array([0.01 + 0.3j, 0.1 + 0.05j, 0.4j]))
    if all(is_singular(P) for P in probe):
        return None
    # Off-round numbers: a zero at a round place must not meet the edge. The lower half plane
    # follows by symmetry.
    box = Rectangle(-margin, -1.1 * margin, 1.00077 * radius, 1.00181 * radius)
    roots: list[Root] = []
    # A single zero at s = 0 comes out far below the lowest corner, a multiple one within the
    # smallest box that is searched.
    origin = max(1e-6 * margin, 2e-12 * radius)
    for root in zeros_in_box(determinant, box):
        value, count = root.value, root.multiplicity
        if any(abs(value - pole) <= max(1e-6 * abs(pole), origin) for pole in unstable):
            continue
        if abs(value.imag) <= 1e-9 * abs(value) or abs(value) <= 1e-9 * margin:
            roots.append(Root(complex(value.real), count))
        elif value.imag > 0:
            roots += [Root(value, count), Root(value.conjugate(), count)]
    return tuple(roots)


@dataclass(frozen=True)
class _Delayed:
    """The matrix as a function of s, all elements at once.

    `num` and `den` (n, n, terms, order + 1) in descending powers; `dead_times` (n, n, terms).
    """

    num: NDArray[np.float64]
    den: NDArray[np.float64]
    dead_times: NDArray[np.float64]

    @classmethod
    def from_sums(cls, rows: SumMatrix, factors: tuple[int, ...]) -> _Delayed:
        length = max(len(term.den) for row in rows for terms in row for term in terms)

        def padded(coefficients: tuple[float, ...]) -> list[float]:
            return [0.0] * (length - len(coefficients)) + list(coefficients)

        num = np.array([[[padded(term.num) for term in terms] for terms in row] for row in rows])
        den = np.array([[[padded(term.den) for term in terms] for terms in row] for row in rows])
        weights = np.array(factors, dtype=float)[:, None]
        # Rows scaled by constants, which moves no zero: the determinant must not overflow.
        size = np.max(np.abs(num), axis=3) / np.max(np.abs(den), axis=3)
        largest = np.max(size, axis=(1, 2))
        largest = np.where(largest > 0, largest, 1.0)[:, None, None, None]
        return cls(num / largest * weights, den, _remaining_dead_times(rows))

    def __call__(self, points: NDArray[Any]) -> NDArray[np.complex128]:
        # Horner's rule overflows nowhere: coefficients and radius are bounded, the order too.
        s = points[:, None, None, None]
        num = np.zeros((points.size, *self.dead_times.shape), dtype=complex)
        den = num.copy()
        for power in range(self.num.shape[-1]):
            num = num * s + self.num[..., power]
            den = den * s + self.den[..., power]
        den = np.where(den == 0, _ALMOST_ZERO, den)  # a pole reads as huge
        total: NDArray[np.complex128] = np.sum(num / den * np.exp(-self.dead_times * s), axis=3)
        return total


def _terms(rows: SumMatrix) -> Iterator[TransferFunction]:
    return (term for row in rows for terms in row for term in terms if not term.is_zero)


def _remaining_dead_times(rows: SumMatrix) -> NDArray[np.float64]:
    """Dead times less those of whole rows and columns, (n, n, terms)."""
    times = np.array(
        [[[np.inf if t.is_zero else t.dead_time for t in ts] for ts in row] for row in rows]
    )
    for axis in ((1, 2), (0, 2)):
        least = np.min(times, axis=axis, keepdims=True)
        times = times - np.where(np.isfinite(least), least, 0.0)
    return np.where(np.isfinite(times), times, 0.0)


def _unstable_poles(rows: SumMatrix, least_real: float) -> Counter[complex]:
    """Poles right of a line, each as often as the determinant could have it: once a row."""
    total: Counter[complex] = Counter()
    for row in rows:
        of_row: Counter[complex] = Counter()
        for term in (term for terms in row for term in terms):
            of_row |= Counter(complex(pole) for pole in term.poles if pole.real >= least_real)
        total += of_row
    return total
