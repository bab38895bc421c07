"""Compiled: the loop at eight frequencies, and how their levels answer to the controllers.

For blocks of one or two rows, whose W is a linear function of the inverse scales, as in
`solver.mu.small_block`.
"""

from solver.mu.batch import (
    ENTRIES,
    TABLE,
    conjugate_times,
    pair,
    plus,
    put,
    scaled,
    square,
    times,
)
from solver.mu.lanes import fill, load, log, pick, store
from solver.mu.workspace import inner

__all__ = ["set_up", "slopes"]


@inner
def set_up(layout, work):
    """Fill in det(I + G C), S G and what the scales leave alone: P and the coefficients of W."""
    channels, first = layout.channels, layout.first
    G, SG, table = work.G, work.SG, work.table
    b = load(work.b, 0)
    for r in range(channels.size):
        store(work.p, r, load(work.u, r) * square(pair(work.c, channels[r])))
    for block in range(first.size - 1):
        lo, at = first[block], TABLE * block
        c1, g11 = pair(work.c, channels[lo]), pair(G, 2 * lo)
        e11 = times(g11, c1)
        e11 = 1.0 + e11[0], e11[1]
        if first[block + 1] - lo == 1:
            over = 1.0 / square(e11)
            a = scaled(conjugate_times(e11, g11), over)
            put(work.det, block, e11)
            put(SG, 2 * lo, a)
            store(table, at, over)
            store(table, at + 1, square(a))
            continue
        c2 = pair(work.c, channels[lo + 1])
        g12, g21, g22 = pair(G, 2 * lo + 1), pair(G, 2 * lo + 2), pair(G, 2 * lo + 3)
        e12, e21, e22 = times(g12, c2), times(g21, c1), times(g22, c2)
        e22 = 1.0 + e22[0], e22[1]
        det = plus(times(e11, e22), scaled(times(e12, e21), -1.0))
        over = 1.0 / square(det)
        over = det[0] * over, -det[1] * over
        s11, s12 = times(e22, over), scaled(times(e12, over), -1.0)
        s21, s22 = scaled(times(e21, over), -1.0), times(e11, over)
        strength = plus(times(g11, g22), scaled(times(g12, g21), -1.0))
        a11 = times(plus(g11, times(c2, strength)), over)
        a22 = times(plus(g22, times(c1, strength)), over)
        a12, a21 = times(g12, over), times(g21, over)
        put(work.det, block, det)
        put(SG, 2 * lo, a11)
        put(SG, 2 * lo + 1, a12)
        put(SG, 2 * lo + 2, a21)
        put(SG, 2 * lo + 3, a22)
        store(table, at, square(s11) + square(s12))
        store(table, at + 1, square(a11))
        store(table, at + 2, square(a12))
        store(table, at + 3, square(s21) + square(s22))
        store(table, at + 4, square(a21))
        store(table, at + 5, square(a22))
        rest = plus(conjugate_times(s21, s11), conjugate_times(s22, s12))
        first_column, second_column = conjugate_times(a21, a11), conjugate_times(a22, a12)
        for part in range(2):
            store(table, at + 6 + 3 * part, rest[part])
            store(table, at + 7 + 3 * part, first_column[part])
            store(table, at + 8 + 3 * part, second_column[part])
    # Without a performance block a scale is free, which the steps here are not made for.
    store(work.failed, 0, pick(b > 0.0, fill(0.0), fill(1.0)))


@inner
def slopes(layout, work, all_free):
    """Fill in `t` and `slope` at what `solve` has found."""
    channels, scales, first = layout.channels, layout.scales, layout.first
    b, level = load(work.b, 0), 1.0 / load(work.centre, 0)
    divisor = load(work.level, 0) if all_free else fill(1.0)
    total = fill(0.0)
    for i in range(work.slope.shape[0]):
        store(work.slope, i, fill(0.0))
    for block in range(first.size - 1):
        lo, here = first[block], ENTRIES * block
        z1 = load(work.p, lo) * load(work.x, scales[lo])
        t1 = (z1 + b) * level if all_free else b * level
        q1 = t1 if all_free else t1 + z1
        w1, a11 = load(work.W, here), pair(work.SG, 2 * lo)
        if first[block + 1] - lo == 1:
            A1 = w1 / (1.0 - q1 * w1)
            total += A1 * t1
            own = load(work.u, lo) / divisor * load(work.x, scales[lo]) * A1
            _add_slope(work, channels[lo], own, scaled(a11, q1 * A1))
            continue
        z2 = load(work.p, lo + 1) * load(work.x, scales[lo + 1])
        t2 = (z2 + b) * level if all_free else b * level
        q2 = t2 if all_free else t2 + z2
        w2 = load(work.W, here + 1)
        w12 = load(work.W, here + 2), load(work.W, here + 3)
        size = square(w12)
        left1, left2 = 1.0 - q1 * w1, 1.0 - q2 * w2
        over = 1.0 / (left1 * left2 - q1 * q2 * size)
        A1, A2 = (w1 * left2 + q2 * size) * over, (w2 * left1 + q1 * size) * over
        a12, a21 = pair(work.SG, 2 * lo + 1), pair(work.SG, 2 * lo + 2)
        a22 = pair(work.SG, 2 * lo + 3)
        total += A1 * t1 + A2 * t2
        mixed = plus(scaled(a11, q1 * A1), scaled(times(w12, a21), q2 * over))
        own = load(work.u, lo) / divisor * load(work.x, scales[lo]) * A1
        _add_slope(work, channels[lo], own, mixed)
        mixed = plus(scaled(a22, q2 * A2), scaled(conjugate_times(w12, a12), q1 * over))
        own = load(work.u, lo + 1) / divisor * load(work.x, scales[lo + 1]) * A2
        _add_slope(work, channels[lo + 1], own, mixed)
    over = -2.0 / total
    for i in range(work.slope.shape[0]):
        store(work.slope, i, load(work.slope, i) * over)
    store(work.t, 0, -log(load(work.level, 0)))


@inner
def _add_slope(work, channel, own, mixed):
    """Add a row's part, own conj(c) - mixed."""
    c, slope = pair(work.c, channel), pair(work.slope, channel)
    put(
        work.slope,
        channel,
        (slope[0] + own * c[0] - mixed[0], slope[1] - own * c[1] - mixed[1]),
    )
