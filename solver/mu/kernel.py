r"""Compiled kernel: the best D-scaling at one frequency, by a barrier method in log scales.

At one frequency the loop is a factored matrix N = L R, split into independent blocks that share
their D-scales (`solver.model.blocks`). With x = exp(y) the squared scales, every block has

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
in y. For a simple eigenvalue it is quadratic at any nu, so the last nu is tried at once; where its
step fails, as where eigenvalues meet, nu is followed down. The derivatives of blocks of one or two
rows, all that one or two groups of any number of units have, are written out. The level reported is
that of the final scales themselves, without the barrier: a bound whatever the iteration did.
"""

import math

from solver.mu import large_block, small_block
from solver.mu.workspace import TINY, inner, square

__all__ = ["FINE", "balance", "centred_level", "sensitivities", "solve"]

FINE = 1e-9  # usual nu: the level is right to about nu times the multiplicity
MEETING = 1e-4  # nu from which eigenvalues that meet are followed down
FALL = 0.01  # of nu, when it falls
CENTRED = 0.05  # squared Newton decrement below which nu may fall
CENTRED_AT_END = 1e-4  # and below which one last step squares it: the dual is right to 1e-4 then
CONVERGED = 1e-12  # error of log level, foretold by quadratic convergence, at which to end early
NEAR = 0.3  # if the step in log scale is no longer than that,
AGREEMENT = 0.01  # if the value fell as the model said to this share,
APART = 1e-4  # and the eigenvalues are relatively that far apart
MAX_ITERATIONS = 60
LARGEST_STEP = 2.0  # in log scale: Newton's model is not trusted further
SHORTER = 0.4  # a step whose value does not fall is tried again with this length,
SHORT = 0.3  # down to this one without a barrier,
SHORTEST = 1e-8  # and to this one with it


@inner
def solve(factors, y, nu, ws):
    """Largest level over the scales, and the scales in `y` (start and result).

    Parameters
    ----------
    factors : Factors
        The loop.
    y : (scales,)
        Log of the squared scales.
    nu : float
        Last barrier parameter.
    ws : Workspace
        On return it holds what `sensitivities` needs.

    Returns
    -------
    t : float
        Log of the level; +inf where nothing limits it, -inf where Q_fixed alone violates the
        bound at the given scales.
    centre : float
        Inverse level of the barrier's own optimum, slightly above e^-t.

    """
    inverse_levels, step, trial = ws.levels, ws.step, ws.trial
    row0 = factors.row0
    for block in range(row0.size - 1):
        if row0[block + 1] - row0[block] <= 2:
            small_block.prepare(factors, block, ws)
        else:
            large_block.prepare(factors, block, ws)
    top, h = _inverse_levels(factors, y, ws)
    if top == math.inf:
        return -math.inf, top
    if top < TINY:
        return math.inf, top
    # Without a performance block a common factor of all scales is free: the last one stays.
    moving = y.size - 1
    for i in range(factors.b.size):
        if factors.b[i] > 0.0:
            moving = y.size
    last_nu, following, before = nu, False, TINY  # the squared decrement before
    centre = centred_level(inverse_levels, top, nu)
    value = _value(inverse_levels, centre, h, nu)
    for _ in range(MAX_ITERATIONS):
        _derivatives(factors, ws, 1.0 / centre)
        decrement = _newton_step(ws, nu, moving)
        centred = nu == last_nu and decrement < CENTRED_AT_END
        falling = nu > last_nu and decrement < CENTRED
        if falling:
            nu = max(last_nu, FALL * nu)
        longest = 0.0
        for s in range(y.size):
            longest = max(longest, abs(step[s]))
        length = min(1.0, LARGEST_STEP / longest)
        accepted = False
        while not accepted and length > (SHORTEST if following else SHORT):
            for s in range(y.size):
                trial[s] = y[s] + length * step[s]
            new_top, h = _inverse_levels(factors, trial, ws)
            if new_top < math.inf:
                new_centre = centred_level(inverse_levels, new_top, nu)
                new = _value(inverse_levels, new_centre, h, nu)
                enough = 0.1 * length * decrement - 1e-12 * abs(value)
                accepted = falling or value - new >= enough
            if not accepted:
                length *= SHORTER
        if not accepted:
            top, h = _inverse_levels(factors, y, ws)
            if following:  # rounding stops the descent: y is as good as it gets
                centre = centred_level(inverse_levels, top, nu)
                break
            # Newton's model without a barrier fails: eigenvalues meet, or y is far off.
            following, nu = True, max(nu, MEETING)
            centre = centred_level(inverse_levels, top, nu)
            value = _value(inverse_levels, centre, h, nu)
            continue
        for s in range(y.size):
            y[s] = trial[s]
        agrees = not falling and abs(2.0 * (value - new) - decrement) < AGREEMENT * decrement
        top, centre, value = new_top, new_centre, new
        others = 1.0 - nu * top / (centre - top)  # share of the dual; nu over their distance
        apart = others < min(0.1, nu / APART)
        ratio = decrement / before
        before = decrement if length == 1.0 else TINY  # only whole steps converge quadratically
        converged = nu == last_nu and nu * decrement * ratio * ratio < CONVERGED
        if length == 1.0 and (centred or (converged and longest < NEAR and agrees and apart)):
            break
    return -math.log(top), centre


@inner
def balance(factors, y, ws):
    """Start of `solve`: scales that nearly minimise tr Q W, by Osborne's sweeps.

    Where the level of the rows b is sought, Q has them at what they permit without uncertainty:
    within an integrating loop that may be 1e30 times what they are.
    """
    cols, rest, row0, col0 = factors.cols, factors.rest, factors.row0, factors.col0
    row_scale, col_scale, p, b = factors.row_scale, factors.col_scale, factors.p, factors.b
    into, out = ws.x, ws.x_inverse
    level = 1.0
    if not factors.all_free:
        total = 0.0
        for i in range(b.size):
            for j in range(rest.shape[1]):
                total += b[i] * square(rest[i, j])
        if total > TINY:
            level = 1.0 / total
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
                    w += square(rest[i, j])
                for j in range(col0[block], col0[block + 1]):
                    size = square(cols[i, j - col0[block]])
                    w += size * math.exp(-y[col_scale[j]])
                    out[col_scale[j]] += (scaled + level * b[i]) * size
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
    row0, free = factors.row0, ws.free
    level = 1.0 / centre
    total = 0.0
    for block in range(row0.size - 1):
        lo, rows = row0[block], row0[block + 1] - row0[block]
        if rows <= 2:
            small_block.sensitivities(factors, block, level, ws, A, mixed)
        else:
            large_block.sensitivities(factors, block, level, ws, A, mixed)
        for i in range(lo, lo + rows):
            total += A[i] * free[i] * level
    return total


@inner
def _inverse_levels(factors, y, ws):
    """Q, W, and the eigenvalues l of the pencil Q_free - l (W^-1 - Q_fixed); largest l and h_0.

    Infinite where W^-1 - Q_fixed is not positive.
    """
    p, b, row_scale, row0 = factors.p, factors.b, factors.row_scale, factors.row0
    free, fixed, x, all_free = ws.free, ws.fixed, ws.x, factors.all_free
    for s in range(y.size):
        x[s] = math.exp(y[s])
        ws.x_inverse[s] = 1.0 / x[s]
    top, left = 0.0, 1.0
    for block in range(row0.size - 1):
        lo, hi = row0[block], row0[block + 1]
        for i in range(lo, hi):
            scaled = p[i] * x[row_scale[i]] if row_scale[i] >= 0 else 0.0
            free[i] = b[i] + (scaled if all_free else 0.0)
            fixed[i] = 0.0 if all_free else scaled
        if hi - lo <= 2:
            limit = small_block.levels(factors, block, ws)
        else:
            limit = large_block.levels(factors, block, ws)
        if not limit > 0.0:
            return math.inf, 0.0
        left *= limit
        for i in range(lo, hi):
            top = max(top, ws.levels[i])
    return top, 0.0 if all_free else -math.log(left)


@inner
def centred_level(levels, top, nu):
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
    g, H, row0 = ws.gradient, ws.hessian, factors.row0
    for i in range(g.size):
        g[i] = 0.0
        for k in range(g.size):
            H[i, k] = 0.0
    for block in range(row0.size - 1):
        if row0[block + 1] - row0[block] <= 2:
            small_block.derivatives(factors, block, level, ws)
        else:
            large_block.derivatives(factors, block, level, ws)


@inner
def _newton_step(ws, nu, moving):
    """Newton step in y with the level eliminated; returns the squared decrement.

    The scales from `moving` on stay as they are.
    """
    g, H, L, step = ws.gradient, ws.hessian, ws.hessian_factor, ws.step
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
