r"""Compiled kernel: the best D-scaling at one frequency, by a barrier method in log scales.

At one frequency the loop is a factored matrix N = L R, split into independent blocks that share
their D-scales (`solver.blocks`). With x = exp(y) the squared scales, every block has

    Q = diag(p_i x_s(i) + b_i),     W = W_0 + sum_j a_j a_j^H / x_s(j)

and sigma_max(D N D^-1) <= 1 reads lambda_max(Q W) <= 1. Split Q = Q_fixed + Q_free and ask for the
largest level e^t with  Q_fixed + e^t Q_free  still satisfying it. All of Q free: e^-t is the square
of the upper bound of mu itself. Only the b_i free: e^t is the largest |w_P|^2 that the
uncertainty permits (skewed mu).

tr (Q W)^k is a squared Schatten norm of exp(diag) N exp(-diag), hence log-convex in (y, t) by the
three lines theorem, so h = -log det(I - Q W) is jointly convex and

    maximise  t - nu h(y, t),   nu -> 0

is a smooth convex problem. The level t is eliminated exactly: with the inverse levels l_i (the
eigenvalues of the pencil) it solves  sum l_i/(e^-t - l_i) = 1/nu.  What is left is Newton's method
in y, which is quadratic for a simple eigenvalue at any nu and follows nu down where eigenvalues
meet (identical controllers). The level reported is that of the final scales themselves, without
the barrier: a bound whatever the iteration did.
"""

import math

import numpy as np
from numba import njit

__all__ = ["COLD", "FINE", "balance", "compiled", "solve", "workspace"]

compiled = njit(cache=True, error_model="numpy")

COLD = 1e-2  # first nu: the scales may still be far off
FINE = 1e-9  # last nu: the level is right to about nu times the multiplicity
CENTRED = 0.05  # squared Newton decrement below which nu may fall
CENTRED_AT_END = 1e-8  # and below which the dual, hence the gradient, is right to 1e-4 at a kink
MAX_ITERATIONS = 60
LARGEST_STEP = 2.0  # in log scale: Newton's model is not trusted further
TINY = 1e-300


@compiled
def workspace(rows, columns, scales):
    """Scratch arrays of one solve; a tuple, since compiled code knows no records."""
    size = scales + 1
    z = np.complex128
    return (
        np.empty(rows),  # 0 Q_free
        np.empty(rows),  # 1 Q_fixed
        np.empty(scales),  # 2 x
        np.empty(scales),  # 3 1 / x
        np.empty((rows, rows), z),  # 4 W, a block in its rows, columns from 0
        np.empty((rows, rows), z),  # 5 triangular factor
        np.empty((rows, rows), z),  # 6 B = (Q^-1 - W)^-1
        np.empty((rows, rows), z),  # 7 W B
        np.empty((rows, columns), z),  # 8 B a_j
        np.empty(rows),  # 9 inverse levels
        np.empty(size),  # 10 gradient of h in (y, t)
        np.empty((size, size)),  # 11 its Hessian
        np.empty((size, size)),  # 12 factor of the Hessian
        np.empty(size),  # 13 step in y
        np.empty(scales),  # 14 trial y
        np.empty(rows),  # 15 diagonal of A = (W^-1 - Q)^-1
        np.empty(rows, z),  # 16 (W B a_i)_i
    )


@compiled
def solve(factors, y, nu, nu_end, ws):
    """Largest level over the scales, and the scales in `y` (start and result).

    Parameters
    ----------
    factors : tuple
        (cols, W0, p, b, row_scale, col_scale, row0, col0, all_free): the a_j (rows, columns of the
        widest block), W_0 likewise, p and b (rows,), scale of each row (-1: none) and column,
        first row and column of each block with the totals at the end, whether all of Q is free.
    y : (scales,)
        Log of the squared scales.
    nu, nu_end : float
        First and last barrier parameter.
    ws : tuple
        `workspace`. On return it holds the derivatives at the optimum.

    Returns
    -------
    t : float
        Log of the level; +inf where nothing limits it, -inf where Q_fixed alone violates the
        bound at the given scales.

    """
    inverse_levels, step, trial = ws[9], ws[13], ws[14]
    top, h = _inverse_levels(factors, y, ws)
    if top == math.inf:
        return -math.inf
    if top < TINY:
        return math.inf
    # Without a performance block a common factor of all scales is free: the last one stays.
    moving = y.size - 1
    for i in range(factors[3].size):
        if factors[3][i] > 0.0:
            moving = y.size
    steps_at_nu = 0
    for _ in range(MAX_ITERATIONS):
        centre = _centre(inverse_levels, top, nu)
        value = _value(inverse_levels, centre, h, nu)
        _derivatives(factors, ws, 1.0 / centre)
        decrement = _newton_step(ws, nu, moving)
        if nu <= nu_end and decrement < CENTRED_AT_END:
            break
        drop = decrement < CENTRED and nu > nu_end
        if drop:
            # A quick centring means a smooth optimum: go far at once, else tenfold.
            nu = max(nu_end, nu * (1e-4 if steps_at_nu <= 2 else 0.1))
            steps_at_nu = 0
        else:
            steps_at_nu += 1
        longest = 0.0
        for s in range(y.size):
            longest = max(longest, abs(step[s]))
        length = 1.0 if longest <= LARGEST_STEP else LARGEST_STEP / longest
        while True:
            for s in range(y.size):
                trial[s] = y[s] + length * step[s]
            top_trial, h_trial = _inverse_levels(factors, trial, ws)
            if top_trial < math.inf:
                if drop:
                    break
                new = _value(inverse_levels, _centre(inverse_levels, top_trial, nu), h_trial, nu)
                if new <= value - 0.1 * length * decrement + 1e-12 * abs(value):
                    break
            length *= 0.4
            if not length > 1e-8:  # rounding stops the descent: y is as good as it gets
                top, h = _inverse_levels(factors, y, ws)
                _derivatives(factors, ws, 1.0 / _centre(inverse_levels, top, nu))
                return -math.log(top)
        for s in range(y.size):
            y[s] = trial[s]
        top, h = top_trial, h_trial
    return -math.log(top)


@compiled
def balance(factors, y):
    """Start of `solve`: scales that nearly minimise tr Q W, by Osborne's sweeps."""
    cols, W0, p, b, row_scale, col_scale, row0, col0, _ = factors
    into = np.empty(y.size)
    out = np.empty(y.size)
    for _ in range(4):
        into[:] = 0.0
        out[:] = 0.0
        for block in range(row0.size - 1):
            for i in range(row0[block], row0[block + 1]):
                s = row_scale[i]
                scaled = p[i] * math.exp(y[s]) if s >= 0 else 0.0
                w = W0[i, i - row0[block]].real
                for j in range(col0[block], col0[block + 1]):
                    a = cols[i, j - col0[block]]
                    size = a.real * a.real + a.imag * a.imag
                    w += size * math.exp(-y[col_scale[j]])
                    out[col_scale[j]] += (scaled + b[i]) * size
                if s >= 0:
                    into[s] += p[i] * w
        for s in range(y.size):
            if into[s] > TINY and out[s] > TINY:
                y[s] = 0.5 * math.log(out[s] / into[s])


@compiled
def _inverse_levels(factors, y, ws):
    """W, Q, and the eigenvalues l of the pencil Q_free - l (W^-1 - Q_fixed); largest l and h_0.

    Infinite where W^-1 - Q_fixed is not positive.
    """
    cols, W0, p, b, row_scale, col_scale, row0, col0, all_free = factors
    free, fixed, x, x_inv, W, levels = ws[0], ws[1], ws[2], ws[3], ws[4], ws[9]
    for s in range(y.size):
        x[s] = math.exp(y[s])
        x_inv[s] = 1.0 / x[s]
    h0 = 0.0
    for block in range(row0.size - 1):
        lo, hi = row0[block], row0[block + 1]
        first = col0[block]
        for i in range(lo, hi):
            scaled = p[i] * x[row_scale[i]] if row_scale[i] >= 0 else 0.0
            free[i] = b[i] + (scaled if all_free else 0.0)
            fixed[i] = 0.0 if all_free else scaled
            for k in range(lo, i + 1):
                w = W0[i, k - lo]
                for j in range(first, col0[block + 1]):
                    w += cols[i, j - first] * np.conj(cols[k, j - first]) * x_inv[col_scale[j]]
                W[i, k - lo] = w
                W[k, i - lo] = np.conj(w)
        if hi - lo == 1:
            w = W[lo, 0].real
            left = 1.0 - fixed[lo] * w
            if not left > 0.0:
                return math.inf, h0
            levels[lo] = free[lo] * w / left
            h0 -= math.log(left)
        elif hi - lo == 2:
            w1, w2 = W[lo, 0].real, W[lo + 1, 1].real
            det = w1 * w2 - (W[lo, 1].real ** 2 + W[lo, 1].imag ** 2)
            f1, f2, q1, q2 = fixed[lo], fixed[lo + 1], free[lo], free[lo + 1]
            left = 1.0 - f1 * w1 - f2 * w2 + f1 * f2 * det
            if not (left > 0.0 and f1 * w1 < 1.0):
                return math.inf, h0
            trace = (q1 * (w1 - f2 * det) + q2 * (w2 - f1 * det)) / left
            product = q1 * q2 * det / left
            levels[lo] = 0.5 * (trace + math.sqrt(max(trace * trace - 4.0 * product, 0.0)))
            levels[lo + 1] = product / levels[lo] if levels[lo] > 0.0 else 0.0
            h0 -= math.log(left)
        else:
            log_left = _pencil(lo, hi, ws)
            if log_left == -math.inf:
                return math.inf, h0
            h0 -= log_left
    top = 0.0
    for i in range(levels.size):
        top = max(top, levels[i])
    return top, h0


@compiled
def _pencil(lo, hi, ws):
    """Inverse levels of one block of three or more rows; log det(I - Q_fixed W) or -inf.

    They are the eigenvalues of Q_free (W^-1 - Q_fixed)^-1, where
    (W^-1 - Q_fixed)^-1 = W + W Q_fixed^1/2 (I - Q_fixed^1/2 W Q_fixed^1/2)^-1 Q_fixed^1/2 W
    needs no inverse of W, which may be singular.
    """
    free, fixed, W, F, levels = ws[0], ws[1], ws[4], ws[5], ws[9]
    n = hi - lo
    log_left = 0.0
    some_fixed = False
    for i in range(n):
        some_fixed |= fixed[lo + i] > 0.0
    limited = W[lo:hi, :n].copy()
    if some_fixed:
        for i in range(n):  # I - Q_fixed^1/2 W Q_fixed^1/2 = F F^H
            for k in range(i + 1):
                v = -math.sqrt(fixed[lo + i] * fixed[lo + k]) * W[lo + i, k]
                if i == k:
                    v += 1.0
                for m in range(k):
                    v -= F[lo + i, m] * np.conj(F[lo + k, m])
                if i == k:
                    if not v.real > 0.0:
                        return -math.inf
                    log_left += math.log(v.real)
                    F[lo + i, i] = math.sqrt(v.real)
                else:
                    F[lo + i, k] = v * (1.0 / F[lo + k, k].real)
        Z = np.empty((n, n), np.complex128)  # F^-1 Q_fixed^1/2 W
        for k in range(n):
            for i in range(n):
                v = math.sqrt(fixed[lo + i]) * W[lo + i, k]
                for m in range(i):
                    v -= F[lo + i, m] * Z[m, k]
                Z[i, k] = v * (1.0 / F[lo + i, i].real)
        for i in range(n):
            for k in range(n):
                for m in range(n):
                    limited[i, k] += np.conj(Z[m, i]) * Z[m, k]
    for i in range(n):
        for k in range(n):
            limited[i, k] *= math.sqrt(free[lo + i] * free[lo + k])
    levels[lo:hi] = np.linalg.eigvalsh(limited)
    return log_left


@compiled
def _centre(levels, top, nu):
    """Return L = e^-t with sum l_i/(L - l_i) = 1/nu.

    The harmonic form 1/sum is concave and increasing in L, so Newton from the left never leaves
    the interval; with one eigenvalue its first step is exact.
    """
    centre = top * (1.0 + nu)
    for _ in range(MAX_ITERATIONS):
        total, slope = 0.0, 0.0
        for i in range(levels.size):
            term = levels[i] / (centre - levels[i])
            total += term
            slope += term / (centre - levels[i])
        move = (nu * total - 1.0) * total / slope
        centre += move
        if not abs(move) > 1e-4 * (centre - top):
            break
    return centre


@compiled
def _value(levels, centre, h0, nu):
    """Return h - t/nu at the centred level: what Newton's method in y makes small."""
    value = h0 + math.log(centre) / nu
    for i in range(levels.size):
        value -= math.log(1.0 - levels[i] / centre)
    return value


@compiled
def _derivatives(factors, ws, level):
    """Gradient and Hessian of h in (y, t); the Hessian's last column is left unset."""
    cols, _, p, _, row_scale, col_scale, row0, col0, all_free = factors
    free, x, x_inv, W, B, WB, Ba = ws[0], ws[2], ws[3], ws[4], ws[6], ws[7], ws[8]
    g, H, A_diagonal, mixed = ws[10], ws[11], ws[15], ws[16]
    p_level = level if all_free else 1.0
    T = g.size - 1
    g[:] = 0.0
    H[:, :] = 0.0
    for block in range(row0.size - 1):
        lo, first = row0[block], col0[block]
        rows, columns = row0[block + 1] - lo, col0[block + 1] - first
        _inverse_gap(lo, rows, level, ws)
        for i in range(rows):
            for k in range(rows):
                v = 0j
                for m in range(rows):
                    v += W[lo + i, m] * B[lo + m, k]
                WB[lo + i, k] = v
            for j in range(columns):
                v = 0j
                for m in range(rows):
                    v += B[lo + i, m] * cols[lo + m, j]
                Ba[lo + i, j] = v
        # Elementary changes: of Q in row i (weight A), of W in column j (weight B), and both.
        for i in range(rows):
            si = row_scale[lo + i]
            qy_i = p_level * p[lo + i] * x[si] if si >= 0 else 0.0
            qt_i = free[lo + i] * level
            for k in range(i + 1):
                v = W[lo + i, k]
                for m in range(rows):
                    v += WB[lo + i, m] * W[lo + m, k]
                e = v.real * v.real + v.imag * v.imag
                if k == i:
                    A_diagonal[lo + i] = v.real
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
                v = 0j
                for m in range(rows):
                    v += WB[lo + i, m] * cols[lo + m, j]
                if i == j:
                    mixed[lo + i] = v
                v += cols[lo + i, j]
                sj = col_scale[first + j]
                e = (v.real * v.real + v.imag * v.imag) * x_inv[sj]
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
                e = (v.real * v.real + v.imag * v.imag) * (x_inv[sj] * x_inv[sk])
                if k == j:
                    a = v.real * x_inv[sj]
                    g[sj] -= a
                    H[sj, sj] += a + e
                else:
                    H[sj, sk] += e
                    H[sk, sj] += e


@compiled
def _inverse_gap(lo, rows, level, ws):
    """B = (Q^-1 - W)^-1 of one block, by the Cholesky factor of I - Q^1/2 W Q^1/2."""
    free, fixed, W, L, B = ws[0], ws[1], ws[4], ws[5], ws[6]
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


@compiled
def _newton_step(ws, nu, moving):
    """Newton step in y with the level eliminated; returns the squared decrement.

    The scales from `moving` on stay as they are.
    """
    g, H, L, step = ws[10], ws[11], ws[12], ws[13]
    n = g.size - 1
    decrement = 0.0
    step[moving:] = 0.0
    for i in range(moving):
        for k in range(i + 1):
            v = H[i, k] - H[n, i] * H[n, k] / H[n, n]
            if i == k:
                # Scales that nothing connects are free; this keeps them where they are.
                v += 1e-12 * (H[i, i] + 1.0 / nu)
            for m in range(k):
                v -= L[i, m] * L[k, m]
            if i == k:
                if not v > 1e-13 * (H[i, i] + 1.0 / nu):
                    v = H[i, i] + 1.0 / nu  # lost to rounding: a short step along the gradient
                L[i, i] = math.sqrt(v)
            else:
                L[i, k] = v / L[k, k]
        v = -g[i]
        for m in range(i):
            v -= L[i, m] * step[m]
        step[i] = v / L[i, i]
        decrement += step[i] * step[i]
    for i in range(moving - 1, -1, -1):
        v = step[i]
        for m in range(i + 1, moving):
            v -= L[m, i] * step[m]
        step[i] = v / L[i, i]
    return decrement
