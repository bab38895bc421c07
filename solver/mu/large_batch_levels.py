"""Compiled: the inverse levels of a loop with blocks of any size, at eight frequencies.

As in `solver.mu.large_block`, but no eigenvalue is sought beside the largest: of the tridiagonal
form T the factors of L - T, delta_i = L - d_i - e^2/delta_(i-1), all positive above it, tell
sum 1/(L - l_i) and its slope, sums of positive terms. From above Laguerre's method is monotone.
"""

from solver.mu.batch import (
    conjugate_sum,
    conjugate_times,
    pair,
    plus,
    product_sum,
    put,
    scaled,
    square,
    times,
)
from solver.mu.kernel import MAX_ITERATIONS
from solver.mu.lanes import any_of, exp, fill, load, magnitude, maximum, minimum, pick, root, store
from solver.mu.workspace import TINY, inner

__all__ = ["centred", "evaluate", "inverted"]

MOST_TURNS = 40  # of Laguerre's method: it takes five, more where eigenvalues nearly meet
EXACT = 1e-12  # of its step, after which the next one would be its cube
ABOVE = 1e-3  # of the first bound, which may be the eigenvalue itself
LEAST_PIVOT = 1e-16  # the centre keeps it above nu / rows


@inner
def evaluate(layout, widest, work, all_free):
    """W and the tridiagonal form of the inverse levels at `trial`; det(I - Q_fixed W), 0: none."""
    scales, first = layout.scales, layout.first
    b, off = load(work.b, 0), work.off_diagonal
    for s in range(work.trial.shape[0]):
        x = exp(load(work.trial, s))
        store(work.x, s, x)
        store(work.x_inverse, s, 1.0 / x)
    left, possible = fill(1.0), fill(1.0)
    for block in range(first.size - 1):
        lo, n = first[block], first[block + 1] - first[block]
        _fill_entries(scales, lo, n, widest, work)
        W, C = work.W, work.scaled
        if all_free:
            for i in range(n):
                q = load(work.p, lo + i) * load(work.x, scales[lo + i]) + b
                store(work.roots, i, root(q))
                for k in range(i + 1):
                    size = load(work.roots, i) * load(work.roots, k)
                    put(C, i * n + k, scaled(pair(W, (lo + i) * widest + k), size))
        else:
            own, least = _limited(scales, lo, n, widest, work, b)
            left *= own
            possible = minimum(possible, least)
        _tridiagonal(C, n, lo, work)
        store(off, lo + n - 1, fill(0.0))
    return pick(possible > 0.0, left, fill(0.0))


@inner
def _fill_entries(scales, lo, n, widest, work):
    """W of one block, its lower triangle."""
    A, W, row = work.SG, work.W, work.reflector
    for i in range(n):
        for j in range(n):
            e = load(work.x_inverse, scales[lo + j])
            put(row, j, scaled(pair(A, (lo + i) * widest + j), e))
        for k in range(i + 1):
            place = (lo + i) * widest + k
            start = pair(work.W_0, place)
            put(W, place, conjugate_sum(start, A, (lo + k) * widest, 1, row, 0, 1, n))


@inner
def _limited(scales, lo, n, widest, work, b):
    """Fill in b (W^-1 - Q_fixed)^-1, as `scaled`; det(I - Q_fixed W) and its least pivot."""
    W, F, Z, C = work.W, work.factor, work.image, work.scaled
    left, least = fill(1.0), fill(1.0)
    for i in range(n):
        store(work.roots, i, root(load(work.p, lo + i) * load(work.x, scales[lo + i])))
    for i in range(n):  # I - Q_fixed^1/2 W Q_fixed^1/2 = F F^H
        for k in range(i):
            _fill_factor(lo, i, k, n, widest, work)
        pivot = 1.0 - _reduced(lo, i, i, n, widest, work)[0]
        least = minimum(pivot, least)
        left *= pivot
        put(F, i * n + i, (1.0 / root(pick(pivot > 0.0, pivot, fill(1.0))), fill(0.0)))
    for k in range(n):  # Z = F^-1 Q_fixed^1/2 W, its transpose
        for i in range(n):
            w = pair(W, (lo + max(i, k)) * widest + min(i, k))
            r = load(work.roots, i)
            start = -r * w[0], (-r if i >= k else r) * w[1]
            v = product_sum(start, Z, k * n, 1, F, i * n, 1, i)
            put(Z, k * n + i, scaled(v, -load(F, 2 * (i * n + i))))
    for i in range(n):
        for k in range(i + 1):
            start = pair(W, (lo + i) * widest + k)
            put(C, i * n + k, scaled(conjugate_sum(start, Z, i * n, 1, Z, k * n, 1, n), b))
    return left, least


@inner
def _reduced(lo, i, k, n, widest, work):
    """Entry of Q^1/2 W Q^1/2 plus that of L L^H as far as L is known: I - Q^1/2 W Q^1/2 = L L^H."""
    L = work.factor
    w = pair(work.W, (lo + i) * widest + k)
    start = scaled(w, load(work.roots, i) * load(work.roots, k))
    return conjugate_sum(start, L, k * n, 1, L, i * n, 1, k)


@inner
def _fill_factor(lo, i, k, n, widest, work):
    """Fill in an entry below the diagonal of L, of which one over the diagonal is kept."""
    L = work.factor
    put(L, i * n + k, scaled(_reduced(lo, i, k, n, widest, work), -load(L, 2 * (k * n + k))))


@inner
def _tridiagonal(C, n, lo, work):
    """Householder's tridiagonal form of the Hermitian C (its lower triangle, which is lost)."""
    v, w = work.reflector, work.mirrored
    zero = fill(0.0), fill(0.0)
    for k in range(n - 1):
        size = fill(0.0)
        for i in range(k + 1, n):
            size += square(pair(C, i * n + k))
        norm = root(size)
        store(work.diagonal, lo + k, load(C, 2 * (k * n + k)))
        store(work.off_diagonal, lo + k, norm)
        if k == n - 2:
            continue
        # v = x + phase |x| e_1 reflects the column x onto e_1.
        for i in range(k + 1, n):
            put(v, i, pair(C, i * n + k))
        x = pair(C, (k + 1) * n + k)
        head = root(square(x))
        some = head > TINY
        over = norm / pick(some, head, fill(1.0))
        phase = pick(some, x[0] * over, norm), pick(some, x[1] * over, fill(0.0))
        put(v, k + 1, plus(x, phase))
        total = size + head * norm
        scale = pick(total > TINY, 1.0 / total, fill(0.0))
        along = fill(0.0)
        for i in range(k + 1, n):
            image = product_sum(zero, C, i * n + k + 1, 1, v, k + 1, 1, i - k)
            image = conjugate_sum(image, C, (i + 1) * n + i, n, v, i + 1, 1, n - 1 - i)
            z = scaled(image, scale)
            put(w, i, z)
            along += conjugate_times(pair(v, i), z)[0]
        along = -0.5 * scale * along
        for i in range(k + 1, n):
            own = pair(v, i)
            put(w, i, plus(pair(w, i), scaled(own, along)))
            image = pair(w, i)
            for m in range(k + 1, i + 1):
                change = plus(conjugate_times(pair(w, m), own), conjugate_times(pair(v, m), image))
                old = pair(C, i * n + m)
                put(C, i * n + m, (old[0] - change[0], old[1] - change[1]))
    store(work.diagonal, lo + n - 1, load(C, 2 * (n * n - 1)))


@inner
def _sums(work, L):
    """Return sums of 1/(L - l) and of its square, the product of 1 - l/L, the least factor."""
    over_L = 1.0 / L
    first, second, product, least = fill(0.0), fill(0.0), fill(1.0), L
    over, slope, bend, before = fill(0.0), fill(0.0), fill(0.0), fill(0.0)
    for i in range(work.diagonal.shape[0]):
        off = before * over  # e / delta
        ratio = off * off
        # of delta, by L; the bend is positive with its sign changed
        bend = ratio * (2.0 * over * slope * slope + bend)
        slope = 1.0 + ratio * slope
        delta = L - load(work.diagonal, i) - before * off
        over = 1.0 / delta
        first += slope * over
        second += slope * slope * (over * over) + bend * over
        product *= delta * over_L
        least = minimum(delta, least)
        before = load(work.off_diagonal, i)
    return first, second, product, least


@inner
def centred(work, nu):
    """Largest inverse level, that of the barrier's optimum, and the product of 1 - l/L there."""
    rows = work.diagonal.shape[0]
    bound, before = fill(0.0), fill(0.0)
    for i in range(rows):
        off = load(work.off_diagonal, i)
        bound = maximum(load(work.diagonal, i) + (before + off), bound)
        before = off
    top = bound * (1.0 + ABOVE)
    active = top > TINY
    count = fill(1.0 * rows)
    for _ in range(MOST_TURNS):
        first, second, _, least = _sums(work, top)
        spread = maximum((count - 1.0) * (count * second - first * first), fill(0.0))
        move = count / (first + root(spread))
        active = active & (least > 0.0)  # else rounding has passed it
        top = pick(active, top - move, top)
        active = active & (move > EXACT * top)
        if not any_of(active):
            break
    centre, product = top * (1.0 + nu), fill(1.0)
    active = top > TINY
    for _ in range(MAX_ITERATIONS):
        first, second, here, _ = _sums(work, centre)
        product = pick(active, here, product)
        total = centre * first - count
        move = (nu * total - 1.0) * total / (centre * second - first)
        active = active & (magnitude(move) > 1e-4 * (centre - top))
        if not any_of(active):
            break
        centre = pick(active, centre + move, centre)
    return top, centre, product


@inner
def inverted(layout, block, widest, work, level, all_free):
    """M^-1 of one block, M = I - Q^1/2 W Q^1/2, its lower triangle, and what Q consists of."""
    scales, b = layout.scales, load(work.b, 0)
    lo, n = layout.first[block], layout.first[block + 1] - layout.first[block]
    L, R = work.factor, work.inverse
    for i in range(n):
        scaled_p = load(work.p, lo + i) * load(work.x, scales[lo + i])
        moving = scaled_p * level if all_free else scaled_p
        free = (scaled_p + b) * level if all_free else b * level
        q = free if all_free else scaled_p + free
        over = 1.0 / q
        store(work.roots, i, root(q))
        store(work.share_y, i, moving * over)
        store(work.share_t, i, free * over)
    for i in range(n):  # M = L L^H
        for k in range(i):
            _fill_factor(lo, i, k, n, widest, work)
        pivot = maximum(1.0 - _reduced(lo, i, i, n, widest, work)[0], fill(LEAST_PIVOT))
        put(L, i * n + i, (1.0 / root(pivot), fill(0.0)))
    zero = fill(0.0), fill(0.0)
    for k in range(n):
        for i in range(k + 1, n):
            v = zero
            for m in range(k, i):
                v = plus(v, times(pair(L, i * n + m), pair(L, m * n + k)))
            put(L, i * n + k, scaled(v, -load(L, 2 * (i * n + i))))
    for i in range(n):
        for k in range(i + 1):
            put(R, i * n + k, conjugate_sum(zero, L, i * n + i, n, L, i * n + k, n, n - i))
