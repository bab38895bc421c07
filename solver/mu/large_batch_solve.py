"""Compiled: the best scales of eight frequencies at once, for blocks of any size.

The method of `solver.mu.kernel`, each lane in a state of its own: where a step is tried again with
a shorter length, or the barrier parameter followed down, the other lanes wait or go on. What is
written there in W, B and their products stands here in

    M = I - Q^1/2 W Q^1/2,   T = M^-1 Q^1/2 A X^-1/2,   V = (Q^1/2 A X^-1/2)^H T,

with (W^-1 - Q)^-1 = Q^-1/2 (M^-1 - I) Q^-1/2: half the products. Its diagonal loses digits only
where a row does not matter to the barrier.
"""

from solver.mu.batch import conjugate_sum, pair, product_sum, put, scaled, square
from solver.mu.kernel import (
    AGREEMENT,
    APART,
    CENTRED,
    CENTRED_AT_END,
    CONVERGED,
    FALL,
    LARGEST_STEP,
    MEETING,
    NEAR,
    SHORT,
    SHORTER,
    SHORTEST,
)
from solver.mu.lanes import (
    any_of,
    exp,
    fill,
    load,
    log,
    magnitude,
    maximum,
    minimum,
    pick,
    root,
    store,
)
from solver.mu.large_batch_levels import centred, evaluate, inverted
from solver.mu.workspace import TINY, inner

__all__ = ["balance", "solve"]

MOST_STEPS = 8  # most frequencies take three;
MOST_PATIENT_STEPS = 80  # those that need a longer way go it together
LARGEST_SCALE = 600.0  # of |y|: exp(y) is exact and its products are finite
HUGE = 1e300


@inner
def balance(layout, widest, work, all_free):
    """As `solver.mu.kernel.balance`."""
    scales, first = layout.scales, layout.first
    b, y = load(work.b, 0), work.y
    if not all_free:
        total = fill(0.0)
        for block in range(first.size - 1):
            for i in range(first[block + 1] - first[block]):
                total += load(work.W_0, 2 * ((first[block] + i) * widest + i))
        b = pick(total > TINY, 1.0 / total, b)
    for s in range(y.shape[0]):
        store(y, s, fill(0.0))
    for _ in range(4):
        for s in range(y.shape[0]):
            store(work.x, s, exp(load(y, s)))
            store(work.x_inverse, s, exp(-load(y, s)))
            store(work.step, s, fill(0.0))  # what goes into a row, and out of a column
            store(work.trial, s, fill(0.0))
        for block in range(first.size - 1):
            lo, size = first[block], first[block + 1] - first[block]
            for i in range(size):
                own = scales[lo + i]
                p = load(work.p, lo + i)
                q = p * load(work.x, own) + b
                w = load(work.W_0, 2 * ((lo + i) * widest + i))
                for j in range(size):
                    s = scales[lo + j]
                    coefficient = square(pair(work.SG, (lo + i) * widest + j))
                    w += coefficient * load(work.x_inverse, s)
                    store(work.trial, s, load(work.trial, s) + q * coefficient)
                store(work.step, own, load(work.step, own) + p * w)
        for s in range(y.shape[0]):
            into, out = load(work.step, s), load(work.trial, s)
            usable = (into > TINY) & (out > TINY) & (into < HUGE) & (out < HUGE)
            balanced = 0.5 * log(pick(usable, out / into, fill(1.0)))
            store(y, s, pick(usable, balanced, load(y, s)))


@inner
def solve(layout, widest, work, all_free, nu, patient):
    """Best scales of the eight frequencies from those in `work`; `failed` where none were found.

    Impatient, it leaves those alone that take no steady way.
    """
    scales = work.y.shape[0]
    failed = load(work.failed, 0) > 0.5
    last_nu, nus = fill(nu), fill(nu)
    following = fill(0.0) > 1.0
    opening, active, shorter, stale = ~following, ~failed, following, following
    falling = following
    value, before, decrement = fill(0.0), fill(TINY), fill(0.0)
    length, longest, top, centre = fill(0.0), fill(0.0), fill(0.0), fill(1.0)
    for s in range(scales):
        store(work.step, s, fill(0.0))
    for turn in range(MOST_PATIENT_STEPS if patient else MOST_STEPS):
        if turn > 0:
            _derivatives(layout, widest, work, 1.0 / centre, all_free)
            new = active & ~opening & ~shorter
            decrement = pick(new, _newton_step(work, new, nus), decrement)
            falling = (falling & ~new) | (new & (nus > last_nu) & (decrement < CENTRED))
            nus = pick(new & falling, maximum(last_nu, FALL * nus), nus)
            longest = fill(0.0)
            for s in range(scales):
                longest = maximum(longest, magnitude(load(work.step, s)))
            whole = minimum(LARGEST_STEP / maximum(longest, fill(TINY)), fill(1.0))
            length = pick(new, whole, pick(active & shorter, length, fill(0.0)))
        for s in range(scales):
            store(work.trial, s, load(work.y, s) + length * load(work.step, s))
        left = evaluate(layout, widest, work, all_free)
        top, centre, product = centred(work, nus)
        level = log(centre) / nus - log(product * left)
        sound = (left > 0.0) & (top > TINY) & (top < HUGE)
        failed = failed | (active & opening & ~sound)
        fall = value - level
        enough = fall >= 0.1 * length * decrement - 1e-12 * magnitude(value)
        good = active & sound & (opening | falling | enough)
        for s in range(scales):
            store(work.y, s, pick(good, load(work.trial, s), load(work.y, s)))
        if turn > 0:
            agrees = ~falling & (magnitude(2.0 * fall - decrement) < AGREEMENT * decrement)
            others = 1.0 - nus * top / (centre - top)
            apart = others < minimum(fill(0.1), nus * (1.0 / APART))
            ratio = decrement / before
            at_end = nus <= last_nu
            steady = (nus * decrement * ratio * ratio < CONVERGED) & (longest < NEAR)
            ended = (decrement < CENTRED_AT_END) | (steady & agrees & apart)
            ended = ended & good & ~opening & ~falling & at_end & (length >= 1.0)
            # Only whole steps converge quadratically.
            taken = pick(length >= 1.0, decrement, fill(TINY))
            before = pick(good & ~opening, taken, before)
        else:
            ended = following
        value = pick(good, level, value)
        bad = active & ~good & ~opening
        if not patient:
            failed = failed | bad
            active = active & good & ~ended & ~failed
            opening = following
        else:
            length = pick(bad, length * SHORTER, length)
            out = bad & ~(length > pick(following, fill(SHORTEST), fill(SHORT)))
            stopped = out & following  # rounding stops the descent: y is as good as it gets
            stale = stale | stopped
            opening = out & ~following  # eigenvalues meet, or y is far off: with a barrier
            nus = pick(opening, maximum(nus, fill(MEETING)), nus)
            following = following | opening
            shorter = bad & ~out
            active = active & ~ended & ~stopped & ~failed
        if not any_of(active):
            break
    failed = failed | active
    if any_of(stale):
        for s in range(scales):
            store(work.trial, s, load(work.y, s))
        left = evaluate(layout, widest, work, all_free)
        top, centre, _ = centred(work, nus)
    for s in range(scales):
        failed = failed | ~(magnitude(load(work.y, s)) < LARGEST_SCALE)
    store(work.level, 0, top)
    store(work.centre, 0, centre)
    store(work.failed, 0, pick(failed, fill(1.0), fill(0.0)))


@inner
def _derivatives(layout, widest, work, level, all_free):
    """Gradient and Hessian of h in (y, t), the lower triangle."""
    scales, first, g, H = layout.scales, layout.first, work.gradient, work.hessian
    size = g.shape[0]
    T = size - 1
    for i in range(size):
        store(g, i, fill(0.0))
        for k in range(i + 1):
            store(H, i * size + k, fill(0.0))
    gradient_t, bend_t = fill(0.0), fill(0.0)
    zero = fill(0.0), fill(0.0)
    for block in range(first.size - 1):
        lo, n = first[block], first[block + 1] - first[block]
        inverted(layout, block, widest, work, level, all_free)
        _images(scales, lo, n, widest, work)
        R, image, A = work.inverse, work.image, work.scaled
        for i in range(n):
            si, y_i, t_i = scales[lo + i], load(work.share_y, i), load(work.share_t, i)
            z = load(R, 2 * (i * n + i)) - 1.0
            gradient_t += z * t_i
            bend_t += z * t_i + z * z * t_i * t_i
            own, mixed = z * y_i, z * z * t_i * y_i
            store(g, si, load(g, si) + own)
            _add(H, size, si, si, 0.5 * (own + own * own))
            if all_free:
                mixed += own
            for k in range(i):
                sk, y_k, t_k = scales[lo + k], load(work.share_y, k), load(work.share_t, k)
                e = square(pair(R, i * n + k))
                bend_t += 2.0 * e * t_i * t_k
                mixed += e * y_i * t_k
                _add(H, size, T, sk, e * t_i * y_k)
                _add(H, size, si, sk, e * y_i * y_k)
            for j in range(n):
                sj = scales[lo + j]
                e = square(pair(image, i * n + j))
                _add(H, size, T, sj, -e * t_i)
                _add(H, size, si, sj, -e * y_i)
            _add(H, size, T, si, mixed)
        for j in range(n):
            sj = scales[lo + j]
            for k in range(j + 1):
                v = conjugate_sum(zero, A, k, n, image, j, n, n)
                if k == j:
                    store(g, sj, load(g, sj) - v[0])
                    _add(H, size, sj, sj, 0.5 * (v[0] + square(v)))
                else:
                    _add(H, size, sj, scales[lo + k], square(v))
    store(g, T, gradient_t)
    store(H, T * size + T, bend_t)


@inner
def _images(scales, lo, n, widest, work):
    """Fill in Q^1/2 A X^-1/2 of one block, as `scaled`, and M^-1 times it, as `image`."""
    R, image, A = work.inverse, work.image, work.scaled
    zero = fill(0.0), fill(0.0)
    for j in range(n):
        e = root(load(work.x_inverse, scales[lo + j]))
        for i in range(n):
            size = load(work.roots, i) * e
            put(A, i * n + j, scaled(pair(work.SG, (lo + i) * widest + j), size))
    for i in range(n):
        for j in range(n):
            v = product_sum(zero, R, i * n, 1, A, j, n, i + 1)
            v = conjugate_sum(v, R, (i + 1) * n + i, n, A, (i + 1) * n + j, n, n - 1 - i)
            put(image, i * n + j, v)


@inner
def _add(H, size, i, k, change):
    """Add to both entries (i, k) and (k, i), of which the lower one is kept."""
    place = max(i, k) * size + min(i, k)
    store(H, place, load(H, place) + (2.0 * change if i == k else change))


@inner
def _newton_step(work, new, nus):
    """Newton step in y with the level eliminated, where `new`; returns the squared decrement."""
    g, H, step = work.gradient, work.hessian, work.trial
    size = g.shape[0]
    n = size - 1
    over_t = 1.0 / load(H, n * size + n)
    decrement = fill(0.0)
    for i in range(n):
        mixed = load(H, n * size + i) * over_t
        least = load(H, i * size + i) + 1.0 / nus
        for k in range(i + 1):
            v = load(H, i * size + k) - mixed * load(H, n * size + k)
            if i == k:
                # Scales that nothing connects are free; this keeps them where they are.
                v += 1e-12 * least
            for m in range(k):
                v -= load(H, i * size + m) * load(H, k * size + m)
            if i == k:
                v = pick(v > 1e-13 * least, v, least)
                store(H, i * size + i, 1.0 / root(v))
            else:
                store(H, i * size + k, v * load(H, k * size + k))
        v = -load(g, i)
        for m in range(i):
            v -= load(H, i * size + m) * load(step, m)
        v = v * load(H, i * size + i)
        store(step, i, v)
        decrement += v * v
    for back in range(n):
        i = n - 1 - back
        v = load(step, i)
        for m in range(i + 1, n):
            v -= load(H, m * size + i) * load(step, m)
        store(step, i, v * load(H, i * size + i))
    for i in range(n):
        store(work.step, i, pick(new, load(step, i), load(work.step, i)))
    return decrement
