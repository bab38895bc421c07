"""The parallel matrix: one number on the diagonal, another everywhere else, in closed form.

Skogestad, Lundstrom and Hovd (1989), section 3, eqs. 9 to 24, in terms of the two elements
k = `own` and k a = `other` instead of k and a, so that the own gain may vanish.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.validation import integer, settle

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LogDeterminant", "ParallelMatrix", "relative_gains_over_frequency"]


@dataclass(frozen=True)
class LogDeterminant:
    """Determinant as phase (of magnitude one, or zero) and natural logarithm of the magnitude."""

    phase: complex
    log_magnitude: float


@dataclass(frozen=True)
class ParallelMatrix:
    """n x n matrix with `own` on the diagonal and `other` everywhere else.

    It has two modes: the sum of all signals (once) and differences between them (n - 1 times).

    Parameters
    ----------
    n : int
        Size, >= 1.
    own, other : complex
        The two elements, real or complex.

    Examples
    --------
    >>> matrix = ParallelMatrix(3, 2.0, 1.0)
    >>> matrix.sum_eigenvalue, matrix.difference_eigenvalue
    (4.0, 1.0)

    """

    n: int
    own: complex
    other: complex

    def __post_init__(self) -> None:
        settle(self, n=integer(self.n, "/n"))
        if self.n < 1:
            message = "the size must be at least 1"
            raise InvalidInputError(message, "/n")

    @property
    def sum_eigenvalue(self) -> complex:
        """Eigenvalue of the sum of all signals, once; eq. 19."""
        return self.own + (self.n - 1) * self.other

    @property
    def difference_eigenvalue(self) -> complex:
        """Eigenvalue of differences between signals, n - 1 times; eq. 20."""
        return self.own - self.other

    @property
    def log_determinant(self) -> LogDeterminant:
        """Determinant, eq. 12, safe for any n."""
        phase, log_magnitude = 1.0 + 0.0j, 0.0
        for value, count in ((self.sum_eigenvalue, 1), (self.difference_eigenvalue, self.n - 1)):
            if count == 0:
                continue
            if value == 0:
                return LogDeterminant(0j, -math.inf)
            phase *= (value / abs(value)) ** count
            log_magnitude += count * math.log(abs(value))
        return LogDeterminant(phase / abs(phase), log_magnitude)

    @property
    def determinant(self) -> complex:
        """Determinant, eq. 12; overflows to infinity for large n."""
        if self.n == 1:
            return self.own
        try:
            return self.sum_eigenvalue * self.difference_eigenvalue ** (self.n - 1)
        except OverflowError:
            return math.inf

    @property
    def is_singular(self) -> bool:
        """Whether an eigenvalue is zero."""
        return self.sum_eigenvalue == 0 or (self.n > 1 and self.difference_eigenvalue == 0)

    @property
    def own_relative_gain(self) -> complex:
        """Diagonal element of the relative gain array, eq. 13. Needs a regular matrix."""
        return self.own * self.own_inverse + 0.0  # no -0

    @property
    def other_relative_gain(self) -> complex:
        """Off-diagonal element of the relative gain array, eq. 14. Needs n > 1, regular."""
        return self.other * self.other_inverse

    @property
    def own_inverse(self) -> complex:
        """Diagonal element of the inverse, eq. 15."""
        self._check_regular()
        if self.n == 1:
            return 1 / self.own
        # The own element over the sum mode first: the product of both may overflow.
        rest = self.own + (self.n - 2) * self.other
        return rest / self.sum_eigenvalue / self.difference_eigenvalue

    @property
    def other_inverse(self) -> complex:
        """Off-diagonal element of the inverse, eq. 16. Needs n > 1."""
        self._check_regular()
        return -self.other / self.sum_eigenvalue / self.difference_eigenvalue

    @property
    def singular_values(self) -> NDArray[np.float64]:
        """Singular values, (n,) descending: the magnitudes of the eigenvalues, section 3.2."""
        values = np.full(self.n, abs(self.difference_eigenvalue))
        values[0] = abs(self.sum_eigenvalue)
        return np.sort(values)[::-1]

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value; infinite for a singular matrix."""
        if self.n == 1:
            return 1.0 if self.own else math.inf
        magnitudes = abs(self.sum_eigenvalue), abs(self.difference_eigenvalue)
        return max(magnitudes) / min(magnitudes) if min(magnitudes) else math.inf

    def eigenvectors(self) -> NDArray[np.complex128]:
        """Return unit eigenvectors as columns, (n, n): the Fourier matrix, eq. 21.

        The first one belongs to the sum, all others to differences.
        """
        power = np.outer(np.arange(self.n), np.arange(self.n)) % self.n
        return np.asarray(np.exp(2j * np.pi * power / self.n) / math.sqrt(self.n), dtype=complex)

    def dense(self) -> NDArray[np.complex128] | NDArray[np.float64]:
        """Return the matrix itself, (n, n), real where both elements are."""
        matrix = np.full((self.n, self.n), self.other)
        np.fill_diagonal(matrix, self.own)
        return matrix

    def _check_regular(self) -> None:
        if self.is_singular:
            message = "the parallel matrix is singular: its units cannot be controlled one by one"
            raise InvalidInputError(message)


def relative_gains_over_frequency(
    n: int, own: NDArray[np.complex128], other: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return own and other relative gains at frequencies, each (k,); NaN where singular.

    Parameters
    ----------
    n : int
        Number of units, > 1.
    own, other : (k,) complex
        g and i at the frequencies. Source: SLH eqs. 13 and 14.

    """
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / (own + (n - 1) * other) / (own - other)
        gains = own * (own + (n - 2) * other) * scale, -other * other * scale
    finite = np.isfinite(gains[0])
    missing = complex(np.nan, np.nan)
    return np.where(finite, gains[0], missing), np.where(finite, gains[1], missing)
