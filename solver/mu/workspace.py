"""Records of the compiled kernel, and how its functions are compiled.

Named tuples: compiled code takes them without reference counts, which it would not take records
with.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import solver.compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["TINY", "Factors", "Workspace", "compiled", "inner", "square", "workspace"]

compiled = solver.compiled.compiled(error_model="numpy")
# Without reference counts, which cost more here than the arithmetic; such code allocates nothing.
inner = solver.compiled.compiled(error_model="numpy", _nrt=False)

TINY = 1e-300


class Factors(NamedTuple):
    """The loop at one frequency, N = L R, as `solver.mu.kernel` scales it.

    Attributes
    ----------
    cols : (rows, columns of the widest block) complex
        The a_j, block below block.
    rest : (rows, any) complex
        Likewise the columns whose scale is 1: W_0 is the sum of their squares.
    p, b : (rows,)
        Q = diag(p_i x_s(i) + b_i).
    row_scale, col_scale : (rows,), (columns,)
        Scale of each row, -1 where it has none, and of each column.
    row0, col0 : (blocks + 1,)
        First row and first column of each block, with the totals at the end.
    all_free : bool
        Whether the level scales all of Q (mu) or the b_i alone (skewed mu).

    """

    cols: NDArray[np.complex128]
    rest: NDArray[np.complex128]
    p: NDArray[np.float64]
    b: NDArray[np.float64]
    row_scale: NDArray[np.int64]
    col_scale: NDArray[np.int64]
    row0: NDArray[np.int64]
    col0: NDArray[np.int64]
    all_free: bool


class Workspace(NamedTuple):
    """Scratch arrays of one solve; matrices of blocks stand below each other, columns from 0.

    Attributes
    ----------
    free, fixed : (rows,)
        Diagonals of Q_free and Q_fixed.
    x, x_inverse : (scales,)
        Squared scales, and one over them.
    W, factor, gap, W_gap, W_0 : (rows, rows) complex
        W; a triangular factor; B = (Q^-1 - W)^-1; W B; W_0.
    gap_a : (rows, columns) complex
        B a_j.
    levels : (rows,)
        Inverse levels.
    gradient, hessian, hessian_factor : (scales + 1,), (scales + 1, scales + 1) twice
        Of h in (y, t).
    step, trial : (scales + 1,), (scales,)
        Newton step, and the y that it leads to.
    coefficients : (rows, 4, 3)
        Of a block of one or two rows, at its first row: W_11, W_22, Re W_12 and Im W_12, each as
        coefficients of 1 and of the inverse scales of both columns.
    first, second, variable : (5,), (5, 5), (5,) integer
        Of such a block: derivatives of h, and the variables that they belong to.
    off_diagonal, reflector, image : (rows,), (rows,) complex twice
        For eigenvalues: of the tridiagonal form, a Householder vector and its image.

    """

    free: NDArray[np.float64]
    fixed: NDArray[np.float64]
    x: NDArray[np.float64]
    x_inverse: NDArray[np.float64]
    W: NDArray[np.complex128]
    factor: NDArray[np.complex128]
    gap: NDArray[np.complex128]
    W_gap: NDArray[np.complex128]
    W_0: NDArray[np.complex128]
    gap_a: NDArray[np.complex128]
    levels: NDArray[np.float64]
    gradient: NDArray[np.float64]
    hessian: NDArray[np.float64]
    hessian_factor: NDArray[np.float64]
    step: NDArray[np.float64]
    trial: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    variable: NDArray[np.int64]
    off_diagonal: NDArray[np.float64]
    reflector: NDArray[np.complex128]
    image: NDArray[np.complex128]


@compiled
def workspace(rows, columns, scales):
    """Scratch arrays for `rows` rows in all, blocks of `columns` columns and `scales` scales."""
    size = scales + 1
    z = np.complex128
    return Workspace(
        free=np.empty(rows),
        fixed=np.empty(rows),
        x=np.empty(scales),
        x_inverse=np.empty(scales),
        W=np.empty((rows, rows), z),
        factor=np.empty((rows, rows), z),
        gap=np.empty((rows, rows), z),
        W_gap=np.empty((rows, rows), z),
        W_0=np.empty((rows, rows), z),
        gap_a=np.empty((rows, columns), z),
        levels=np.empty(rows),
        gradient=np.empty(size),
        hessian=np.empty((size, size)),
        hessian_factor=np.empty((size, size)),
        step=np.empty(size),
        trial=np.empty(scales),
        coefficients=np.empty((rows, 4, 3)),
        first=np.empty(5),
        second=np.empty((5, 5)),
        variable=np.empty(5, np.int64),
        off_diagonal=np.empty(rows),
        reflector=np.empty(rows, z),
        image=np.empty(rows, z),
    )


@inner
def square(z):
    """|z|^2."""
    return z.real * z.real + z.imag * z.imag
