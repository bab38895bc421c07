"""Bristol's relative gain array R = P .* P^-T, static, at frequencies and for integrating plants.

Astrom and Hagglund, chapter 11, eqs. 11.3 to 11.5; the array over frequency: Johansson (1993),
eq. 7, after McAvoy.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.interaction.parallel_matrix import ParallelMatrix
from solver.model.errors import InvalidInputError
from solver.model.validation import square_matrix
from solver.stability.singular import SINGULAR_CONDITION, equilibrate, has_empty_line, is_singular

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from solver.model.plants import ParallelPlant, Plant
    from solver.model.transfer_function import TransferFunction

__all__ = [
    "GainStatus",
    "LowFrequencyGain",
    "low_frequency_gain",
    "parallel_low_frequency_gain",
    "relative_gain_array",
    "relative_gain_at",
]


class GainStatus(StrEnum):
    """What is known of the gain as s goes to zero.

    REGULAR: P(0) is finite and not singular.
    INTEGRATING: some elements integrate; the array is the limit for s -> 0.
    SINGULAR: the gain (of an integrating plant: its leading terms) is singular, so the array
    does not exist; relative gains grow without bound as s goes to zero. A stable plant cannot
    have integral control of all outputs then. Try (a) other actuators or measurements, (b)
    dropping one of the dependent loops.
    """

    REGULAR = "regular"
    INTEGRATING = "integrating"
    SINGULAR = "singular"


@dataclass(frozen=True)
class LowFrequencyGain:
    """Leading behaviour P(s) ~ diag(s^rows) gain diag(s^columns) as s -> 0.

    Relative gains, pairings and the Niederlinski index do not change when rows and columns are
    scaled, so `gain` stands for P(0) in all of them. `rows` and `columns` (n,) are zero for a
    plant without integrators.
    """

    status: GainStatus
    gain: NDArray[np.float64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]


def relative_gain_array(gain: ArrayLike) -> NDArray[np.float64]:
    """Return the relative gain array of a static gain, (n, n).

    Element (r, c) is the gain from input c to output r with all other loops open, over the same
    gain with all other outputs held by their loops. Rows and columns sum to one.

    Parameters
    ----------
    gain : array_like
        Static gain, (n, n) real.

    Returns
    -------
    (n, n) real
        Source: Astrom and Hagglund, eq. 11.4.

    Raises
    ------
    InvalidInputError
        Not a square matrix, a number that is not finite, or a singular gain.

    Examples
    --------
    >>> relative_gain_array([[1, 2], [1, 1]])
    array([[-1.,  2.],
           [ 2., -1.]])

    """
    P = square_matrix(gain)
    if is_singular(P):
        message = "the gain is singular: its relative gain array does not exist"
        raise InvalidInputError(message)
    core = equilibrate(P)  # scaling leaves the array as it is and the inverse accurate
    gains = core * np.linalg.inv(core).T
    # An element that is zero but for rounding must not pass for a positive one.
    noise = len(gains) * np.finfo(float).eps * max(1.0, float(np.max(np.abs(gains)))) ** 2
    return np.where(np.abs(gains) <= noise, 0.0, gains)


def relative_gain_at(response: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the relative gain array at frequencies, (k, n, n) complex.

    NaN at a frequency where the response is singular or infinite (a zero or pole on the
    imaginary axis).

    Parameters
    ----------
    response : (k, n, n) complex
        Frequency response of the plant. Source: Johansson (1993), eq. 7.

    """
    result = np.full(response.shape, complex(np.nan, np.nan))
    usable = np.all(np.isfinite(response), axis=(1, 2)) & ~has_empty_line(response)
    core = equilibrate(response[usable])
    regular = np.linalg.cond(core) <= SINGULAR_CONDITION
    core = core[regular]
    result[np.flatnonzero(usable)[regular]] = core * np.linalg.inv(core).transpose(0, 2, 1)
    return result


def low_frequency_gain(plant: Plant) -> LowFrequencyGain:
    """Return the leading behaviour of the plant as s -> 0.

    For an integrating plant the powers of s are the dual variables of an assignment problem on
    the elements' orders: the scaled matrix is finite and holds a full transversal, so unless
    leading terms cancel it is regular and the limit of the array is exact.

    Parameters
    ----------
    plant : Plant
        Any plant; dead time does not matter here.

    """
    n = plant.n
    gain = plant.static_gain()
    flat = np.zeros(n, dtype=np.int64)
    if np.all(np.isfinite(gain)):
        status = GainStatus.SINGULAR if is_singular(gain) else GainStatus.REGULAR
        return LowFrequencyGain(status, gain, flat, flat)
    leading = [[_leading_term(plant.element(r, c)) for c in range(n)] for r in range(n)]
    orders = np.array([[term[0] for term in row] for row in leading])
    coefficients = np.array([[term[1] for term in row] for row in leading])
    if np.any(np.all(coefficients == 0, axis=0)) or np.any(np.all(coefficients == 0, axis=1)):
        return LowFrequencyGain(GainStatus.SINGULAR, coefficients, flat, flat)
    rows, columns = _dual_powers(orders, coefficients != 0)
    scaled = np.where(orders == rows[:, None] + columns[None, :], coefficients, 0.0)
    status = GainStatus.SINGULAR if is_singular(scaled) else GainStatus.INTEGRATING
    return LowFrequencyGain(status, scaled, rows, columns)


def parallel_low_frequency_gain(plant: ParallelPlant) -> tuple[GainStatus, ParallelMatrix]:
    """Return the leading behaviour of n identical units as s -> 0, any n.

    Parameters
    ----------
    plant : ParallelPlant
        Any; of n = 1 the interaction does not matter.

    Returns
    -------
    GainStatus, ParallelMatrix
        The matrix holds the coefficients of the lowest power of s in the plant.

    """
    terms = [_leading_term(element) for element in plant.elements]
    order = min(power for power, coefficient in terms if coefficient)
    own, *rest = [coefficient if power == order else 0.0 for power, coefficient in terms]
    matrix = ParallelMatrix(plant.n, own, rest[0] if rest else 0.0)
    size = abs(matrix.own) + (plant.n - 1) * abs(matrix.other)
    singular = abs(matrix.sum_eigenvalue) * SINGULAR_CONDITION <= size
    if plant.n > 1:
        size = abs(matrix.own) + abs(matrix.other)
        singular |= abs(matrix.difference_eigenvalue) * SINGULAR_CONDITION <= size
    if order > 0 or singular:
        return GainStatus.SINGULAR, matrix
    return (GainStatus.INTEGRATING if order < 0 else GainStatus.REGULAR), matrix


def _leading_term(element: TransferFunction) -> tuple[int, float]:
    """Order m and coefficient c of element ~ c s^m as s -> 0; (0, 0) for the zero function."""
    if element.is_zero:
        return 0, 0.0
    num, den = np.array(element.num), np.array(element.den)
    num_order = int(np.flatnonzero(num[::-1])[0])
    den_order = int(np.flatnonzero(den[::-1])[0])
    return num_order - den_order, float(num[-1 - num_order] / den[-1 - den_order])


def _dual_powers(
    orders: NDArray[np.int64], present: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Powers with rows[r] + columns[c] <= orders[r, c], equality along a cheapest transversal."""
    n = len(orders)
    # An absent element is worse than any transversal of present ones.
    absent = 1 + 2 * n * int(np.max(np.abs(orders))) + n
    cost = np.where(present, orders, absent)
    row_index, column_of = scipy.optimize.linear_sum_assignment(cost)
    columns = np.zeros(n, dtype=np.int64)
    # Bellman-Ford on the exchange graph: n rounds suffice, a cheapest transversal has no
    # negative cycle.
    matched = cost[row_index, column_of]
    for _ in range(n):
        rows = matched - columns[column_of]
        columns = np.minimum(columns, np.min(cost - rows[:, None], axis=0))
    rows = matched - columns[column_of]
    return rows.astype(np.int64), columns
