"""The precision of ball arithmetic and threads."""

from __future__ import annotations

import threading

from flint import ctx

from solver.model.precision import working_precision


def test_threads_compute_with_their_own_precision_and_leave_none_behind():
    """One that sets another precision waits until the first has put back what it found."""
    before, seen, inside = ctx.prec, [], threading.Event()

    def other():
        with working_precision(300):
            seen.append(ctx.prec)

    with working_precision(200):
        thread = threading.Thread(target=lambda: (inside.set(), other()))
        thread.start()
        inside.wait()
        thread.join(0.05)
        assert ctx.prec == 200
        with working_precision(100):  # the same thread may go on
            assert ctx.prec == 100
        assert ctx.prec == 200
    thread.join()
    assert seen == [300]
    assert ctx.prec == before
