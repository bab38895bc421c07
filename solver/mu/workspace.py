"""Scratch arrays of the kernel, and how its functions are compiled."""

import numpy as np
from numba import njit

__all__ = ["TINY", "compiled", "inner", "square", "workspace"]

compiled = njit(cache=True, error_model="numpy")
# Without reference counts, which cost more here than the arithmetic; such code allocates nothing.
inner = njit(cache=True, error_model="numpy", _nrt=False)

TINY = 1e-300

# Places in the workspace, a tuple, since compiled code knows no records.
(
    FREE,  # Q_free
    FIXED,  # Q_fixed
    X,
    X_INVERSE,
    W_BLOCK,  # a block in its rows, columns from 0; like all matrices of blocks
    FACTOR,  # triangular factor
    GAP,  # B = (Q^-1 - W)^-1
    W_GAP,  # W B
    GAP_A,  # B a_j
    LEVELS,  # inverse levels
    GRADIENT,  # of h in (y, t)
    HESSIAN,
    HESSIAN_FACTOR,
    STEP,  # in y
    TRIAL,  # y
    W_0,
    COEFFICIENTS,  # of a small block's W, in its first row
    FIRST,  # first derivatives of a small block
    SECOND,  # second ones
    VARIABLE,  # the variables that they belong to
    OFF_DIAGONAL,  # of a tridiagonal matrix
    REFLECTOR,
    IMAGE,  # of the reflector
) = range(23)


@compiled
def workspace(rows, columns, scales):
    """Scratch arrays of one solve."""
    size = scales + 1
    z = np.complex128
    return (
        np.empty(rows),
        np.empty(rows),
        np.empty(scales),
        np.empty(scales),
        np.empty((rows, rows), z),
        np.empty((rows, rows), z),
        np.empty((rows, rows), z),
        np.empty((rows, rows), z),
        np.empty((rows, columns), z),
        np.empty(rows),
        np.empty(size),
        np.empty((size, size)),
        np.empty((size, size)),
        np.empty(size),
        np.empty(scales),
        np.empty((rows, rows), z),
        np.empty((rows, 12)),
        np.empty(5),
        np.empty((5, 5)),
        np.empty(5, np.int64),
        np.empty(rows),
        np.empty(rows, z),
        np.empty(rows, z),
    )


@inner
def square(z):
    """|z|^2."""
    return z.real * z.real + z.imag * z.imag
