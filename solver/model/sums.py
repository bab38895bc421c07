"""Compiled: matrices whose entries are sums of multiples of transfer functions, at many points.

A descent that follows its peaks needs the plant at a handful of frequencies in every step: element
by element that would take longer than the loop itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.compiled import compiled
from solver.model.transfer_function import HARDLY_ZERO

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from solver.model.transfer_function import TransferFunction

__all__ = ["Entry", "Sums", "squares", "summed", "sums"]


class Entry(NamedTuple):
    """What a multiple of a transfer function adds to one entry of a matrix."""

    row: int
    column: int
    factor: float
    element: TransferFunction


class Sums(NamedTuple):
    """The entries of matrices as sums; a named tuple for compiled code.

    Attributes
    ----------
    num, den : (elements, longest)
        Coefficients in descending powers of s, numerators filled up with leading zeros.
    size : (elements,)
        How many of them there are.
    dead_time, reach : (elements,)
        Dead times; and |s| beyond which powers of it do not fit a double.
    row, column, element : (terms,)
        Where a term is, and which element it is a multiple of.
    factor : (terms,)
        Its factor.

    """

    num: NDArray[np.float64]
    den: NDArray[np.float64]
    size: NDArray[np.int64]
    dead_time: NDArray[np.float64]
    reach: NDArray[np.float64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    element: NDArray[np.int64]
    factor: NDArray[np.float64]


def sums(entries: Iterable[Entry]) -> Sums:
    """Return the sums of all entries, each different element once."""
    listed = [each for each in entries if each.factor and not each.element.is_zero]
    number: dict[TransferFunction, int] = {}
    element = [number.setdefault(each.element, len(number)) for each in listed]
    longest = max((len(e.den) for e in number), default=1)
    num, den = np.zeros((len(number), longest)), np.zeros((len(number), longest))
    for e, index in number.items():
        size = len(e.den)
        num[index, size - len(e.num) : size] = e.num
        den[index, :size] = e.den
    return Sums(
        num,
        den,
        np.array([len(e.den) for e in number], dtype=np.int64),
        np.array([e.dead_time for e in number]),
        np.array([e.reach for e in number]),
        np.array([each.row for each in listed], dtype=np.int64),
        np.array([each.column for each in listed], dtype=np.int64),
        np.array(element, dtype=np.int64),
        np.array([each.factor for each in listed], dtype=float),
    )


@compiled(error_model="numpy")
def summed(sums, rows, columns, s):
    """Matrices (k, rows, columns) at the complex points `s` (k,)."""
    found = np.zeros((s.size, rows, columns), np.complex128)
    value = np.empty(sums.size.size, np.complex128)
    for k in range(s.size):
        for e in range(value.size):
            size = sums.size[e]
            over = under = 0j
            if abs(s[k]) > sums.reach[e]:  # in 1/s
                point = 1.0 / s[k]
                for i in range(size - 1, -1, -1):
                    over = over * point + sums.num[e, i]
                    under = under * point + sums.den[e, i]
            else:
                for i in range(size):
                    over = over * s[k] + sums.num[e, i]
                    under = under * s[k] + sums.den[e, i]
            if under == 0.0:  # a pole reads as huge instead of dividing by zero
                under = HARDLY_ZERO + 0j
            value[e] = over / under
            if sums.dead_time[e] > 0.0:
                value[e] *= np.exp(-sums.dead_time[e] * s[k])
        for term in range(sums.factor.size):
            found[k, sums.row[term], sums.column[term]] += (
                sums.factor[term] * value[sums.element[term]]
            )
    return found


@compiled(error_model="numpy")
def squares(sums, rows, s):
    """Squared magnitudes (k, rows) of a column at the complex points `s` (k,)."""
    column = summed(sums, rows, 1, s)
    found = np.empty((s.size, rows))
    for k in range(s.size):
        for row in range(rows):
            found[k, row] = column[k, row, 0].real ** 2 + column[k, row, 0].imag ** 2
    return found
