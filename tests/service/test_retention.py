"""Retention by a clock that survives jumps of the machine's."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from service.jobs import database, retention
from service.jobs.queue import Queue
from service.jobs.records import Ended, JobStatus, NewJob, Outcome
from service.jobs.retention import Clock, advance
from service.jobs.store import Store
from service.jobs.transactions import Transactions

DAY, LOOK = 86_400.0, 600.0


def run(clock: Clock, now: float, looks: int) -> tuple[Clock, float]:
    """Let a service look so often, and the machine's clock go with it."""
    for _ in range(looks):
        now += LOOK
        clock = advance(clock, now, LOOK)
    return clock, now


def test_steady_clock_is_followed() -> None:
    """And one that was set by some minutes, either way."""
    clock, now = run(Clock(1e9), 1e9, 300)
    assert clock == Clock(now)
    for set_by in (300.0, -300.0, -40 * DAY):
        assert advance(clock, now + LOOK + set_by, LOOK) == Clock(now + LOOK + set_by)


def test_jump_of_forty_days_is_not_believed_for_a_day() -> None:
    """And leaves nothing behind where it is put right before that."""
    clock, now = run(Clock(1e9), 1e9 + 40 * DAY, 100)
    assert clock.believed == pytest.approx(1e9 + 100 * LOOK)
    clock, now = run(clock, now - 40 * DAY, 1)
    assert clock == Clock(now)
    clock, now = run(Clock(1e9), 1e9 + 40 * DAY, 144)
    assert clock == Clock(now)


def test_long_stop_is_believed_after_a_day_of_running_in_pieces() -> None:
    """A service that is started each day does not keep its results for ever."""
    clock, now = Clock(1e9), 1e9 + 10 * DAY
    days = 0
    while clock.believed < now:
        clock, now = run(advance(clock, now, 0.0), now, 48)
        if clock.believed < now:
            now += DAY - 48 * LOOK
        days += 1
    assert days == 3


def test_results_outlive_a_clock_that_jumps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the table itself: nothing is deleted at once, everything of age after a day."""
    engine = database.connect(f"sqlite:///{tmp_path / 'test.sqlite3'}")
    database.migrate(engine)
    transactions = Transactions(engine)
    store, queue = Store(transactions, max_queued=10), Queue(transactions)
    job = store.submit("", NewJob("{}", 1.0)).id
    (taken,) = queue.exchange([], {}, [], 1, patience=0.0).claims
    ended = Ended(taken, Outcome(JobStatus.SUCCEEDED, result="{}"), time.time())
    queue.exchange([ended], {}, [], 0, patience=0.0)
    later = time.time() + 40 * DAY
    monkeypatch.setattr(time, "time", lambda: later)
    assert retention._expire(queue, 30.0, 0.0) == 0  # noqa: SLF001 - one look, without the wait
    assert retention._expire(queue, 30.0, LOOK) == 0  # noqa: SLF001 - the same
    assert store.get("", job).result == "{}"
    assert retention._expire(queue, 30.0, DAY) == 1  # noqa: SLF001 - the same
    engine.dispose()
