"""Compiled: eight frequencies as lanes, and complex numbers in them.

Arrays have a row a quantity, (rows, `WIDTH`). A complex number is a pair of lanes, and takes two
rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.mu.lanes import WIDTH, fill, load, store
from solver.mu.workspace import compiled, inner

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "ENTRIES", "TABLE", "Batch", "batch", "conjugate_times", "pair", "plus", "put", "scaled",
    "square", "times",
]  # fmt: skip

TABLE = 12  # rows of a block: three coefficients each of W_11, W_22, Re W_12, Im W_12
ENTRIES = 4  # rows of a block at its scales: W_11, W_22, Re W_12, Im W_12


class Batch(NamedTuple):
    """Eight frequencies.

    Attributes
    ----------
    c : (2 controllers, 8)
        Controllers.
    G, SG : (4 rows, 8)
        Plant and S G of all blocks, two columns a row.
    u : (rows, 8)
        |w_I|^2 of each row's input.
    b : (1, 8)
        Weight of the performance rows.
    p : (rows, 8)
        |w_I c|^2.
    start, y, x, x_inverse : (scales, 8)
        Log of the squared scales, start and result; the squared scales; one over them.
    det : (2 blocks, 8)
        det(I + G C).
    table, W : (12 blocks, 8), (4 blocks, 8)
        Coefficients of W, and W at the scales.
    levels : (rows, 8)
        Inverse levels.
    level, centre, failed : (1, 8)
        Largest inverse level, that of the barrier's optimum, and 1 where the kernel is needed.
    t, slope : (1, 8), (2 controllers, 8)
        As of `solver.mu.scaling.sweep`.

    """

    c: NDArray[np.float64]
    G: NDArray[np.float64]
    SG: NDArray[np.float64]
    u: NDArray[np.float64]
    b: NDArray[np.float64]
    p: NDArray[np.float64]
    start: NDArray[np.float64]
    y: NDArray[np.float64]
    x: NDArray[np.float64]
    x_inverse: NDArray[np.float64]
    det: NDArray[np.float64]
    table: NDArray[np.float64]
    W: NDArray[np.float64]
    levels: NDArray[np.float64]
    level: NDArray[np.float64]
    centre: NDArray[np.float64]
    failed: NDArray[np.float64]
    t: NDArray[np.float64]
    slope: NDArray[np.float64]


@compiled
def batch(rows, blocks, controllers, scales):
    """Arrays for so many of each."""
    return Batch(
        c=np.empty((2 * controllers, WIDTH)),
        G=np.zeros((4 * rows, WIDTH)),
        SG=np.zeros((4 * rows, WIDTH)),
        u=np.empty((rows, WIDTH)),
        b=np.empty((1, WIDTH)),
        p=np.empty((rows, WIDTH)),
        start=np.empty((scales, WIDTH)),
        y=np.zeros((scales, WIDTH)),
        x=np.empty((scales, WIDTH)),
        x_inverse=np.empty((scales, WIDTH)),
        det=np.empty((2 * blocks, WIDTH)),
        table=np.empty((TABLE * blocks, WIDTH)),
        W=np.empty((ENTRIES * blocks, WIDTH)),
        levels=np.empty((rows, WIDTH)),
        level=np.empty((1, WIDTH)),
        centre=np.empty((1, WIDTH)),
        failed=np.empty((1, WIDTH)),
        t=np.empty((1, WIDTH)),
        slope=np.empty((2 * controllers, WIDTH)),
    )


@inner
def pair(array, row):
    """One complex number, its parts."""
    return load(array, 2 * row), load(array, 2 * row + 1)


@inner
def put(array, row, a):
    """Store one complex number."""
    store(array, 2 * row, a[0])
    store(array, 2 * row + 1, a[1])


@inner
def times(a, b):
    """Return a b."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


@inner
def conjugate_times(a, b):
    """Return a^H b."""
    return a[0] * b[0] + a[1] * b[1], a[0] * b[1] - a[1] * b[0]


@inner
def product_sum(start, A, a, a_step, B, b, b_step, count):
    """Return `start` plus the sum of A[a + m a_step] B[b + m b_step] over `count` m from 0."""
    real, imaginary = start
    more, less = fill(0.0), fill(0.0)
    for m in range(count):
        x, y = pair(A, a + m * a_step), pair(B, b + m * b_step)
        real += x[0] * y[0]
        more += x[1] * y[1]
        imaginary += x[0] * y[1]
        less += x[1] * y[0]
    return real - more, imaginary + less


@inner
def conjugate_sum(start, A, a, a_step, B, b, b_step, count):
    """Return the same with the conjugates of A's numbers."""
    real, imaginary = start
    more, less = fill(0.0), fill(0.0)
    for m in range(count):
        x, y = pair(A, a + m * a_step), pair(B, b + m * b_step)
        real += x[0] * y[0]
        more += x[1] * y[1]
        imaginary += x[0] * y[1]
        less += x[1] * y[0]
    return real + more, imaginary - less


@inner
def plus(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1]


@inner
def scaled(a, factor):
    """Return a complex number times real lanes."""
    return a[0] * factor, a[1] * factor


@inner
def square(a):
    """Return |a|^2."""
    return a[0] * a[0] + a[1] * a[1]
