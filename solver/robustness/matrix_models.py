"""Taylor models of matrices on many intervals at once, rounded outwards.

A matrix function of t, -1 <= t <= 1, is a polynomial of degree below `DEGREE` and a radius that
holds, entry by entry, the rest and all rounding. The first axis counts the intervals: numpy does
all of them together. Every operation adds to the radius more than its sums of products can lose;
the method is that of `solver.robustness.rounded_models`, which has its sources.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["DEGREE", "OUTWARD", "UNIT", "Models", "rational", "sigma_max_bound"]

DEGREE = 6
UNIT = 4e-16  # of a complex product or sum: four units of rounding and a little
OUTWARD = 1 + 1e-13  # on sums of positive numbers: hundreds of terms, each right to a few units
PARTS = 4  # of an interval, on which its polynomial is taken for a straight line and a rest
MOST_EXCESS = 0.5  # of A Q - I, in its row sums, where Q is to be the inverse of A
NO_BOUND = 1e120  # a radius that stands for "nothing is known": its square does not overflow


@dataclass(frozen=True)
class Models:
    """Matrix functions on c intervals.

    Attributes
    ----------
    P : (DEGREE, c, p, q) complex
        Coefficients of 1, t, t^2, ...
    radius : (c, p, q)
        |f(t) - P(t)| is no greater, for all -1 <= t <= 1.

    """

    P: NDArray[np.complex128]
    radius: NDArray[np.float64]

    @classmethod
    def constant(cls, value: NDArray[np.complex128], count: int) -> Models:
        """Return the exact numbers `value` (p, q) on `count` intervals."""
        P = np.zeros((DEGREE, count, *value.shape), dtype=complex)
        P[0] = value
        return cls(P, np.zeros((count, *value.shape)))

    @classmethod
    def line(cls, middle: NDArray[np.complex128], half: NDArray[np.complex128]) -> Models:
        """Return middle + half t, both (c,), as 1 x 1 matrices."""
        P = np.zeros((DEGREE, middle.size, 1, 1), dtype=complex)
        P[0, :, 0, 0], P[1, :, 0, 0] = middle, half
        return cls(P, np.zeros((middle.size, 1, 1)))

    @property
    def size(self) -> NDArray[np.float64]:
        """Sum of the magnitudes of the coefficients, (c, p, q)."""
        return np.asarray(np.abs(self.P).sum(axis=0) * OUTWARD)

    def __add__(self, other: Models) -> Models:
        """Return the sum."""
        lost = UNIT * (self.size + other.size)
        return Models(self.P + other.P, (self.radius + other.radius + lost) * OUTWARD)

    def times(self, factor: NDArray[np.float64] | float) -> Models:
        """Return the product with real numbers, entry by entry, that are right to one unit."""
        size = np.abs(factor)
        return Models(self.P * factor, (self.radius + UNIT * self.size) * size * OUTWARD)

    def __matmul__(self, other: Models) -> Models:
        """Return the matrix product; a 1 x 1 factor multiplies all entries."""
        if self.radius.shape[1:] == (1, 1) or other.radius.shape[1:] == (1, 1):
            return self._product(other, np.multiply)
        return self._product(other, np.matmul)

    def _product(self, other: Models, multiply: np.ufunc) -> Models:
        inner = self.radius.shape[2] if multiply is np.matmul else 1
        coefficients = np.asarray(multiply(self.P[0], other.P))
        for i in range(1, DEGREE):
            coefficients[i:] += multiply(self.P[i], other.P[: DEGREE - i])
        own, others = np.abs(self.P), np.abs(other.P)
        above = np.cumsum(others[::-1], axis=0)  # magnitudes from each power on, the last one first
        tail = multiply(own[1:], above[: DEGREE - 1]).sum(axis=0)
        sizes = own.sum(axis=0), others.sum(axis=0)
        radius = (
            tail
            + multiply(self.radius, sizes[1] + other.radius)
            + multiply(sizes[0], other.radius)
            + UNIT * (DEGREE * inner + 4) * multiply(*sizes)
        )
        return Models(coefficients, np.minimum(radius * OUTWARD, NO_BOUND))

    def inverse(self) -> tuple[Models, NDArray[np.bool_]]:
        """Return the inverse, and the intervals (c,) where there is one; elsewhere it is void.

        With the polynomial Q of the inverse and A Q = I + R, the inverse is Q (I + R)^-1, and
        |A^-1 - Q| <= |Q| |R| (I - |R|)^-1 entry by entry.
        """
        size = self.radius.shape[1]
        eye = np.eye(size)
        multiply = np.multiply if size == 1 else np.matmul
        sound = np.asarray(np.isfinite(self.P).all(axis=(0, 2, 3)))
        start = np.where(sound[:, None, None], self.P[0], eye)
        sound &= start[:, 0, 0] != 0 if size == 1 else np.linalg.cond(start) < 1 / UNIT
        start = np.where(sound[:, None, None], start, eye)
        Q = np.zeros_like(self.P)
        Q[0] = first = 1 / start if size == 1 else np.linalg.inv(start)
        for k in range(1, DEGREE):
            Q[k] = multiply(-first, multiply(self.P[1 : k + 1], Q[k - 1 :: -1]).sum(axis=0))
        void = np.zeros_like(self.radius)
        guess = Models(Q, void)
        excess = self @ guess
        excess.P[0] -= eye
        R = (excess.size + excess.radius + UNIT) * OUTWARD
        sound &= R.sum(axis=2).max(axis=1) < MOST_EXCESS
        R = np.where(sound[:, None, None], R, 0.0)
        rest = R / (eye - R) if size == 1 else R @ np.linalg.inv(eye - R)
        radius = multiply(guess.size, rest) * (OUTWARD * OUTWARD)
        return Models(guess.P, np.where(sound[:, None, None], radius, NO_BOUND)), sound


def rational(
    num: NDArray[np.float64], dens: list[NDArray[np.float64]], variable: Models
) -> tuple[Models, NDArray[np.bool_]]:
    """Return num/(den_1 den_2 ...), ascending powers of the variable, and where it is known.

    Parameters
    ----------
    num, dens : (r,) and list of (r,)
        Coefficients, ascending, each right to one unit of rounding.
    variable : Models
        1 x 1.

    """
    value = _polynomial(num, variable)
    sound = np.ones(variable.radius.shape[0], dtype=bool)
    for den in dens:
        inverse, known = _polynomial(den, variable).inverse()
        value = value @ inverse
        sound &= known
    return value, sound


def _polynomial(coefficients: NDArray[np.float64], variable: Models) -> Models:
    """Horner's scheme."""
    count = variable.radius.shape[0]
    value = Models.constant(np.array([[coefficients[-1] + 0j]]), count)
    value = Models(value.P, value.radius + UNIT * abs(coefficients[-1]))
    for coefficient in coefficients[-2::-1]:
        value = value @ variable
        value.P[0] += coefficient
        value = Models(value.P, value.radius + UNIT * (np.abs(value.P[0]) + abs(coefficient)))
    return value


def sigma_max_bound(models: Models) -> NDArray[np.float64]:
    """Upper bound over t of the greatest singular value, (c,).

    On each of `PARTS` parts the polynomial is a straight line and a rest; along the line a norm is
    convex, so that its ends bound it.
    """
    P = models.P
    moved = (_MOVES @ P.reshape(DEGREE, -1)).reshape(PARTS, DEGREE, *P.shape[1:])
    rounding = UNIT * (2 * DEGREE) * 2.0**DEGREE * models.size  # of the polynomials moved
    rest = np.abs(moved[:, 2:]).sum(axis=1) + (models.radius + rounding)
    rest = np.minimum(rest, NO_BOUND)
    ends = np.stack([moved[:, 0] - moved[:, 1], moved[:, 0] + moved[:, 1]])
    finite = np.isfinite(ends).all(axis=(0, 1, 3, 4))
    finite &= models.radius.max(axis=(1, 2)) < NO_BOUND
    straight = _greatest_singular(np.where(finite[:, None, None], ends, 0)).max(axis=0)
    # Both ways exact for a matrix within a few hundred units of rounding.
    along = (straight + _frobenius(rest)) * OUTWARD
    return np.asarray(np.where(finite, along.max(axis=0), np.inf))


def _frobenius(A: NDArray[np.float64]) -> NDArray[np.float64]:
    """Norm of each of (..., p, q), >= 0: no square is below the smallest number, to be lost."""
    largest = A.max(axis=(-2, -1))
    scaled = A / np.where(largest == 0, 1.0, largest)[..., None, None]
    return np.asarray(largest * np.linalg.norm(scaled, axis=(-2, -1)))


def _greatest_singular(A: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Greatest singular value of each of (..., p, q): of one entry and of 2 x 2 without LAPACK."""
    if A.shape[-2:] == (1, 1):
        return np.asarray(np.abs(A[..., 0, 0]))
    if A.shape[-2:] != (2, 2):
        return np.asarray(np.linalg.norm(A, 2, axis=(-2, -1)))
    largest = np.abs(A).max(axis=(-2, -1))
    A = A / np.where(largest == 0, 1.0, largest)[..., None, None]
    # A^H A = [[a, c], [conj c, b]] has its greater eigenvalue at the sum of positive numbers.
    squares = (np.abs(A) ** 2).sum(axis=-2)
    a, b = squares[..., 0], squares[..., 1]
    c = np.abs((A[..., 0].conj() * A[..., 1]).sum(axis=-1))
    return np.asarray(largest * np.sqrt((a + b + np.hypot(a - b, 2 * c)) / 2))


def _moves() -> NDArray[np.complex128]:
    """From coefficients in t to those in u, t = centre + u/PARTS, for each part: stacked rows."""
    centres = (2 * np.arange(PARTS) + 1) / PARTS - 1
    rows = [
        [math.comb(i, k) * centre ** (i - k) * PARTS**-k if i >= k else 0.0 for i in range(DEGREE)]
        for centre in centres
        for k in range(DEGREE)
    ]
    return np.array(rows, dtype=complex)


_MOVES = _moves()
