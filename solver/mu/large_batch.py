"""Compiled: eight frequencies of a loop with blocks of any size, as lanes.

Matrices of blocks stand below each other, `widest` columns each; entry (i, j) is complex number
i widest + j of its array, see `solver.mu.batch`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.mu.lanes import WIDTH
from solver.mu.workspace import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LargeBatch", "large_batch"]


class LargeBatch(NamedTuple):
    """Eight frequencies.

    Attributes
    ----------
    c : (2 controllers, 8)
        Controllers.
    G, SG, W_0, W : (2 rows widest, 8)
        Plant, S G, and W without and with the scales, the lower triangles.
    elimination : (4 widest^2, 8)
        I + G C of one block, and what becomes its inverse.
    u, p : (rows, 8)
        |w_I|^2 of each row's input, and |w_I c|^2.
    b : (1, 8)
        Weight of the performance rows.
    start, y, trial, x, x_inverse, step : (scales, 8)
        Log of the squared scales: start, result, and where they are tried; the squared scales and
        one over them; Newton step.
    det : (2 blocks, 8)
        det(I + G C).
    factor, inverse, image : (2 widest^2, 8)
        Scratch of one block: triangular factors, inverses and products.
    scaled : (2 widest^2, 8)
        S G of one block between the roots of Q and of the inverse scales.
    reflector, mirrored : (2 widest, 8)
        A Householder vector and its image.
    roots, share_y, share_t : (widest, 8)
        Of Q's diagonal in one block: its root, and dQ/dy and dQ/dt over it.
    diagonal, off_diagonal : (rows, 8)
        Tridiagonal form of the inverse levels; the latter zero behind the last row of a block.
    gradient, hessian : (scales + 1, 8), ((scales + 1)^2, 8)
        Of h in (y, t); the lower triangle.
    level, centre, failed : (1, 8)
        Largest inverse level, that of the barrier's optimum, and 1 where the kernel is needed.
    t, slope : (1, 8), (2 controllers, 8)
        As of `solver.mu.scaling.sweep`.

    """

    c: NDArray[np.float64]
    G: NDArray[np.float64]
    SG: NDArray[np.float64]
    W_0: NDArray[np.float64]
    W: NDArray[np.float64]
    elimination: NDArray[np.float64]
    u: NDArray[np.float64]
    p: NDArray[np.float64]
    b: NDArray[np.float64]
    start: NDArray[np.float64]
    y: NDArray[np.float64]
    trial: NDArray[np.float64]
    x: NDArray[np.float64]
    x_inverse: NDArray[np.float64]
    step: NDArray[np.float64]
    det: NDArray[np.float64]
    factor: NDArray[np.float64]
    inverse: NDArray[np.float64]
    image: NDArray[np.float64]
    scaled: NDArray[np.float64]
    reflector: NDArray[np.float64]
    mirrored: NDArray[np.float64]
    roots: NDArray[np.float64]
    share_y: NDArray[np.float64]
    share_t: NDArray[np.float64]
    diagonal: NDArray[np.float64]
    off_diagonal: NDArray[np.float64]
    gradient: NDArray[np.float64]
    hessian: NDArray[np.float64]
    level: NDArray[np.float64]
    centre: NDArray[np.float64]
    failed: NDArray[np.float64]
    t: NDArray[np.float64]
    slope: NDArray[np.float64]


@compiled
def large_batch(rows, widest, blocks, controllers, scales):
    """Arrays for so many of each."""
    size = scales + 1
    return LargeBatch(
        c=np.empty((2 * controllers, WIDTH)),
        G=np.zeros((2 * rows * widest, WIDTH)),
        SG=np.zeros((2 * rows * widest, WIDTH)),
        W_0=np.zeros((2 * rows * widest, WIDTH)),
        W=np.zeros((2 * rows * widest, WIDTH)),
        elimination=np.empty((4 * widest * widest, WIDTH)),
        u=np.empty((rows, WIDTH)),
        p=np.empty((rows, WIDTH)),
        b=np.empty((1, WIDTH)),
        start=np.empty((scales, WIDTH)),
        y=np.zeros((scales, WIDTH)),
        trial=np.empty((scales, WIDTH)),
        x=np.empty((scales, WIDTH)),
        x_inverse=np.empty((scales, WIDTH)),
        step=np.zeros((scales, WIDTH)),
        det=np.empty((2 * blocks, WIDTH)),
        factor=np.empty((2 * widest * widest, WIDTH)),
        inverse=np.empty((2 * widest * widest, WIDTH)),
        image=np.empty((2 * widest * widest, WIDTH)),
        scaled=np.empty((2 * widest * widest, WIDTH)),
        reflector=np.empty((2 * widest, WIDTH)),
        mirrored=np.empty((2 * widest, WIDTH)),
        roots=np.empty((widest, WIDTH)),
        share_y=np.empty((widest, WIDTH)),
        share_t=np.empty((widest, WIDTH)),
        diagonal=np.empty((rows, WIDTH)),
        off_diagonal=np.empty((rows, WIDTH)),
        gradient=np.empty((size, WIDTH)),
        hessian=np.empty((size * size, WIDTH)),
        level=np.empty((1, WIDTH)),
        centre=np.empty((1, WIDTH)),
        failed=np.empty((1, WIDTH)),
        t=np.empty((1, WIDTH)),
        slope=np.empty((2 * controllers, WIDTH)),
    )
