"""The job table, on SQLite and on PostgreSQL alike."""

import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import postgres
import pytest
from sqlalchemy import Engine, delete, event, func, select, text

from service.jobs import database
from service.jobs.models import Base, BatchItemRow, BatchRow, JobRow
from service.jobs.queue import Queue
from service.jobs.records import Ended, JobStatus, NewJob, Outcome, Priority, TakenJob
from service.jobs.store import IdempotencyConflictError, QueueFullError, Store
from service.jobs.transactions import StoreUnavailableError, Transactions

DONE = Outcome(JobStatus.SUCCEEDED, result="{}")
TABLES = (JobRow, BatchRow, BatchItemRow)


@pytest.fixture(scope="module")
def postgres_url() -> Iterator[str]:
    """Return the URL of a PostgreSQL cluster."""
    with postgres.cluster() as url:
        yield url


@pytest.fixture(params=["sqlite", "postgresql"])
def engine(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Engine]:
    """Return connections to an empty, migrated database."""
    if request.param == "sqlite":
        engine = database.connect(f"sqlite:///{tmp_path / 'test.sqlite3'}")
    else:
        engine = database.connect(request.getfixturevalue("postgres_url"))
    database.migrate(engine)
    yield engine
    with engine.begin() as connection:
        for table in reversed(TABLES):
            connection.execute(delete(table))
    engine.dispose()


@pytest.fixture
def store(engine: Engine) -> Store:
    """Return the callers' side."""
    return Store(Transactions(engine), max_queued=1000)


@pytest.fixture
def queue(engine: Engine) -> Queue:
    """Return the dispatcher's side."""
    return Queue(Transactions(engine))


def job(number: int = 0) -> NewJob:
    """Return a job that differs from those of other numbers."""
    return NewJob(json.dumps({"number": number}), time_limit=60)


def claim(queue: Queue, count: int) -> list[TakenJob]:
    """Take the next jobs."""
    return queue.exchange([], {}, [], count, patience=0.0).claims


def finish(queue: Queue, claim: TakenJob, outcome: Outcome = DONE) -> bool:
    """Write the end of a job; return whether it counts."""
    return (
        claim.id
        in queue.exchange([Ended(claim, outcome, time.time())], {}, [], 0, patience=0.0).written
    )


def rows(engine: Engine) -> list[int]:
    """Return the number of rows in each table."""
    with engine.connect() as connection:
        counts = [connection.scalar(select(func.count()).select_from(table)) for table in TABLES]
        return [count or 0 for count in counts]


def test_migration_is_repeatable_and_safe_at_the_same_time(engine: Engine) -> None:
    """Several processes may bring the schema up to date at once."""
    with ThreadPoolExecutor(4) as pool:
        for future in [pool.submit(database.migrate, engine) for _ in range(8)]:
            future.result()


def test_results_from_before_compression_are_read(engine: Engine) -> None:
    """Rows of an earlier version keep every digit; those without a result stay without."""
    with engine.begin() as connection:
        Base.metadata.drop_all(connection)
        connection.execute(text("DROP TABLE alembic_version"))
    database.migrate(engine, "0003")
    result = json.dumps({"status": "optimal", "tau_p": 18.446123456789012, "unit": "°"})
    row = {
        "owner": "", "priority": 0, "status": "succeeded", "attempts": 0, "fraction": 1.0,
        "cancel_requested": False, "created_at": 1.0, "digest": "d", "time_limit": 1.0,
        "request": "{}",
    }  # fmt: skip
    found = {"a" * 32: result, "b" * 32: None}
    with engine.begin() as connection:
        for job_id, document in found.items():
            values = row | {"id": job_id, "result": document}
            names, places = ", ".join(values), ", ".join(f":{name}" for name in values)
            insert = f"INSERT INTO jobs ({names}) VALUES ({places})"  # noqa: S608 - names of ours
            connection.execute(text(insert), values)
    database.migrate(engine)
    store = Store(Transactions(engine), max_queued=10)
    assert {job_id: store.get("", job_id).result for job_id in found} == found


def test_a_result_takes_half_its_text(engine: Engine, store: Store, queue: Queue) -> None:
    """Curves of digits that nothing foretells are the worst of it."""
    curve = np.random.default_rng(0).random(900).tolist()
    result = json.dumps({"omega": curve, "digits": "0" * 1000})
    job_id = store.submit("", job()).id
    finish(queue, claim(queue, 1)[0], Outcome(JobStatus.SUCCEEDED, result))
    assert store.get("", job_id).result == result
    with engine.connect() as connection:
        size = connection.scalar(text("SELECT length(result) FROM jobs"))
    assert size is not None
    assert size < 0.55 * len(result)


def test_interactive_before_batch_then_oldest_first(store: Store, queue: Queue) -> None:
    """The queue is served in turn."""
    store.submit_batch("", [job(0), job(1)])
    singles = [store.submit("", job(number)).id for number in (2, 3)]
    claims = claim(queue, 3)
    assert [one.id for one in claims[:2]] == singles
    assert json.loads(claims[2].request) == {"number": 0}
    assert claims[2].priority is Priority.BATCH
    assert [json.loads(one.request)["number"] for one in claim(queue, 9)] == [1]


def test_no_job_is_claimed_twice(store: Store, queue: Queue) -> None:
    """Claims at the same time share the queue without overlap."""
    store.submit_batch("", [job(number) for number in range(60)])
    with ThreadPoolExecutor(4) as pool:
        claims = list(pool.map(lambda count: claim(queue, count), [5] * 20))
    ids = [one.id for some in claims for one in some]
    assert len(ids) == len(set(ids)) == 60


def test_only_the_first_end_counts(store: Store, queue: Queue) -> None:
    """A second result for the same job changes nothing."""
    job_id = store.submit("", job()).id
    (taken,) = claim(queue, 1)
    assert finish(queue, taken)
    assert not finish(queue, taken, Outcome(JobStatus.FAILED, error="{}"))
    queue.requeue([job_id])
    queue.requeue_all()
    ended = store.get("", job_id)
    assert ended.snapshot.status is JobStatus.SUCCEEDED
    assert ended.result == "{}"


def test_running_jobs_go_back_unless_they_are_to_be_cancelled(store: Store, queue: Queue) -> None:
    """When the dispatcher is gone its jobs are queued again; cancelled ones end."""
    kept, dropped = store.submit("", job(0)).id, store.submit("", job(1)).id
    running = claim(queue, 2)
    store.cancel("", dropped)
    turn = queue.exchange([], {kept: (0.5, 1.0)}, running, 0, patience=0.0)
    assert turn.cancelled == {dropped}
    assert store.snapshots([kept])[kept].fraction == 0.5
    queue.requeue_all()
    assert store.snapshots([kept])[kept].status is JobStatus.QUEUED
    assert store.snapshots([kept])[kept].fraction == 0
    assert store.get("", dropped).snapshot.status is JobStatus.CANCELLED
    assert store.get("", dropped).finished_at is not None


def test_lost_workers_are_counted(store: Store, queue: Queue) -> None:
    """Each loss of a worker counts as an attempt; being put back does not."""
    job_id = store.submit("", job()).id
    attempts = []
    for put_back in (
        lambda: queue.requeue_after_loss(job_id),
        lambda: queue.requeue([job_id]),
        lambda: queue.requeue_after_loss(job_id),
        queue.requeue_all,
    ):
        attempts.append(claim(queue, 1)[0].attempts)
        put_back()
    assert attempts == [0, 1, 1, 2]


def test_jobs_of_batches_make_room_for_tunings_that_have_waited(store: Store, queue: Queue) -> None:
    """The dispatcher hears which, and not again while that one is being stopped."""
    store.submit_batch("", [job(0), job(1)])
    running = claim(queue, 1)
    assert queue.exchange([], {}, running, 0, patience=0.0).displaced == []
    store.submit("", job(2))
    assert queue.exchange([], {}, running, 0, patience=60.0).displaced == []
    assert queue.exchange([], {}, running, 0, patience=0.0).displaced == running
    assert (
        queue.exchange([], {}, running, 0, patience=0.0, stopping={running[0].id}).displaced == []
    )


def test_callers_take_turns(store: Store, queue: Queue) -> None:
    """A long queue of one caller does not keep another one waiting; each queue is in its order."""
    for number in range(20):
        store.submit("first", job(number))
    store.submit("second", job(30))
    store.submit_batch("third", [job(40), job(41)])
    taken = claim(queue, 6)
    assert [one.owner for one in taken] == [
        "first", "second", "third", "first", "third", "first",
    ]  # fmt: skip
    assert [json.loads(one.request)["number"] for one in taken] == [0, 30, 40, 1, 41, 2]


def test_ends_and_what_was_reached_are_written(store: Store, queue: Queue) -> None:
    """How far a job was stays unless it succeeded; a best result is kept where there is one."""
    for number in range(3):
        store.submit("", job(number))
    claims = claim(queue, 3)
    queue.exchange([], {one.id: (0.5, 7.0) for one in claims}, [], 0, patience=0.0)
    outcomes = (
        Outcome(JobStatus.SUCCEEDED, result="{}", best=1.0),
        Outcome(JobStatus.TIMED_OUT, result="{}", best=2.0),
        Outcome(JobStatus.FAILED, error="{}"),
    )
    for one, outcome in zip(claims, outcomes, strict=True):
        assert finish(queue, one, outcome)
    ended = [store.get("", one.id) for one in claims]
    assert [one.snapshot.fraction for one in ended] == [1.0, 0.5, 0.5]
    assert [one.snapshot.best for one in ended] == [1.0, 2.0, 7.0]
    assert [one.error for one in ended] == [None, None, "{}"]


def test_owners_do_not_see_each_other(store: Store) -> None:
    """What belongs to one key does not exist for another."""
    job_id = store.submit("ann", job()).id
    batch_id = store.submit_batch("ann", [job()]).id
    for call, identifier in (
        (store.get, job_id),
        (store.cancel, job_id),
        (store.get_batch, batch_id),
        (store.cancel_batch, batch_id),
    ):
        with pytest.raises(KeyError):
            call("bob", identifier)
    assert store.page("bob", below=None, limit=10) == []
    assert store.get("ann", job_id).snapshot.status is JobStatus.QUEUED


def test_idempotency_key_creates_one_job_whatever_the_race(store: Store, engine: Engine) -> None:
    """Requests with the same key at the same time create one job; owners have their own keys."""
    barrier = threading.Barrier(8)

    def submit(_: int) -> str:
        barrier.wait()
        return store.submit("ann", job(), "key").id

    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(submit, range(8)))) == 1
    store.submit("bob", job(1), "key")
    with pytest.raises(IdempotencyConflictError):
        store.submit("ann", job(1), "key")
    assert rows(engine)[0] == 2


def test_batch_beyond_the_quota_leaves_nothing(engine: Engine) -> None:
    """A batch that does not fit is refused as a whole; others still have room."""
    store = Store(Transactions(engine), max_queued=3)
    with pytest.raises(QueueFullError):
        store.submit_batch("ann", [job(number) for number in range(4)])
    assert rows(engine) == [0, 0, 0]
    store.submit_batch("ann", [job(0), job(1), job(2), job(0)])
    with pytest.raises(QueueFullError):
        store.submit("ann", job(5))
    store.submit("bob", job(5))


def test_expired_jobs_and_batches_leave_nothing(store: Store, queue: Queue, engine: Engine) -> None:
    """What ended long ago goes with all its rows; a batch stays until its last job has ended."""
    store.submit("", job(0))
    batch = store.submit_batch("", [job(1), job(2), job(1)])
    for taken in claim(queue, 2):
        finish(queue, taken)
    queue.expire(time.time() + 1)
    assert rows(engine) == [2, 1, 3]
    store.cancel_batch("", batch.id)
    queue.expire(time.time() - 60)
    assert rows(engine) == [2, 1, 3]
    queue.expire(time.time() + 1)
    assert rows(engine) == [0, 0, 0]


def test_numbers_of_jobs_are_not_used_again(store: Store, queue: Queue) -> None:
    """A cursor cannot meet a number that once stood for another job."""
    first = store.submit("", job(0))
    store.cancel("", first.id)
    queue.expire(time.time() + 1)
    assert store.submit("", job(1)).sequence > first.sequence


def test_second_process_on_a_sqlite_file_is_refused(tmp_path: Path) -> None:
    """A SQLite file serves one process; the message says what to do."""
    url = f"sqlite:///{tmp_path / 'test.sqlite3'}"
    with (
        database.sole_user(url),
        pytest.raises(database.DatabaseInUseError, match="MUTUNE_DATA_DIR"),
        database.sole_user(url),
    ):
        pass
    with database.sole_user(url):
        pass


@pytest.mark.parametrize(
    "pragma", ["PRAGMA query_only = ON", "PRAGMA max_page_count = 1", "PRAGMA busy_timeout = 1"]
)
def test_database_that_takes_nothing_is_unavailable(tmp_path: Path, pragma: str) -> None:
    """Read-only, full and locked databases refuse a job without half of it remaining."""
    engine = database.connect(f"sqlite:///{tmp_path / 'test.sqlite3'}")
    database.migrate(engine)
    engine.dispose()
    event.listen(engine, "connect", lambda connection, _: connection.execute(pragma))
    store = Store(Transactions(engine), max_queued=10)
    other = database.connect(str(engine.url))
    with other.connect().execution_options(writes=True) as holder:
        if "busy" in pragma:
            holder.execute(text("SELECT 1"))  # begins as a writer
        with pytest.raises(StoreUnavailableError):
            store.submit_batch("", [NewJob("x" * 10_000, 60), job(1)])
    assert rows(other) == [0, 0, 0]
    engine.dispose()
    other.dispose()
