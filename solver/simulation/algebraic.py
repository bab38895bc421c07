"""Algebraic signals s = K s + b, eliminated exactly and whatever the units of the signals.

Signals that do not act on themselves, through others or at once, are substituted in their order:
no gain along such a path, however large, is a reason to doubt. What remains are the loops without
dynamics; each has a solution unless the gain around it is one.
"""

from __future__ import annotations

from graphlib import TopologicalSorter
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["solve_signals"]

_NOTHING_BUT_ROUNDING = 1e14  # condition number, of a loop in balanced units


def solve_signals(gains: NDArray[np.float64], given: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return X with X = gains X + given.

    Parameters
    ----------
    gains : (signals, signals)
        From signals to signals.
    given : (signals, k)
        From everything else to the signals.

    Returns
    -------
    (signals, k) ndarray

    Raises
    ------
    InvalidInputError
        A loop has no solution: its gain is exactly one.

    """
    solved = given.copy()
    for together in _in_order(gains):
        outside = np.flatnonzero(np.any(gains[together] != 0, axis=0))
        outside = outside[~np.isin(outside, together)]
        right = given[together] + gains[np.ix_(together, outside)] @ solved[outside]
        own = gains[np.ix_(together, together)]
        solved[together] = _solve_loop(own, right) if np.any(own) else right
    return solved


def _in_order(gains: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Return the sets of signals that act on each other, causes before effects."""
    count, label = scipy.sparse.csgraph.connected_components(
        gains != 0, directed=True, connection="strong"
    )
    sorter: TopologicalSorter[int] = TopologicalSorter({part: set() for part in range(count)})
    for target, source in zip(*np.nonzero(gains), strict=True):
        if label[target] != label[source]:
            sorter.add(int(label[target]), int(label[source]))
    return [np.flatnonzero(label == part) for part in sorter.static_order()]


def _solve_loop(own: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve (I - own) X = right for signals that all act on each other."""
    # The units of the signals are a similarity; balancing finds one that leaves what is around
    # the loop. Powers of two, so it rounds nothing.
    balanced, (unit, _) = scipy.linalg.matrix_balance(own, permute=False, separate=True)
    loop = np.eye(len(own)) - balanced
    if np.linalg.cond(loop) > _NOTHING_BUT_ROUNDING:
        message = "the loop has no solution: a path without dynamics has a loop gain of exactly one"
        raise InvalidInputError(message)
    solved: NDArray[np.float64] = np.linalg.solve(loop, right / unit[:, None]) * unit[:, None]
    return solved
