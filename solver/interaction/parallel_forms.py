"""What the closed forms of the parallel matrix say about n identical units, any n."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.parallel_matrix import relative_gains_over_frequency
from solver.model.plants import MAX_MATRIX_SIZE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.interaction.parallel_matrix import ParallelMatrix
    from solver.model.plants import ParallelPlant

__all__ = ["ParallelForms", "parallel_forms"]


@dataclass(frozen=True)
class ParallelForms:
    """Closed forms of the static gain of n identical units (SLH, section 3), any n.

    Attributes
    ----------
    interaction : float
        a, the gain to a neighbour over the own gain; infinite where the own gain is zero.
    determinant, log_determinant : float
        Eq. 12 and the natural logarithm of its magnitude (the former may overflow).
    own_relative_gain, other_relative_gain : float
        Eqs. 13 and 14; NaN for a singular gain.
    own_inverse, other_inverse : float
        Eqs. 15 and 16; NaN for a singular gain.
    sum_eigenvalue, difference_eigenvalue : float
        Eqs. 19 (once) and 20 (n - 1 times); the singular values are their magnitudes.
    condition_number : float
        Largest over smallest singular value.
    own_relative_gains, other_relative_gains : (k,) complex
        Eqs. 13 and 14 at the frequencies of the curves.
    interactions : (k,) complex
        a(j omega) = i/g, eq. 2, at these; NaN where the process vanishes.
    deviation : float or None
        Greatest relative difference between closed forms and dense matrix computations, as a
        check; None above 10 units.

    """

    interaction: float
    determinant: float
    log_determinant: float
    own_relative_gain: float
    other_relative_gain: float
    own_inverse: float
    other_inverse: float
    sum_eigenvalue: float
    difference_eigenvalue: float
    condition_number: float
    own_relative_gains: NDArray[np.complex128]
    other_relative_gains: NDArray[np.complex128]
    interactions: NDArray[np.complex128]
    deviation: float | None


def parallel_forms(
    plant: ParallelPlant, matrix: ParallelMatrix, omega: NDArray[np.float64]
) -> ParallelForms:
    """Return the closed forms of the plant's static gain, and relative gains over frequency.

    Parameters
    ----------
    plant : ParallelPlant
        n > 1, finite static gain.
    matrix : ParallelMatrix
        Its static gain.
    omega : (k,)
        Frequencies, rad per time unit.

    """
    regular = not matrix.is_singular
    g, i = plant.process.response(omega), plant.interaction.response(omega)
    own, other = relative_gains_over_frequency(plant.n, g, i)
    missing = complex(np.nan, np.nan)
    own_gain, other_gain = float(np.real(matrix.own)), float(np.real(matrix.other))
    return ParallelForms(
        interaction=other_gain / own_gain if own_gain else math.inf,
        determinant=float(np.real(matrix.determinant)),
        log_determinant=matrix.log_determinant.log_magnitude,
        own_relative_gain=float(np.real(matrix.own_relative_gain)) if regular else math.nan,
        other_relative_gain=float(np.real(matrix.other_relative_gain)) if regular else math.nan,
        own_inverse=float(np.real(matrix.own_inverse)) if regular else math.nan,
        other_inverse=float(np.real(matrix.other_inverse)) if regular else math.nan,
        sum_eigenvalue=float(np.real(matrix.sum_eigenvalue)),
        difference_eigenvalue=float(np.real(matrix.difference_eigenvalue)),
        condition_number=matrix.condition_number,
        own_relative_gains=own,
        other_relative_gains=other,
        interactions=np.divide(i, g, out=np.full_like(g, missing), where=g != 0),
        deviation=_deviation(matrix) if regular and matrix.n <= MAX_MATRIX_SIZE else None,
    )


def _deviation(matrix: ParallelMatrix) -> float:
    """Greatest relative difference between the closed forms and dense computations."""
    dense = matrix.dense()
    inverse = np.linalg.inv(dense)
    pairs = (
        (matrix.determinant, np.linalg.det(dense)),
        (matrix.own_inverse, inverse[0, 0]),
        (matrix.own_relative_gain, dense[0, 0] * inverse[0, 0]),
        (matrix.singular_values[0], np.linalg.norm(dense, 2)),
        (matrix.condition_number, np.linalg.cond(dense)),
    )
    return max(float(abs(closed - numeric) / max(abs(closed), 1e-300)) for closed, numeric in pairs)
