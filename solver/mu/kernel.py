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
meet (identical controllers). The derivatives of blocks of one or two rows, all that one or two
groups of any number of units have, are written out. The level reported is that of the final scales
themselves, without the barrier: a bound whatever the iteration did.
"""

import math

import numpy as np
from numba import njit

__all__ = ["COLD", "FINE", "balance", "compiled", "inner", "sensitivities", "solve", "workspace"]

compiled = njit(cache=True, error_model="numpy")
# Without reference counts, which cost more here than the arithmetic; such code allocates nothing.
inner = njit(cache=True, error_model="numpy", _nrt=False)

COLD = 1e-2  # first nu: the scales may still be far off
FINE = 1e-9  # last nu: the level is right to about nu times the multiplicity
CENTRED = 0.05  # squared Newton decrement below which nu may fall
CENTRED_AT_END = 1e-8  # and below which the dual, hence the gradient, is right to 1e-4 at a kink
MAX_ITERATIONS = 60
LARGEST_STEP = 2.0  # in log scale: Newton's model is not trusted further
TINY = 1e-300
EPSILON = 2.0**-53


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
        np.empty((rows, rows), z),  # 15 W_0
        np.empty((rows, 12)),  # 16 coefficients of small blocks, in their first rows
        np.empty(5),  # 17 first derivatives of a small block
        np.empty((5, 5)),  # 18 second derivatives
        np.empty(5, np.int64),  # 19 the variables they belong to
        np.empty(rows),  # 20 off-diagonal of a tridiagonal matrix
        np.empty(rows, z),  # 21 a vector of rows
        np.empty(rows, z),  # 22 another
    )


@inner
def solve(factors, y, nu, nu_end, ws):
    """Largest level over the scales, and the scales in `y` (start and result).

    Parameters
    ----------
    factors : tuple
        (cols, rest, p, b, row_scale, col_scale, row0, col0, all_free): the a_j (rows, columns of
        the widest block), the columns whose scale is 1 likewise (W_0 is the sum of their squares),
        p and b (rows,), scale of each row (-1: none) and column, first row and column of each block
        with the totals at the end, whether all of Q is free.
    y : (scales,)
        Log of the squared scales.
    nu, nu_end : float
        First and last barrier parameter.
    ws : tuple
        `workspace`. On return it holds what `sensitivities` needs.

    Returns
    -------
    t : float
        Log of the level; +inf where nothing limits it, -inf where Q_fixed alone violates the
        bound at the given scales.
    centre : float
        Inverse level of the barrier's own optimum, slightly above e^-t.

    """
    inverse_levels, step, trial = ws[9], ws[13], ws[14]
    _prepare(factors, ws)
    top, h = _inverse_levels(factors, y, ws)
    if top == math.inf:
        return -math.inf, top
    if top < TINY:
        return math.inf, top
    # Without a performance block a common factor of all scales is free: the last one stays.
    moving = y.size - 1
    for i in range(factors[3].size):
        if factors[3][i] > 0.0:
            moving = y.size
    steps_at_nu = 0
    centre = _centre(inverse_levels, top, nu)
    value = _value(inverse_levels, centre, h, nu)
    for _ in range(MAX_ITERATIONS):
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
                centre_trial = _centre(inverse_levels, top_trial, nu)
                new = _value(inverse_levels, centre_trial, h_trial, nu)
                if drop or new <= value - 0.1 * length * decrement + 1e-12 * abs(value):
                    break
            length *= 0.4
            if not length > 1e-8:  # rounding stops the descent: y is as good as it gets
                top, h = _inverse_levels(factors, y, ws)
                return -math.log(top), _centre(inverse_levels, top, nu)
        for s in range(y.size):
            y[s] = trial[s]
        top, centre, value = top_trial, centre_trial, new
    return -math.log(top), centre


@inner
def balance(factors, y, ws):
    """Start of `solve`: scales that nearly minimise tr Q W, by Osborne's sweeps."""
    cols, rest, p, b, row_scale, col_scale, row0, col0, _ = factors
    into, out = ws[2], ws[3]
    for _ in range(4):
        for s in range(y.size):
            into[s] = 0.0
            out[s] = 0.0
        for block in range(row0.size - 1):
            for i in range(row0[block], row0[block + 1]):
                s = row_scale[i]
                scaled = p[i] * math.exp(y[s]) if s >= 0 else 0.0
                w = 0.0
                for j in range(rest.shape[1]):
                    w += _square(rest[i, j])
                for j in range(col0[block], col0[block + 1]):
                    size = _square(cols[i, j - col0[block]])
                    w += size * math.exp(-y[col_scale[j]])
                    out[col_scale[j]] += (scaled + b[i]) * size
                if s >= 0:
                    into[s] += p[i] * w
        for s in range(y.size):
            if into[s] > TINY and out[s] > TINY:
                y[s] = 0.5 * math.log(out[s] / into[s])


@inner
def sensitivities(factors, centre, ws, A, mixed):
    """How h = -log det(I - Q W) answers to changes of the rows and columns, after `solve`.

    Fills A (rows,), dh/dQ_ii, and mixed (rows,) complex, (W B a_i)_i, half the gradient of h in
    the entry a_ii; returns dh/dt.
    """
    cols, row0 = factors[0], factors[6]
    free, fixed, W, WB = ws[0], ws[1], ws[4], ws[7]
    level = 1.0 / centre
    total = 0.0
    for block in range(row0.size - 1):
        lo, rows = row0[block], row0[block + 1] - row0[block]
        if rows <= 2:
            q1 = free[lo] * level + fixed[lo]
            q2 = free[lo + 1] * level + fixed[lo + 1] if rows > 1 else 0.0
            w1, w2, w12 = _small_w(factors, block, ws)
            square = _square(w12)
            left1, left2 = 1.0 - q1 * w1, 1.0 - q2 * w2
            over = 1.0 / (left1 * left2 - q1 * q2 * square)
            A[lo] = (w1 * left2 + q2 * square) * over
            mixed[lo] = q1 * A[lo] * cols[lo, 0]
            if rows > 1:
                A[lo + 1] = (w2 * left1 + q1 * square) * over
                mixed[lo] += (q2 * over) * w12 * cols[lo + 1, 0]
                if cols.shape[1] > 1:
                    mixed[lo + 1] = q2 * A[lo + 1] * cols[lo + 1, 1]
                    mixed[lo + 1] += (q1 * over) * np.conj(w12) * cols[lo, 1]
        else:
            _inverse_gap(lo, rows, level, ws)
            _times_gap(lo, rows, ws)
            for i in range(rows):
                v = W[lo + i, i].real
                z = 0j
                for m in range(rows):
                    v += (WB[lo + i, m] * W[lo + m, i]).real
                    if i < cols.shape[1]:
                        z += WB[lo + i, m] * cols[lo + m, i]
                A[lo + i], mixed[lo + i] = v, z
        for i in range(lo, lo + rows):
            total += A[i] * free[i] * level
    return total


@inner
def _prepare(factors, ws):
    """Work out what the scales leave alone: coefficients of small blocks, W_0 of the others."""
    cols, rest, _, _, _, _, row0, col0, _ = factors
    W0, K = ws[15], ws[16]
    for block in range(row0.size - 1):
        lo, rows = row0[block], row0[block + 1] - row0[block]
        columns = col0[block + 1] - col0[block]
        if rows > 2:
            for i in range(lo, lo + rows):
                for k in range(i - lo + 1):
                    v = 0j
                    for j in range(rest.shape[1]):
                        v += rest[i, j] * np.conj(rest[lo + k, j])
                    W0[i, k] = v
            continue
        for i in range(12):
            K[lo, i] = 0.0
        for i in range(rows):
            for j in range(rest.shape[1]):
                K[lo, 3 * i] += _square(rest[lo + i, j])
            for j in range(columns):
                K[lo, 3 * i + 1 + j] = _square(cols[lo + i, j])
        if rows > 1:
            for j in range(rest.shape[1]):
                v = rest[lo, j] * np.conj(rest[lo + 1, j])
                K[lo, 6] += v.real
                K[lo, 9] += v.imag
            for j in range(columns):
                v = cols[lo, j] * np.conj(cols[lo + 1, j])
                K[lo, 7 + j], K[lo, 10 + j] = v.real, v.imag


@inner
def _square(z):
    return z.real * z.real + z.imag * z.imag


@inner
def _small_w(factors, block, ws):
    """W_11, W_22 and W_12 of a block of one or two rows, at the scales in the workspace."""
    col_scale, row0, col0 = factors[5], factors[6], factors[7]
    x_inv, K = ws[3], ws[16]
    lo, first, columns = row0[block], col0[block], col0[block + 1] - col0[block]
    e1 = x_inv[col_scale[first]] if columns > 0 else 0.0
    e2 = x_inv[col_scale[first + 1]] if columns > 1 else 0.0
    return (
        K[lo, 0] + K[lo, 1] * e1 + K[lo, 2] * e2,
        K[lo, 3] + K[lo, 4] * e1 + K[lo, 5] * e2,
        complex(
            K[lo, 6] + K[lo, 7] * e1 + K[lo, 8] * e2, K[lo, 9] + K[lo, 10] * e1 + K[lo, 11] * e2
        ),
    )


@inner
def _inverse_levels(factors, y, ws):
    """Q, W, and the eigenvalues l of the pencil Q_free - l (W^-1 - Q_fixed); largest l and h_0.

    Infinite where W^-1 - Q_fixed is not positive.
    """
    cols, _, p, b, row_scale, col_scale, row0, col0, all_free = factors
    free, fixed, x, x_inv, W, levels, W0 = ws[0], ws[1], ws[2], ws[3], ws[4], ws[9], ws[15]
    for s in range(y.size):
        x[s] = math.exp(y[s])
        x_inv[s] = 1.0 / x[s]
    top, h0, left = 0.0, 0.0, 1.0
    for block in range(row0.size - 1):
        lo, hi = row0[block], row0[block + 1]
        first, columns = col0[block], col0[block + 1] - col0[block]
        for i in range(lo, hi):
            scaled = p[i] * x[row_scale[i]] if row_scale[i] >= 0 else 0.0
            free[i] = b[i] + (scaled if all_free else 0.0)
            fixed[i] = 0.0 if all_free else scaled
        if hi - lo <= 2:
            w1, w2, w12 = _small_w(factors, block, ws)
            square = _square(w12)
            f1, f2 = fixed[lo], fixed[hi - 1] if hi - lo == 2 else 0.0
            left1, left2 = 1.0 - f1 * w1, 1.0 - f2 * w2
            limit = left1 * left2 - f1 * f2 * square
            if not (limit > 0.0 and left1 > 0.0):
                return math.inf, h0
            left *= limit
            m1 = free[lo] * (w1 * left2 + f2 * square) / limit
            levels[lo] = m1
            if hi - lo == 2:
                m2 = free[lo + 1] * (w2 * left1 + f1 * square) / limit
                m12 = free[lo] * free[lo + 1] * square / (limit * limit)
                half = 0.5 * (m1 - m2)
                levels[lo] = 0.5 * (m1 + m2) + math.sqrt(half * half + m12)
                levels[lo + 1] = (m1 * m2 - m12) / levels[lo] if levels[lo] > 0.0 else 0.0
        else:
            for i in range(lo, hi):
                for k in range(lo, i + 1):
                    w = W0[i, k - lo]
                    for j in range(columns):
                        w += cols[i, j] * np.conj(cols[k, j]) * x_inv[col_scale[first + j]]
                    W[i, k - lo] = w
                    W[k, i - lo] = np.conj(w)
            log_left = _pencil(lo, hi, ws)
            if log_left == -math.inf:
                return math.inf, h0
            h0 -= log_left
        for i in range(lo, hi):
            top = max(top, levels[i])
    return top, h0 if all_free else h0 - math.log(left)


@inner
def _pencil(lo, hi, ws):
    """Inverse levels of one block of three or more rows; log det(I - Q_fixed W) or -inf.

    They are the eigenvalues of Q_free (W^-1 - Q_fixed)^-1, where
    (W^-1 - Q_fixed)^-1 = W + W Q_fixed^1/2 (I - Q_fixed^1/2 W Q_fixed^1/2)^-1 Q_fixed^1/2 W
    needs no inverse of W, which may be singular.
    """
    free, fixed, W, F, Z, limited = ws[0], ws[1], ws[4], ws[5], ws[6], ws[7]
    n = hi - lo
    log_left = 0.0
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
                        return -math.inf
                    log_left += math.log(v.real)
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
    return log_left


@inner
def _eigenvalues(M, n, lo, ws):
    """Eigenvalues of the Hermitian M (its lower triangle, which is lost), to the levels from `lo`.

    Householder's tridiagonal form, then QL with implicit shifts; LAPACK would need allocations.
    """
    d, e, v, w = ws[9], ws[20], ws[21], ws[22]
    for k in range(n - 1):
        size = 0.0
        for i in range(k + 1, n):
            size += _square(M[i, k])
        norm = math.sqrt(size)
        d[lo + k] = M[k, k].real
        e[k] = norm
        head = math.sqrt(_square(M[k + 1, k]))
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
        for _ in range(MAX_ITERATIONS):
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


@inner
def _value(levels, centre, h0, nu):
    """Return h - t/nu at the centred level: what Newton's method in y makes small."""
    product = 1.0
    for i in range(levels.size):
        product *= 1.0 - levels[i] / centre
    return h0 + math.log(centre) / nu - math.log(product)


@inner
def _derivatives(factors, ws, level):
    """Gradient and Hessian of h in (y, t)."""
    g, H, row0 = ws[10], ws[11], factors[6]
    for i in range(g.size):
        g[i] = 0.0
        for k in range(g.size):
            H[i, k] = 0.0
    for block in range(row0.size - 1):
        if row0[block + 1] - row0[block] <= 2:
            _small_derivatives(factors, block, level, ws)
        else:
            _block_derivatives(factors, block, level, ws)


@inner
def _small_derivatives(factors, block, level, ws):
    """Those of a block of one or two rows, written out.

    In five variables: the log scales of both rows, those of both columns, and t.
    """
    cols, _, p, _, row_scale, col_scale, row0, col0, all_free = factors
    free, fixed, x, x_inv = ws[0], ws[1], ws[2], ws[3]
    g, H, first, second, variable = ws[10], ws[11], ws[17], ws[18], ws[19]
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
    w1, w2, w12 = _small_w(factors, block, ws)
    square = _square(w12)
    left1, left2 = 1.0 - q1 * w1, 1.0 - q2 * w2
    over = 1.0 / (left1 * left2 - q1 * q2 * square)
    # (W^-1 - Q)^-1: its diagonal and the square of the other entry
    A1, A2 = (w1 * left2 + q2 * square) * over, (w2 * left1 + q1 * square) * over
    A12 = square * over * over
    # (I - W Q)^-1 a_j
    b11, b12 = (left2 * a11 + q2 * w12 * a21) * over, (left2 * a12 + q2 * w12 * a22) * over
    w21 = q1 * np.conj(w12)
    b21, b22 = (left1 * a21 + w21 * a11) * over, (left1 * a22 + w21 * a12) * over
    # a_k^H (Q^-1 - W)^-1 a_j
    s11 = e1 * (q1 * _inner_product(a11, b11) + q2 * _inner_product(a21, b21))
    s22 = e2 * (q1 * _inner_product(a12, b12) + q2 * _inner_product(a22, b22))
    s12 = _square(q1 * np.conj(a11) * b12 + q2 * np.conj(a21) * b22)
    c11, c12, c21, c22 = _square(b11) * e1, _square(b12) * e2, _square(b21) * e1, _square(b22) * e2
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
def _inner_product(a, b):
    return a.real * b.real + a.imag * b.imag


@inner
def _block_derivatives(factors, block, level, ws):
    """Those of a larger block."""
    cols, _, p, _, row_scale, col_scale, row0, col0, all_free = factors
    free, x, x_inv, W, B, WB, Ba = ws[0], ws[2], ws[3], ws[4], ws[6], ws[7], ws[8]
    g, H = ws[10], ws[11]
    p_level = level if all_free else 1.0
    T = g.size - 1
    lo, first = row0[block], col0[block]
    rows, columns = row0[block + 1] - lo, col0[block + 1] - first
    _inverse_gap(lo, rows, level, ws)
    _times_gap(lo, rows, ws)
    for i in range(rows):
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
            e = _square(v)
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
            e = _square(v) * x_inv[sj]
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
            e = _square(v) * (x_inv[sj] * x_inv[sk])
            if k == j:
                a = v.real * x_inv[sj]
                g[sj] -= a
                H[sj, sj] += a + e
            else:
                H[sj, sk] += e
                H[sk, sj] += e


@inner
def _times_gap(lo, rows, ws):
    """Product W B of one block."""
    W, B, WB = ws[4], ws[6], ws[7]
    for i in range(rows):
        for k in range(rows):
            v = 0j
            for m in range(rows):
                v += W[lo + i, m] * B[lo + m, k]
            WB[lo + i, k] = v


@inner
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


@inner
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
