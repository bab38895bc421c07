"""Compiled: the best scales of eight frequencies at once.

The method of `solver.mu.kernel` for blocks of one or two rows and at most two scales, without its
branches: the last barrier parameter from the first step on, and no step tried again. A frequency
that needs more than that (eigenvalues that meet, a step after which the value has not fallen
enough, a level that nothing limits or that nothing permits) is left to the kernel itself, and said
to be.
"""

from solver.mu.batch import ENTRIES, TABLE, conjugate_times, pair, plus, scaled, square, times
from solver.mu.kernel import (
    AGREEMENT,
    APART,
    CENTRED_AT_END,
    CONVERGED,
    LARGEST_STEP,
    MAX_ITERATIONS,
    NEAR,
    SHORT,
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
from solver.mu.workspace import TINY, inner

__all__ = ["balance", "solve"]

MOST_STEPS = 12  # most frequencies take three; the kernel has better means for what takes longer
LARGEST_SCALE = 600.0  # of |y|: exp(y) is exact and its products are finite
HUGE = 1e300


@inner
def balance(layout, work, all_free):
    """As `solver.mu.kernel.balance`."""
    scales, first = layout.scales, layout.first
    b, y = load(work.b, 0), work.y
    if not all_free:
        total = fill(0.0)
        for block in range(first.size - 1):
            for i in range(first[block + 1] - first[block]):
                total += load(work.table, TABLE * block + 3 * i)
        b = pick(total > TINY, 1.0 / total, b)
    for s in range(y.shape[0]):
        store(y, s, fill(0.0))
    for _ in range(4):
        for s in range(y.shape[0]):
            store(work.x, s, exp(load(y, s)))
            store(work.x_inverse, s, exp(-load(y, s)))
        for s in range(y.shape[0]):
            into, out = fill(0.0), fill(0.0)
            for block in range(first.size - 1):
                lo, at = first[block], TABLE * block
                size = first[block + 1] - lo
                for i in range(size):
                    row = at + 3 * i
                    p, own = load(work.p, lo + i), scales[lo + i]
                    q, w = p * load(work.x, own) + b, load(work.table, row)
                    for j in range(size):
                        coefficient = load(work.table, row + 1 + j)
                        w += coefficient * load(work.x_inverse, scales[lo + j])
                        if scales[lo + j] == s:
                            out += q * coefficient
                    if own == s:
                        into += p * w
            usable = (into > TINY) & (out > TINY) & (into < HUGE) & (out < HUGE)
            balanced = 0.5 * log(pick(usable, out / into, fill(1.0)))
            store(y, s, pick(usable, balanced, load(y, s)))


@inner
def _evaluate(layout, work, all_free):
    """W and the inverse levels at y; the largest, and det(I - Q_fixed W), not positive: none."""
    scales, first, table, W = layout.scales, layout.first, work.table, work.W
    b = load(work.b, 0)
    for s in range(work.y.shape[0]):
        x = exp(load(work.y, s))
        store(work.x, s, x)
        store(work.x_inverse, s, 1.0 / x)
    top, left, possible = fill(0.0), fill(1.0), fill(1.0)
    for block in range(first.size - 1):
        lo, at, here = first[block], TABLE * block, ENTRIES * block
        q1 = load(work.p, lo) * load(work.x, scales[lo])
        e1 = load(work.x_inverse, scales[lo])
        w1 = load(table, at) + load(table, at + 1) * e1
        free1, fixed1 = (q1 + b, fill(0.0)) if all_free else (b, q1)
        if first[block + 1] - lo == 1:
            limit = 1.0 - fixed1 * w1
            store(W, here, w1)
            m1 = free1 * w1 / limit
            store(work.levels, lo, m1)
            top = maximum(top, m1)
        else:
            q2 = load(work.p, lo + 1) * load(work.x, scales[lo + 1])
            e2 = load(work.x_inverse, scales[lo + 1])
            free2, fixed2 = (q2 + b, fill(0.0)) if all_free else (b, q2)
            w1 += load(table, at + 2) * e2
            w2 = load(table, at + 3) + load(table, at + 4) * e1 + load(table, at + 5) * e2
            real = load(table, at + 6) + load(table, at + 7) * e1 + load(table, at + 8) * e2
            imag = load(table, at + 9) + load(table, at + 10) * e1 + load(table, at + 11) * e2
            size = real * real + imag * imag
            left1, left2 = 1.0 - fixed1 * w1, 1.0 - fixed2 * w2
            limit = left1 * left2 - fixed1 * fixed2 * size
            over = 1.0 / limit
            m1 = free1 * (w1 * left2 + fixed2 * size) * over
            m2 = free2 * (w2 * left1 + fixed1 * size) * over
            m12 = free1 * free2 * size * (over * over)
            half = 0.5 * (m1 - m2)
            larger = 0.5 * (m1 + m2) + root(half * half + m12)
            store(W, here, w1)
            store(W, here + 1, w2)
            store(W, here + 2, real)
            store(W, here + 3, imag)
            store(work.levels, lo, larger)
            store(work.levels, lo + 1, (m1 * m2 - m12) / larger)
            top = maximum(top, larger)
            possible = minimum(possible, left1)
        possible = minimum(possible, limit)
        left *= limit
    return top, pick(possible > 0.0, left, fill(0.0))


@inner
def _centred_level(levels, top, nu):
    """As `solver.mu.kernel.centred_level`; a lane in which it holds stays as it is."""
    centre = top * (1.0 + nu)
    active = top > 0.0
    for _ in range(MAX_ITERATIONS):
        total, slope = fill(0.0), fill(0.0)
        for i in range(levels.shape[0]):
            over = 1.0 / (centre - load(levels, i))
            term = load(levels, i) * over
            total += term
            slope += term * over
        move = (nu * total - 1.0) * total / slope
        centre = pick(active, centre + move, centre)
        active = active & (magnitude(move) > 1e-4 * (centre - top))
        if not any_of(active):
            break
    return centre


@inner
def _value(levels, centre, left, nu):
    """As `solver.mu.kernel._value`."""
    product, over = left, 1.0 / centre
    for i in range(levels.shape[0]):
        product *= 1.0 - load(levels, i) * over
    return log(centre) * (1.0 / nu) - log(product)


@inner
def _newton_step(layout, work, level, all_free, nu):
    """Newton step in y with the level eliminated, and the squared decrement."""
    scales, first = layout.scales, layout.first
    b = load(work.b, 0)
    one = work.y.shape[0] == 1
    g1, g2 = fill(0.0), fill(0.0)
    h11, h12, h22 = fill(0.0), fill(0.0), fill(0.0)
    h1t, h2t, htt = fill(0.0), fill(0.0), fill(0.0)
    for block in range(first.size - 1):
        lo, here = first[block], ENTRIES * block
        scale = scales[lo]
        e1 = load(work.x_inverse, scale)
        z1 = load(work.p, lo) * load(work.x, scale)
        # dQ_11/dy and dQ_11/dt
        y1, t1 = (z1 * level, (z1 + b) * level) if all_free else (z1, b * level)
        q1 = t1 if all_free else t1 + z1
        w1, a11 = load(work.W, here), pair(work.SG, 2 * lo)
        if first[block + 1] - lo == 1:
            over = 1.0 / (1.0 - q1 * w1)
            A1 = w1 * over
            s11 = e1 * q1 * square(a11) * over
            c11 = square(a11) * e1 * over * over
            gy, grow = A1 * y1, A1 * t1
            gradient = gy - s11
            bend = gy * (1.0 + gy) + s11 * (1.0 + s11) - 2.0 * c11 * y1
            mixed = y1 * (A1 * grow + A1) if all_free else y1 * (A1 * grow)
            mixed -= c11 * t1
            htt += grow + grow * grow
            if scale == 0:
                g1 += gradient
                h11 += bend
                h1t += mixed
            else:
                g2 += gradient
                h22 += bend
                h2t += mixed
            continue
        e2 = load(work.x_inverse, scales[lo + 1])
        z2 = load(work.p, lo + 1) * load(work.x, scales[lo + 1])
        y2, t2 = (z2 * level, (z2 + b) * level) if all_free else (z2, b * level)
        q2 = t2 if all_free else t2 + z2
        w2 = load(work.W, here + 1)
        w12 = load(work.W, here + 2), load(work.W, here + 3)
        a12, a21 = pair(work.SG, 2 * lo + 1), pair(work.SG, 2 * lo + 2)
        a22 = pair(work.SG, 2 * lo + 3)
        size = square(w12)
        left1, left2 = 1.0 - q1 * w1, 1.0 - q2 * w2
        over = 1.0 / (left1 * left2 - q1 * q2 * size)
        # (W^-1 - Q)^-1: its diagonal and the square of the other entry
        A1, A2 = (w1 * left2 + q2 * size) * over, (w2 * left1 + q1 * size) * over
        A12 = size * over * over
        # (I - W Q)^-1 a_j
        v12, v21 = scaled(w12, q2), (w12[0] * q1, -w12[1] * q1)
        b11 = scaled(plus(scaled(a11, left2), times(v12, a21)), over)
        b12 = scaled(plus(scaled(a12, left2), times(v12, a22)), over)
        b21 = scaled(plus(scaled(a21, left1), times(v21, a11)), over)
        b22 = scaled(plus(scaled(a22, left1), times(v21, a12)), over)
        # a_k^H (Q^-1 - W)^-1 a_j
        s11 = e1 * (q1 * conjugate_times(a11, b11)[0] + q2 * conjugate_times(a21, b21)[0])
        s22 = e2 * (q1 * conjugate_times(a12, b12)[0] + q2 * conjugate_times(a22, b22)[0])
        both = plus(scaled(conjugate_times(a11, b12), q1), scaled(conjugate_times(a21, b22), q2))
        s12 = square(both) * e1 * e2
        c11, c12, c21, c22 = (
            square(b11) * e1, square(b12) * e2, square(b21) * e1, square(b22) * e2,
        )  # fmt: skip
        f1, f2 = A1 * y1, A2 * y2
        r1, r2 = A1 * t1, A2 * t2
        grow = r1 + r2
        ga, gb = f1 - s11, f2 - s22
        haa = f1 * (1.0 + f1) + s11 * (1.0 + s11) - 2.0 * c11 * y1
        hbb = f2 * (1.0 + f2) + s22 * (1.0 + s22) - 2.0 * c22 * y2
        hab = A12 * y1 * y2 + s12 - c12 * y1 - c21 * y2
        hat = y1 * (A1 * r1 + A12 * t2) - c11 * t1 - c21 * t2
        hbt = y2 * (A2 * r2 + A12 * t1) - c12 * t1 - c22 * t2
        if all_free:
            hat += f1
            hbt += f2
        htt += grow + r1 * r1 + r2 * r2 + 2.0 * A12 * t1 * t2
        if scales[lo + 1] == scale:
            ga, haa, hat = ga + gb, haa + 2.0 * hab + hbb, hat + hbt
            if scale == 0:
                g1 += ga
                h11 += haa
                h1t += hat
            else:
                g2 += ga
                h22 += haa
                h2t += hat
        else:
            if scale != 0:
                ga, gb, haa, hbb, hat, hbt = gb, ga, hbb, haa, hbt, hat
            g1 += ga
            g2 += gb
            h11 += haa
            h22 += hbb
            h12 += hab
            h1t += hat
            h2t += hbt
    # Cholesky's factor, the level eliminated.
    slope = h1t / htt
    least = h11 + 1.0 / nu
    v = h11 - h1t * slope + 1e-12 * least
    v = pick(v > 1e-13 * least, v, least)
    over = 1.0 / root(v)
    k1 = -g1 * over
    decrement = k1 * k1
    if one:
        return k1 * over, fill(0.0), decrement
    low = (h12 - h2t * slope) * over
    least = h22 + 1.0 / nu
    v = h22 - h2t * h2t / htt + 1e-12 * least - low * low
    v = pick(v > 1e-13 * least, v, least)
    over2 = 1.0 / root(v)
    k2 = (-g2 - low * k1) * over2
    decrement += k2 * k2
    step2 = k2 * over2
    return (k1 - low * step2) * over, step2, decrement


@inner
def solve(layout, work, all_free, nu):
    """Best scales of the eight frequencies from those in `work`; `failed` where none were found."""
    levels = work.levels
    two = work.y.shape[0] == 2
    failed = load(work.failed, 0) > 0.5
    top, left = _evaluate(layout, work, all_free)
    failed = failed | ~((left > 0.0) & (top > TINY) & (top < HUGE))
    centre = _centred_level(levels, top, nu)
    value = _value(levels, centre, left, nu)
    before, active = fill(TINY), ~failed
    for _ in range(MOST_STEPS):
        step1, step2, decrement = _newton_step(layout, work, 1.0 / centre, all_free, nu)
        longest = maximum(magnitude(step1), magnitude(step2))
        length = minimum(LARGEST_STEP / maximum(longest, fill(TINY)), fill(1.0))
        y1 = load(work.y, 0)
        store(work.y, 0, pick(active, y1 + length * step1, y1))
        if two:
            y2 = load(work.y, 1)
            store(work.y, 1, pick(active, y2 + length * step2, y2))
        top, left = _evaluate(layout, work, all_free)
        centre = _centred_level(levels, top, nu)
        new = _value(levels, centre, left, nu)
        fall = value - new
        enough = fall >= 0.1 * length * decrement - 1e-12 * magnitude(value)
        good = enough & (length > SHORT) & (left > 0.0) & (top < HUGE)
        failed = failed | (active & ~good)
        agrees = magnitude(2.0 * fall - decrement) < AGREEMENT * decrement
        others = 1.0 - nu * top / (centre - top)
        apart = others < min(0.1, nu / APART)
        ratio = decrement / before
        converged = (nu * decrement * ratio * ratio < CONVERGED) & (longest < NEAR)
        finished = (length >= 1.0) & ((decrement < CENTRED_AT_END) | (converged & agrees & apart))
        active = active & good & ~finished
        # Only whole steps converge quadratically.
        value, before = new, pick(length >= 1.0, decrement, fill(TINY))
        if not any_of(active):
            break
    failed = failed | active
    for s in range(work.y.shape[0]):
        failed = failed | ~(magnitude(load(work.y, s)) < LARGEST_SCALE)
    store(work.level, 0, top)
    store(work.centre, 0, centre)
    store(work.failed, 0, pick(failed, fill(1.0), fill(0.0)))
