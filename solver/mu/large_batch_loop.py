"""Compiled: a loop with blocks of any size at eight frequencies, and its levels' slopes."""

from solver.mu.batch import conjugate_times, pair, plus, put, scaled, square, times
from solver.mu.lanes import fill, load, log, pick, store
from solver.mu.large_batch_levels import inverted
from solver.mu.workspace import inner

__all__ = ["set_up", "slopes"]


@inner
def set_up(layout, widest, work):
    """Fill in det(I + G C), S G and what the scales leave alone: P and W_0."""
    channels, first = layout.channels, layout.first
    possible = load(work.b, 0)
    for r in range(channels.size):
        u = load(work.u, r)
        store(work.p, r, u * square(pair(work.c, channels[r])))
        possible = pick(u > 0.0, possible, u)
    for block in range(first.size - 1):
        lo, size = first[block], first[block + 1] - first[block]
        put(work.det, block, _sensitivity(channels, lo, size, widest, work))
        S, wide = work.elimination, 2 * size
        for i in range(size):
            for k in range(i + 1):
                v = fill(0.0), fill(0.0)
                for j in range(size):
                    v = plus(
                        v,
                        conjugate_times(pair(S, k * wide + size + j), pair(S, i * wide + size + j)),
                    )
                put(work.W_0, (lo + i) * widest + k, v)
    # Without a performance block, or where an input does not err, a scale is free, which the steps
    # here are not made for.
    store(work.failed, 0, pick(possible > 0.0, fill(0.0), fill(1.0)))


@inner
def _sensitivity(channels, lo, size, widest, work):
    """det(I + G C) of one block; S to the right half of `elimination`, and S G."""
    E, G, wide = work.elimination, work.G, 2 * size
    zero = fill(0.0)
    for i in range(size):
        for j in range(size):
            e = times(pair(G, (lo + i) * widest + j), pair(work.c, channels[lo + j]))
            if i == j:
                e = 1.0 + e[0], e[1]
            put(E, i * wide + j, e)
            put(E, i * wide + size + j, (fill(1.0 if i == j else 0.0), zero))
    det = fill(1.0), zero
    for column in range(size):
        largest = square(pair(E, column * wide + column))
        for i in range(column + 1, size):  # the largest pivot comes up, lane by lane
            here = square(pair(E, i * wide + column))
            better = here > largest
            largest = pick(better, here, largest)
            for j in range(column, wide):
                upper, lower = pair(E, column * wide + j), pair(E, i * wide + j)
                put(E, column * wide + j, _chosen(better, lower, upper))
                put(E, i * wide + j, _chosen(better, upper, lower))
            det = _chosen(better, scaled(det, -1.0), det)
        pivot = pair(E, column * wide + column)
        det = times(det, pivot)
        over = 1.0 / largest
        over = pivot[0] * over, -pivot[1] * over
        for j in range(column, wide):
            put(E, column * wide + j, times(pair(E, column * wide + j), over))
        for i in range(size):
            if i == column:
                continue
            factor = scaled(pair(E, i * wide + column), -1.0)
            for j in range(column, wide):
                old = pair(E, i * wide + j)
                put(E, i * wide + j, plus(old, times(factor, pair(E, column * wide + j))))
    for i in range(size):
        for j in range(size):
            v = zero, zero
            for m in range(size):
                v = plus(v, times(pair(E, i * wide + size + m), pair(G, (lo + m) * widest + j)))
            put(work.SG, (lo + i) * widest + j, v)
    return det


@inner
def _chosen(mask, a, b):
    """Return `a` where the mask holds, `b` elsewhere."""
    return pick(mask, a[0], b[0]), pick(mask, a[1], b[1])


@inner
def slopes(layout, widest, work, all_free):
    """Fill in `t` and `slope` at what `solve` has found."""
    channels, scales, first = layout.channels, layout.scales, layout.first
    level = 1.0 / load(work.centre, 0)
    divisor = load(work.level, 0) if all_free else fill(1.0)
    total = fill(0.0)
    for i in range(work.slope.shape[0]):
        store(work.slope, i, fill(0.0))
    for block in range(first.size - 1):
        lo, size = first[block], first[block + 1] - first[block]
        inverted(layout, block, widest, work, level, all_free)
        for i in range(size):
            # W B = Q^(-1/2) (M^-1 - I) Q^(1/2), and likewise (W^-1 - Q)^-1
            over = 1.0 / load(work.roots, i)
            active = load(work.inverse, 2 * (i * size + i)) - 1.0
            total += active * load(work.share_t, i)
            mixed = scaled(pair(work.SG, (lo + i) * widest + i), active * load(work.roots, i))
            for m in range(size):
                if m == i:
                    continue
                r = pair(work.inverse, max(i, m) * size + min(i, m))
                r = (r[0], r[1] if m < i else -r[1])
                a = pair(work.SG, (lo + m) * widest + i)
                mixed = plus(mixed, scaled(times(r, a), load(work.roots, m)))
            mixed = scaled(mixed, over)
            own = load(work.u, lo + i) / divisor * load(work.x, scales[lo + i])
            own = own * active * (over * over)
            channel = channels[lo + i]
            c, slope = pair(work.c, channel), pair(work.slope, channel)
            put(
                work.slope,
                channel,
                (slope[0] + own * c[0] - mixed[0], slope[1] - own * c[1] - mixed[1]),
            )
    over = -2.0 / total
    for i in range(work.slope.shape[0]):
        store(work.slope, i, load(work.slope, i) * over)
    store(work.t, 0, -log(load(work.level, 0)))
