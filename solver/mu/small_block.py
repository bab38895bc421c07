"""Blocks of one or two rows: all that one or two groups of any number of units have.

Everything is written out. A difference that vanishes at the optimum is never formed from numbers
that do not: det(I - Q W) is (1 - q_1 w_11)(1 - q_2 w_22) - q_1 q_2 |w_12|^2.
"""

import math

import numpy as np

from solver.mu.workspace import inner, square

__all__ = ["derivatives", "levels", "prepare", "sensitivities"]

REAL, IMAGINARY = 2, 3  # parts of W_12 among the coefficients, after W_11 and W_22


@inner
def prepare(factors, block, ws):
    """Work out what the scales leave alone: the coefficients of W in the inverse scales."""
    cols, rest, row0, col0 = factors.cols, factors.rest, factors.row0, factors.col0
    table = ws.coefficients
    lo, rows = row0[block], row0[block + 1] - row0[block]
    columns = col0[block + 1] - col0[block]
    for entry in range(4):
        for k in range(3):
            table[lo, entry, k] = 0.0
    for i in range(rows):
        for j in range(rest.shape[1]):
            table[lo, i, 0] += square(rest[lo + i, j])
        for j in range(columns):
            table[lo, i, 1 + j] = square(cols[lo + i, j])
    if rows > 1:
        for j in range(rest.shape[1]):
            v = rest[lo, j] * np.conj(rest[lo + 1, j])
            table[lo, REAL, 0] += v.real
            table[lo, IMAGINARY, 0] += v.imag
        for j in range(columns):
            v = cols[lo, j] * np.conj(cols[lo + 1, j])
            table[lo, REAL, 1 + j], table[lo, IMAGINARY, 1 + j] = v.real, v.imag


@inner
def _entries(factors, block, ws):
    """W_11, W_22 and W_12 of a block of one or two rows, at the scales in the workspace."""
    lo, first = factors.row0[block], factors.col0[block]
    columns = factors.col0[block + 1] - first
    e1 = ws.x_inverse[factors.col_scale[first]] if columns > 0 else 0.0
    e2 = ws.x_inverse[factors.col_scale[first + 1]] if columns > 1 else 0.0
    table = ws.coefficients
    return (
        table[lo, 0, 0] + table[lo, 0, 1] * e1 + table[lo, 0, 2] * e2,
        table[lo, 1, 0] + table[lo, 1, 1] * e1 + table[lo, 1, 2] * e2,
        complex(
            table[lo, REAL, 0] + table[lo, REAL, 1] * e1 + table[lo, REAL, 2] * e2,
            table[lo, IMAGINARY, 0] + table[lo, IMAGINARY, 1] * e1 + table[lo, IMAGINARY, 2] * e2,
        ),
    )


@inner
def _gap(w1, w2, size, q1, q2):
    """1 - q_1 w_11, 1 - q_2 w_22, det(I - Q W), and that times the diagonal of (W^-1 - Q)^-1.

    `size` is |w_12|^2.
    """
    left1, left2 = 1.0 - q1 * w1, 1.0 - q2 * w2
    left = left1 * left2 - q1 * q2 * size
    return left1, left2, left, w1 * left2 + q2 * size, w2 * left1 + q1 * size


@inner
def levels(factors, block, ws):
    """Fill in the inverse levels; returns det(I - Q_fixed W), 0 where that is not positive."""
    row0 = factors.row0
    free, fixed, inverse = ws.free, ws.fixed, ws.levels
    lo, hi = row0[block], row0[block + 1]
    w1, w2, w12 = _entries(factors, block, ws)
    size = square(w12)
    f1, f2 = fixed[lo], fixed[hi - 1] if hi - lo == 2 else 0.0
    left1, _, limit, own1, own2 = _gap(w1, w2, size, f1, f2)
    if not (limit > 0.0 and left1 > 0.0):
        return 0.0
    m1 = free[lo] * own1 / limit
    inverse[lo] = m1
    if hi - lo == 2:
        m2 = free[lo + 1] * own2 / limit
        m12 = free[lo] * free[lo + 1] * size / (limit * limit)
        half = 0.5 * (m1 - m2)
        inverse[lo] = 0.5 * (m1 + m2) + math.sqrt(half * half + m12)
        inverse[lo + 1] = (m1 * m2 - m12) / inverse[lo] if inverse[lo] > 0.0 else 0.0
    return limit


@inner
def derivatives(factors, block, level, ws):
    """Add the block's part to the gradient and the Hessian of h in (y, t).

    In five variables: the log scales of both rows, those of both columns, and t.
    """
    cols, p, row_scale, col_scale = factors.cols, factors.p, factors.row_scale, factors.col_scale
    row0, col0, all_free = factors.row0, factors.col0, factors.all_free
    free, fixed, x, x_inv = ws.free, ws.fixed, ws.x, ws.x_inverse
    g, H, first, second, variable = ws.gradient, ws.hessian, ws.first, ws.second, ws.variable
    lo, two = row0[block], row0[block + 1] - row0[block] == 2
    start, columns = col0[block], col0[block + 1] - col0[block]
    p_level = level if all_free else 1.0
    for i in range(4):
        variable[i] = -1
    variable[4] = g.size - 1
    t1 = free[lo] * level  # dQ_11/dt
    q1 = t1 + fixed[lo]
    t2 = q2 = y1 = y2 = e1 = e2 = 0.0
    a11 = a12 = a21 = a22 = 0j
    if row_scale[lo] >= 0:
        variable[0] = row_scale[lo]
        y1 = p_level * p[lo] * x[variable[0]]  # dQ_11/dy
    if two:
        t2 = free[lo + 1] * level
        q2 = t2 + fixed[lo + 1]
        if row_scale[lo + 1] >= 0:
            variable[1] = row_scale[lo + 1]
            y2 = p_level * p[lo + 1] * x[variable[1]]
    if columns > 0:
        variable[2] = col_scale[start]
        e1 = x_inv[variable[2]]
        a11 = cols[lo, 0]
        a21 = cols[lo + 1, 0] if two else 0j
    if columns > 1:
        variable[3] = col_scale[start + 1]
        e2 = x_inv[variable[3]]
        a12 = cols[lo, 1]
        a22 = cols[lo + 1, 1] if two else 0j
    w1, w2, w12 = _entries(factors, block, ws)
    size = square(w12)
    left1, left2, left, own1, own2 = _gap(w1, w2, size, q1, q2)
    over = 1.0 / left
    # (W^-1 - Q)^-1: its diagonal and the square of the other entry
    A1, A2 = own1 * over, own2 * over
    A12 = size * over * over
    # (I - W Q)^-1 a_j
    b11, b12 = (left2 * a11 + q2 * w12 * a21) * over, (left2 * a12 + q2 * w12 * a22) * over
    w21 = q1 * np.conj(w12)
    b21, b22 = (left1 * a21 + w21 * a11) * over, (left1 * a22 + w21 * a12) * over
    # a_k^H (Q^-1 - W)^-1 a_j
    s11 = e1 * (q1 * _inner_product(a11, b11) + q2 * _inner_product(a21, b21))
    s22 = e2 * (q1 * _inner_product(a12, b12) + q2 * _inner_product(a22, b22))
    s12 = square(q1 * np.conj(a11) * b12 + q2 * np.conj(a21) * b22)
    c11, c12, c21, c22 = square(b11) * e1, square(b12) * e2, square(b21) * e1, square(b22) * e2
    first[0], first[1], first[2], first[3] = A1 * y1, A2 * y2, -s11, -s22
    first[4] = A1 * t1 + A2 * t2
    second[0, 0], second[1, 1] = first[0] * (1.0 + first[0]), first[1] * (1.0 + first[1])
    second[2, 2], second[3, 3] = s11 * (1.0 + s11), s22 * (1.0 + s22)
    second[1, 0], second[3, 2] = A12 * y1 * y2, s12 * e1 * e2
    second[2, 0], second[3, 0] = -c11 * y1, -c12 * y1
    second[2, 1], second[3, 1] = -c21 * y2, -c22 * y2
    second[4, 0] = y1 * (A1 * A1 * t1 + A12 * t2 + (A1 if all_free else 0.0))
    second[4, 1] = y2 * (A2 * A2 * t2 + A12 * t1 + (A2 if all_free else 0.0))
    second[4, 2], second[4, 3] = -c11 * t1 - c21 * t2, -c12 * t1 - c22 * t2
    second[4, 4] = first[4] + A1 * A1 * t1 * t1 + A2 * A2 * t2 * t2 + 2.0 * A12 * t1 * t2
    for i in range(5):
        if variable[i] < 0:
            continue
        g[variable[i]] += first[i]
        for k in range(i + 1):
            if variable[k] < 0:
                continue
            H[variable[i], variable[k]] += second[i, k]
            if k < i:
                H[variable[k], variable[i]] += second[i, k]


@inner
def sensitivities(factors, block, level, ws, A, mixed):
    """Fill in the block's rows of `A` and `mixed`, as for `solver.mu.kernel.sensitivities`."""
    cols, row0 = factors.cols, factors.row0
    free, fixed = ws.free, ws.fixed
    lo, rows = row0[block], row0[block + 1] - row0[block]
    q1 = free[lo] * level + fixed[lo]
    q2 = free[lo + 1] * level + fixed[lo + 1] if rows > 1 else 0.0
    w1, w2, w12 = _entries(factors, block, ws)
    size = square(w12)
    _, _, left, own1, own2 = _gap(w1, w2, size, q1, q2)
    over = 1.0 / left
    A[lo] = own1 * over
    mixed[lo] = q1 * A[lo] * cols[lo, 0]
    if rows > 1:
        A[lo + 1] = own2 * over
        mixed[lo] += (q2 * over) * w12 * cols[lo + 1, 0]
        if cols.shape[1] > 1:
            mixed[lo + 1] = q2 * A[lo + 1] * cols[lo + 1, 1]
            mixed[lo + 1] += (q1 * over) * np.conj(w12) * cols[lo, 1]


@inner
def _inner_product(a, b):
    return a.real * b.real + a.imag * b.imag
