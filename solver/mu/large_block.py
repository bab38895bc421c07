"""Blocks of three rows and more, by triangular factors."""

import math

import numpy as np

from solver.mu.workspace import inner, square

__all__ = ["derivatives", "levels", "prepare", "sensitivities"]

EPSILON = 2.0**-53
MOST_TURNS = 60  # of the QL method, an eigenvalue; it takes two or three


@inner
def prepare(factors, block, ws):
    """Work out what the scales leave alone: W_0."""
    rest, row0, W0 = factors.rest, factors.row0, ws.W_0
    lo, rows = row0[block], row0[block + 1] - row0[block]
    for i in range(lo, lo + rows):
        for k in range(i - lo + 1):
            v = 0j
            for j in range(rest.shape[1]):
                v += rest[i, j] * np.conj(rest[lo + k, j])
            W0[i, k] = v


@inner
def levels(factors, block, ws):
    """Fill in W and the inverse levels; returns det(I - Q_fixed W), 0 if that is not positive."""
    cols, col_scale, row0, col0 = factors.cols, factors.col_scale, factors.row0, factors.col0
    x_inv, W, W0 = ws.x_inverse, ws.W, ws.W_0
    lo, hi = row0[block], row0[block + 1]
    first, columns = col0[block], col0[block + 1] - col0[block]
    for i in range(lo, hi):
        for k in range(lo, i + 1):
            w = W0[i, k - lo]
            for j in range(columns):
                w += cols[i, j] * np.conj(cols[k, j]) * x_inv[col_scale[first + j]]
            W[i, k - lo] = w
            W[k, i - lo] = np.conj(w)
    return _pencil(lo, hi, ws)


@inner
def _pencil(lo, hi, ws):
    """Inverse levels of one block of three or more rows; det(I - Q_fixed W), or 0.

    They are the eigenvalues of Q_free (W^-1 - Q_fixed)^-1, where
    (W^-1 - Q_fixed)^-1 = W + W Q_fixed^1/2 (I - Q_fixed^1/2 W Q_fixed^1/2)^-1 Q_fixed^1/2 W
    needs no inverse of W, which may be singular.
    """
    free, fixed, W, F, Z, limited = ws.free, ws.fixed, ws.W, ws.factor, ws.gap, ws.W_gap
    n = hi - lo
    left = 1.0
    some_fixed = False
    for i in range(n):
        some_fixed |= fixed[lo + i] > 0.0
        for k in range(i + 1):
            limited[i, k] = W[lo + i, k]
    if some_fixed:
        for i in range(n):  # I - Q_fixed^1/2 W Q_fixed^1/2 = F F^H
            for k in range(i + 1):
                v = -math.sqrt(fixed[lo + i] * fixed[lo + k]) * W[lo + i, k]
                if i == k:
                    v += 1.0
                for m in range(k):
                    v -= F[i, m] * np.conj(F[k, m])
                if i == k:
                    if not v.real > 0.0:
                        return 0.0
                    left *= v.real
                    F[i, i] = math.sqrt(v.real)
                else:
                    F[i, k] = v * (1.0 / F[k, k].real)
        for k in range(n):  # Z = F^-1 Q_fixed^1/2 W, its transpose for the sake of the memory
            for i in range(n):
                v = math.sqrt(fixed[lo + i]) * W[lo + i, k]
                for m in range(i):
                    v -= F[i, m] * Z[k, m]
                Z[k, i] = v * (1.0 / F[i, i].real)
        for i in range(n):
            for k in range(i + 1):
                for m in range(n):
                    limited[i, k] += np.conj(Z[i, m]) * Z[k, m]
    for i in range(n):
        for k in range(i + 1):
            limited[i, k] *= math.sqrt(free[lo + i] * free[lo + k])
    _eigenvalues(limited, n, lo, ws)
    return left


@inner
def _eigenvalues(M, n, lo, ws):
    """Eigenvalues of the Hermitian M (its lower triangle, which is lost), to the levels from `lo`.

    Householder's tridiagonal form, then QL with implicit shifts; LAPACK would need allocations.
    """
    d, e, v, w = ws.levels, ws.off_diagonal, ws.reflector, ws.image
    for k in range(n - 1):
        size = 0.0
        for i in range(k + 1, n):
            size += square(M[i, k])
        norm = math.sqrt(size)
        d[lo + k] = M[k, k].real
        e[k] = norm
        head = math.sqrt(square(M[k + 1, k]))
        if k == n - 2 or head == norm:
            continue
        # v = x + phase |x| e_1 reflects the column x onto e_1.
        for i in range(k + 1, n):
            v[i] = M[i, k]
        v[k + 1] += norm * (M[k + 1, k] / head if head > 0.0 else 1.0)
        scale = 1.0 / (size + head * norm)
        along = 0.0
        for i in range(k + 1, n):
            z = 0j
            for m in range(k + 1, i + 1):
                z += M[i, m] * v[m]
            for m in range(i + 1, n):
                z += np.conj(M[m, i]) * v[m]
            w[i] = scale * z
            along += v[i].real * w[i].real + v[i].imag * w[i].imag
        for i in range(k + 1, n):
            w[i] -= 0.5 * scale * along * v[i]
            for m in range(k + 1, i + 1):
                M[i, m] -= v[i] * np.conj(w[m]) + w[i] * np.conj(v[m])
    d[lo + n - 1] = M[n - 1, n - 1].real
    e[n - 1] = 0.0
    for first in range(n):
        for _ in range(MOST_TURNS):
            last = first
            while last < n - 1 and not (
                abs(e[last]) <= EPSILON * (abs(d[lo + last]) + abs(d[lo + last + 1]))
            ):
                last += 1
            if last == first:
                break
            g = (d[lo + first + 1] - d[lo + first]) / (2.0 * e[first])
            r = math.sqrt(g * g + 1.0)
            g = d[lo + last] - d[lo + first] + e[first] / (g + (r if g >= 0.0 else -r))
            s, c, shift = 1.0, 1.0, 0.0
            for i in range(last - 1, first - 1, -1):
                f, b = s * e[i], c * e[i]
                r = math.sqrt(f * f + g * g)
                e[i + 1] = r
                if r == 0.0:
                    d[lo + i + 1] -= shift
                    e[last] = 0.0
                    break
                s, c = f / r, g / r
                g = d[lo + i + 1] - shift
                r = (d[lo + i] - g) * s + 2.0 * c * b
                shift = s * r
                d[lo + i + 1] = g + shift
                g = c * r - b
            else:
                d[lo + first] -= shift
                e[first] = g
                e[last] = 0.0


@inner
def derivatives(factors, block, level, ws):
    """Add the block's part to the gradient and the Hessian of h in (y, t)."""
    cols, p, row_scale, col_scale = factors.cols, factors.p, factors.row_scale, factors.col_scale
    free, x, x_inv, all_free = ws.free, ws.x, ws.x_inverse, factors.all_free
    W, B, WB, Ba, g, H = ws.W, ws.gap, ws.W_gap, ws.gap_a, ws.gradient, ws.hessian
    p_level = level if all_free else 1.0
    T = g.size - 1
    lo, first = factors.row0[block], factors.col0[block]
    rows, columns = factors.row0[block + 1] - lo, factors.col0[block + 1] - first
    _inverse_gap(lo, rows, level, ws)
    _multiply(W, B, lo, rows, rows, WB)
    _multiply(B, cols, lo, rows, columns, Ba)
    # Elementary changes: of Q in row i (weight A), of W in column j (weight B), and both.
    for i in range(rows):
        si = row_scale[lo + i]
        qy_i = p_level * p[lo + i] * x[si] if si >= 0 else 0.0
        qt_i = free[lo + i] * level
        for k in range(i + 1):
            v = W[lo + i, k]
            for m in range(rows):
                v += WB[lo + i, m] * W[lo + m, k]
            e = square(v)
            if k == i:
                g[T] += v.real * qt_i
                H[T, T] += v.real * qt_i + e * qt_i * qt_i
                if si >= 0:
                    g[si] += v.real * qy_i
                    H[si, si] += v.real * qy_i + e * qy_i * qy_i
                    H[T, si] += e * qt_i * qy_i + (v.real * qy_i if all_free else 0.0)
                continue
            sk = row_scale[lo + k]
            qy_k = p_level * p[lo + k] * x[sk] if sk >= 0 else 0.0
            qt_k = free[lo + k] * level
            H[T, T] += 2.0 * e * qt_i * qt_k
            if sk >= 0:
                H[T, sk] += e * qt_i * qy_k
            if si >= 0:
                H[T, si] += e * qy_i * qt_k
                if sk >= 0:
                    H[si, sk] += e * qy_i * qy_k
                    H[sk, si] += e * qy_i * qy_k
        for j in range(columns):
            v = cols[lo + i, j]
            for m in range(rows):
                v += WB[lo + i, m] * cols[lo + m, j]
            sj = col_scale[first + j]
            e = square(v) * x_inv[sj]
            H[T, sj] -= e * qt_i
            if si >= 0:
                H[si, sj] -= e * qy_i
                H[sj, si] -= e * qy_i
    for j in range(columns):
        sj = col_scale[first + j]
        for k in range(j + 1):
            sk = col_scale[first + k]
            v = 0j
            for m in range(rows):
                v += np.conj(cols[lo + m, k]) * Ba[lo + m, j]
            e = square(v) * (x_inv[sj] * x_inv[sk])
            if k == j:
                a = v.real * x_inv[sj]
                g[sj] -= a
                H[sj, sj] += a + e
            else:
                H[sj, sk] += e
                H[sk, sj] += e


@inner
def sensitivities(factors, block, level, ws, A, mixed):
    """Fill in the block's rows of `A` and `mixed`, as for `solver.mu.kernel.sensitivities`."""
    cols, row0 = factors.cols, factors.row0
    W, B, WB = ws.W, ws.gap, ws.W_gap
    lo, rows = row0[block], row0[block + 1] - row0[block]
    _inverse_gap(lo, rows, level, ws)
    _multiply(W, B, lo, rows, rows, WB)
    for i in range(rows):
        v = W[lo + i, i].real
        z = 0j
        for m in range(rows):
            v += (WB[lo + i, m] * W[lo + m, i]).real
            if i < cols.shape[1]:
                z += WB[lo + i, m] * cols[lo + m, i]
        A[lo + i], mixed[lo + i] = v, z


@inner
def _multiply(left, right, lo, rows, columns, out):
    """Product of two matrices of one block, its square left one first."""
    for i in range(rows):
        for j in range(columns):
            v = 0j
            for m in range(rows):
                v += left[lo + i, m] * right[lo + m, j]
            out[lo + i, j] = v


@inner
def _inverse_gap(lo, rows, level, ws):
    """B = (Q^-1 - W)^-1 of one block, by the Cholesky factor of I - Q^1/2 W Q^1/2."""
    free, fixed, W, L, B = ws.free, ws.fixed, ws.W, ws.factor, ws.gap
    for i in range(rows):
        q_i = free[lo + i] * level + fixed[lo + i]
        for k in range(i + 1):
            q_k = free[lo + k] * level + fixed[lo + k]
            v = -math.sqrt(q_i * q_k) * W[lo + i, k]
            if i == k:
                v += 1.0
            for m in range(k):
                v -= L[lo + i, m] * np.conj(L[lo + k, m])
            if i == k:
                L[lo + i, i] = math.sqrt(max(v.real, 1e-16))  # the centre keeps it above nu / rows
            else:
                L[lo + i, k] = v * (1.0 / L[lo + k, k].real)
    for k in range(rows):
        L[lo + k, k] = 1.0 / L[lo + k, k].real
        for i in range(k + 1, rows):
            v = 0j
            for m in range(k, i):
                v -= L[lo + i, m] * L[lo + m, k]
            L[lo + i, k] = v * (1.0 / L[lo + i, i].real)
    for i in range(rows):
        q_i = free[lo + i] * level + fixed[lo + i]
        for k in range(i + 1):
            v = 0j
            for m in range(i, rows):
                v += np.conj(L[lo + m, i]) * L[lo + m, k]
            v *= math.sqrt(q_i * (free[lo + k] * level + fixed[lo + k]))
            B[lo + i, k] = v
            B[lo + k, i] = np.conj(v)
