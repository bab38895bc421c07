"""Compiled: frequencies of a sweep side by side in vector registers, eight at a time."""

from solver.mu.batch_loop import set_up, slopes
from solver.mu.batch_solve import balance, solve
from solver.mu.lanes import WIDTH
from solver.mu.workspace import inner

__all__ = ["sweep"]


@inner
def sweep(
    G, c, u, b, layout, all_free, nu, cold, y, work, t, slope, det, done
):  # fmt: skip
    """Fill in what can be solved side by side, a stretch of the frequencies a lane; `done` if."""
    rows, widest, controllers, count = G.shape[1], G.shape[2], c.shape[1], t.size
    scales = y.shape[1]
    for turn in range((count - 1) // WIDTH + 1):
        for lane in range(WIDTH):
            begin, end = lane * count // WIDTH, (lane + 1) * count // WIDTH
            k = max(min(begin + turn, end - 1), begin)
            for i in range(controllers):
                work.c[2 * i, lane] = c[k, i].real
                work.c[2 * i + 1, lane] = c[k, i].imag
            for i in range(rows):
                for j in range(widest):
                    work.G[4 * i + 2 * j, lane] = G[k, i, j].real
                    work.G[4 * i + 2 * j + 1, lane] = G[k, i, j].imag
                work.u[i, lane] = u[k, i]
            work.b[0, lane] = b[k]
            if not cold:
                for s in range(scales):
                    work.y[s, lane] = y[k, s]
        set_up(layout, work)
        if cold and turn == 0:
            balance(layout, work, all_free)
        for s in range(scales):
            for lane in range(WIDTH):
                work.start[s, lane] = work.y[s, lane]
        solve(layout, work, all_free, nu)
        slopes(layout, work, all_free)
        for lane in range(WIDTH):
            if work.failed[0, lane] > 0.5:
                for s in range(scales):
                    work.y[s, lane] = work.start[s, lane]
                continue
            begin, end = lane * count // WIDTH, (lane + 1) * count // WIDTH
            k = max(min(begin + turn, end - 1), begin)
            done[k] = True
            t[k] = work.t[0, lane]
            for s in range(scales):
                y[k, s] = work.y[s, lane]
            for i in range(controllers):
                slope[k, i] = complex(work.slope[2 * i, lane], work.slope[2 * i + 1, lane])
            for block in range(det.shape[1]):
                det[k, block] = complex(work.det[2 * block, lane], work.det[2 * block + 1, lane])
