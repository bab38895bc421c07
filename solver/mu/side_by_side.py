"""Compiled: frequencies of a sweep side by side in vector registers, eight at a time."""

from solver.mu import batch_loop, batch_solve, large_batch_loop, large_batch_solve
from solver.mu.lanes import WIDTH
from solver.mu.workspace import inner

__all__ = ["sweep", "sweep_again", "sweep_large"]

IMPATIENT, PATIENT = False, True


@inner
def sweep(
    G, c, u, b, layout, all_free, nu, cold, y, work, t, slope, det, done
):  # fmt: skip
    """Fill in what can be solved side by side, a stretch of the frequencies a lane; `done` if.

    Blocks have one row or two, and at most two scales.
    """
    columns = 2
    for turn in range((t.size - 1) // WIDTH + 1):
        for lane in range(WIDTH):
            _fill(G, c, u, b, work, columns, lane, _place(turn, lane, t.size, cold))
            if not cold:
                _fill_scales(y, work, lane, _place(turn, lane, t.size, cold))
        batch_loop.set_up(layout, work)
        if cold and turn == 0:
            batch_solve.balance(layout, work, all_free)
        _note_start(work)
        batch_solve.solve(layout, work, all_free, nu)
        batch_loop.slopes(layout, work, all_free)
        for lane in range(WIDTH):
            _take(work, lane, _place(turn, lane, t.size, cold), t, slope, det, y, done)


@inner
def sweep_large(
    G, c, u, b, layout, all_free, nu, cold, y, work, t, slope, det, done
):  # fmt: skip
    """Fill in likewise what takes a steady way, for blocks of any size.

    What does not is left at the scales from which it began.
    """
    widest = G.shape[2]
    for turn in range((t.size - 1) // WIDTH + 1):
        for lane in range(WIDTH):
            _fill(G, c, u, b, work, widest, lane, _place(turn, lane, t.size, cold))
            if not cold:
                _fill_scales(y, work, lane, _place(turn, lane, t.size, cold))
        large_batch_loop.set_up(layout, widest, work)
        if cold and turn == 0:
            large_batch_solve.balance(layout, widest, work, all_free)
        _note_start(work)
        large_batch_solve.solve(layout, widest, work, all_free, nu, IMPATIENT)
        large_batch_loop.slopes(layout, widest, work, all_free)
        for lane in range(WIDTH):
            _take(work, lane, _place(turn, lane, t.size, cold), t, slope, det, y, done)


@inner
def sweep_again(G, c, u, b, layout, all_free, nu, y, work, t, slope, det, done, left):
    """Fill in what is not done yet, by way of larger barrier parameters where need be.

    `left` (k,) integer is overwritten.
    """
    widest, count = G.shape[2], 0
    for k in range(t.size):
        if not done[k]:
            left[count] = k
            count += 1
    for begin in range(0, count, WIDTH):
        for lane in range(WIDTH):
            k = left[min(begin + lane, count - 1)]
            _fill(G, c, u, b, work, widest, lane, k)
            _fill_scales(y, work, lane, k)
        large_batch_loop.set_up(layout, widest, work)
        _note_start(work)
        large_batch_solve.solve(layout, widest, work, all_free, nu, PATIENT)
        large_batch_loop.slopes(layout, widest, work, all_free)
        for lane in range(WIDTH):
            _take(work, lane, left[min(begin + lane, count - 1)], t, slope, det, y, done)


@inner
def _place(turn, lane, count, cold):
    """Return the frequency of a lane: where each is its neighbour's start, of a stretch of its own.

    Else eight that lie beside each other, since these need about as many steps.
    """
    if not cold:
        return min(WIDTH * turn + lane, count - 1)
    begin, end = lane * count // WIDTH, (lane + 1) * count // WIDTH
    return max(min(begin + turn, end - 1), begin)


@inner
def _fill(G, c, u, b, work, columns, lane, k):
    """Put a frequency into a lane; rows of the plants have so many columns there."""
    for i in range(c.shape[1]):
        work.c[2 * i, lane] = c[k, i].real
        work.c[2 * i + 1, lane] = c[k, i].imag
    for i in range(G.shape[1]):
        for j in range(G.shape[2]):
            work.G[2 * (columns * i + j), lane] = G[k, i, j].real
            work.G[2 * (columns * i + j) + 1, lane] = G[k, i, j].imag
        work.u[i, lane] = u[k, i]
    work.b[0, lane] = b[k]


@inner
def _fill_scales(y, work, lane, k):
    """Put a frequency's scales into a lane."""
    for s in range(y.shape[1]):
        work.y[s, lane] = y[k, s]


@inner
def _note_start(work):
    """Keep the scales from which all lanes begin."""
    for s in range(work.y.shape[0]):
        for lane in range(WIDTH):
            work.start[s, lane] = work.y[s, lane]


@inner
def _take(work, lane, k, t, slope, det, y, done):
    """Take a lane's results; where there are none, its scales are those from which it began."""
    if work.failed[0, lane] > 0.5:
        for s in range(y.shape[1]):
            work.y[s, lane] = work.start[s, lane]
            y[k, s] = work.y[s, lane]
        return
    done[k] = True
    t[k] = work.t[0, lane]
    for s in range(y.shape[1]):
        y[k, s] = work.y[s, lane]
    for i in range(slope.shape[1]):
        slope[k, i] = complex(work.slope[2 * i, lane], work.slope[2 * i + 1, lane])
    for block in range(det.shape[1]):
        det[k, block] = complex(work.det[2 * block, lane], work.det[2 * block + 1, lane])
