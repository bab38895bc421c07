"""All SQL: the job table and what is done with it.

Every method is one transaction, so that a process may die between any two of them. A job's end
is written by an update that only an unfinished job satisfies: whoever comes second changes
nothing.
"""

from __future__ import annotations

import hashlib
import time
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Engine,
    Row,
    Select,
    case,
    delete,
    func,
    insert,
    null,
    select,
    true,
    update,
)
from sqlalchemy.exc import DBAPIError, IntegrityError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.jobs.models import JobRow
from service.jobs.records import FINAL, Claim, Job, JobStatus, NewJob, Outcome, Snapshot

__all__ = ["IdempotencyConflictError", "Store", "StoreUnavailableError"]

INTERACTIVE, BATCH = 0, 10

_UNFINISHED = (JobStatus.QUEUED, JobStatus.RUNNING)


class StoreUnavailableError(Exception):
    """The database does not answer, is locked, read-only or full."""


class IdempotencyConflictError(Exception):
    """An idempotency key was used before, with another request."""


class Store:
    """The job table.

    Parameters
    ----------
    engine : Engine
        Connections to a migrated database.

    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        with _translated(), self._engine.connect() as connection:
            yield connection

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        with (
            _translated(),
            self._engine.connect().execution_options(writes=True) as connection,
            connection.begin(),
        ):
            yield connection

    def ping(self) -> None:
        """Check that the database answers."""
        with self._reading() as connection:
            connection.execute(select(1))

    # What callers ask

    def submit(self, owner: str, job: NewJob, idempotency_key: str | None = None) -> Job:
        """Accept a job, or return the one accepted before under the same key.

        Raises
        ------
        IdempotencyConflictError
            The key was used with another request.

        """
        row = _new_row(owner, job, INTERACTIVE, idempotency_key)
        try:
            with self._writing() as connection:
                connection.execute(insert(JobRow), row)
        except IntegrityError:
            return self._accepted_before(owner, row)
        return self.get(owner, row["id"])

    def _accepted_before(self, owner: str, row: Mapping[str, Any]) -> Job:
        with self._reading() as connection:
            earlier = connection.execute(
                select(JobRow.id, JobRow.digest)
                .where(JobRow.owner == owner)
                .where(JobRow.idempotency_key == row["idempotency_key"])
            ).one()
        if earlier.digest != row["digest"]:
            raise IdempotencyConflictError
        return self.get(owner, earlier.id)

    def get(self, owner: str, job_id: str) -> Job:
        """Return a job.

        Raises
        ------
        KeyError
            There is none, or it is another owner's.

        """
        with self._reading() as connection:
            row = connection.execute(
                _JOBS.where(JobRow.id == job_id, JobRow.owner == owner)
            ).one_or_none()
        if row is None:
            raise KeyError(job_id)
        return _job(row)

    def page(
        self, owner: str, *, below: int | None, limit: int, status: JobStatus | None = None
    ) -> list[Job]:
        """Return jobs with a sequence below `below`, newest first, without results."""
        query = _SUMMARIES.where(JobRow.owner == owner)
        if below is not None:
            query = query.where(JobRow.sequence < below)
        if status is not None:
            query = query.where(JobRow.status == status)
        with self._reading() as connection:
            rows = connection.execute(query.order_by(JobRow.sequence.desc()).limit(limit)).all()
        return [_job(row) for row in rows]

    def cancel(self, owner: str, job_id: str) -> Job:
        """Cancel a queued job, ask for the end of a running one, leave a finished one.

        Raises
        ------
        KeyError
            There is none, or it is another owner's.

        """
        with self._writing() as connection:
            connection.execute(
                update(JobRow)
                .where(JobRow.id == job_id, JobRow.owner == owner)
                .where(JobRow.status == JobStatus.QUEUED)
                .values(status=JobStatus.CANCELLED, finished_at=time.time())
            )
            connection.execute(
                update(JobRow)
                .where(JobRow.id == job_id, JobRow.owner == owner)
                .where(JobRow.status == JobStatus.RUNNING)
                .values(cancel_requested=True)
            )
        return self.get(owner, job_id)

    def snapshots(self, job_ids: Iterable[str]) -> dict[str, Snapshot]:
        """Return the state of each job that exists."""
        query = select(JobRow.id, JobRow.status, JobRow.fraction, JobRow.best)
        with self._reading() as connection:
            rows = connection.execute(query.where(JobRow.id.in_(list(job_ids)))).all()
        return {row.id: _snapshot(row) for row in rows}

    def counts(self) -> dict[JobStatus, int]:
        """Return the number of jobs in each state."""
        with self._reading() as connection:
            rows = connection.execute(
                select(JobRow.status, func.count()).group_by(JobRow.status)
            ).all()
        return {JobStatus(status): count for status, count in rows}

    # What the dispatcher does

    def claim(self, limit: int) -> list[Claim]:
        """Take the next jobs from the queue: interactive before batch, then oldest first."""
        with self._writing() as connection:
            rows = connection.execute(
                select(JobRow.id, JobRow.request, JobRow.time_limit, JobRow.attempts)
                .where(JobRow.status == JobStatus.QUEUED)
                .order_by(JobRow.priority, JobRow.sequence)
                .limit(limit)
                .with_for_update(skip_locked=True)
            ).all()
            if rows:
                connection.execute(
                    update(JobRow)
                    .where(JobRow.id.in_([row.id for row in rows]))
                    .values(status=JobStatus.RUNNING, started_at=time.time())
                )
        return [Claim(row.id, row.request, row.time_limit, row.attempts) for row in rows]

    def record_progress(self, progress: Mapping[str, tuple[float, float | None]]) -> None:
        """Note fraction done and best value so far of running jobs."""
        with self._writing() as connection:
            for job_id, (fraction, best) in progress.items():
                connection.execute(
                    update(JobRow)
                    .where(JobRow.id == job_id, JobRow.status == JobStatus.RUNNING)
                    .values(fraction=fraction, best=best)
                )

    def cancellations(self, job_ids: Sequence[str]) -> list[str]:
        """Return those of the jobs that are to be cancelled, or that no longer exist."""
        with self._reading() as connection:
            wanted = connection.scalars(
                select(JobRow.id)
                .where(JobRow.id.in_(job_ids))
                .where(JobRow.cancel_requested.is_(False))
            ).all()
        return [job_id for job_id in job_ids if job_id not in wanted]

    def finish(self, job_id: str, outcome: Outcome) -> bool:
        """Write how a job ended; return whether it had not ended before."""
        values = {
            "status": outcome.status,
            "result": outcome.result,
            "error": outcome.error,
            "finished_at": time.time(),
        }
        if outcome.status is JobStatus.SUCCEEDED:
            values["fraction"] = 1.0
        with self._writing() as connection:
            done = connection.execute(
                update(JobRow)
                .where(JobRow.id == job_id, JobRow.status.in_(_UNFINISHED))
                .values(**values)
            )
        return bool(done.rowcount)

    def requeue(self, job_ids: Sequence[str]) -> None:
        """Put running jobs back into the queue; those to be cancelled are cancelled."""
        self._requeue(JobRow.id.in_(job_ids))

    def requeue_after_loss(self, job_id: str) -> None:
        """Put a job back that has lost its worker, and count that."""
        self._requeue(JobRow.id == job_id, losses=1)

    def requeue_all(self) -> None:
        """Put every running job back: whoever dispatched them is gone."""
        self._requeue(true())

    def _requeue(self, which: ColumnElement[bool], losses: int = 0) -> None:
        wanted = JobRow.cancel_requested
        with self._writing() as connection:
            connection.execute(
                update(JobRow)
                .where(which, JobRow.status == JobStatus.RUNNING)
                .values(
                    status=case((wanted, JobStatus.CANCELLED), else_=JobStatus.QUEUED),
                    finished_at=case((wanted, time.time())),
                    started_at=case((wanted, JobRow.started_at)),
                    attempts=JobRow.attempts + losses,
                    fraction=0.0,
                    best=None,
                )
            )

    def expire(self, before: float) -> int:
        """Delete the jobs that ended before the time `before`; return their number."""
        with self._writing() as connection:
            gone = connection.execute(
                delete(JobRow).where(JobRow.status.in_(FINAL), JobRow.finished_at < before)
            )
        return int(gone.rowcount)


@contextmanager
def _translated() -> Iterator[None]:
    """Turn a database that fails into `StoreUnavailableError`."""
    try:
        yield
    except IntegrityError:
        raise
    except (DBAPIError, PoolTimeoutError) as error:
        raise StoreUnavailableError(str(error)) from error


def _new_row(owner: str, job: NewJob, priority: int, idempotency_key: str | None) -> dict[str, Any]:
    return {
        "id": uuid.uuid4().hex,
        "owner": owner,
        "priority": priority,
        "status": JobStatus.QUEUED,
        "attempts": 0,
        "cancel_requested": False,
        "fraction": 0.0,
        "created_at": time.time(),
        "idempotency_key": idempotency_key,
        "digest": hashlib.sha256(job.request.encode()).hexdigest(),
        "time_limit": job.time_limit,
        "request": job.request,
    }


_COLUMNS = (
    JobRow.sequence,
    JobRow.id,
    JobRow.status,
    JobRow.fraction,
    JobRow.best,
    JobRow.created_at,
    JobRow.started_at,
    JobRow.finished_at,
    JobRow.request,
    JobRow.error,
)
_JOBS: Select[*tuple[Any, ...]] = select(*_COLUMNS, JobRow.result)
_SUMMARIES: Select[*tuple[Any, ...]] = select(*_COLUMNS, null().label("result"))


def _snapshot(row: Row[*tuple[Any, ...]]) -> Snapshot:
    return Snapshot(JobStatus(row.status), row.fraction, row.best)


def _job(row: Row[*tuple[Any, ...]]) -> Job:
    return Job(
        row.sequence,
        row.id,
        _snapshot(row),
        row.created_at,
        row.started_at,
        row.finished_at,
        row.request,
        row.error,
        row.result,
    )
