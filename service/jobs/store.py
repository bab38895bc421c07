"""The callers' side of the job table: accept, show, list, cancel.

Every method is one transaction, so that a process may die between any two of them.
"""

from __future__ import annotations

import hashlib
import json
import time
import uuid
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Integer,
    Row,
    Select,
    bindparam,
    delete,
    func,
    insert,
    null,
    select,
    text,
    update,
)
from sqlalchemy.exc import IntegrityError

from service.jobs.models import BatchItemRow, BatchRow, CallbackRow, JobRow
from service.jobs.records import (
    FINAL,
    TUNINGS,
    UNFINISHED,
    Batch,
    BatchItem,
    Job,
    JobStatus,
    NewJob,
    Outcome,
    Priority,
    Snapshot,
)
from service.jobs.transactions import Transactions

__all__ = ["IdempotencyConflictError", "QueueFullError", "Store", "UnfinishedError"]


class IdempotencyConflictError(Exception):
    """An idempotency key was used before, with another request."""


class QueueFullError(Exception):
    """The owner has too many jobs in the queue."""


class UnfinishedError(Exception):
    """The job has not ended, or is part of a batch."""


class Store:
    """The job table.

    Parameters
    ----------
    transactions : Transactions
        The database.
    max_queued : int
        Unfinished jobs that one owner may have.

    """

    def __init__(self, transactions: Transactions, max_queued: int) -> None:
        self._transactions = transactions
        self._max_queued = max_queued

    def ping(self) -> None:
        """Check that the database answers and takes what is written."""
        with self._transactions.writing(durable=False) as connection:
            connection.execute(_NOTHING_NEW)

    def submit(
        self,
        owner: str,
        job: NewJob,
        idempotency_key: str | None = None,
        callback: str | None = None,
    ) -> Job:
        """Accept a job, or return the one accepted before under the same key.

        `callback` is a URL to be told of its end.

        Raises
        ------
        IdempotencyConflictError
            The key was used with another request.
        QueueFullError
            The owner has too many unfinished jobs.

        """
        row = _new_row(owner, job, Priority.INTERACTIVE)
        row["idempotency_key"] = idempotency_key
        try:
            with self._transactions.writing() as connection:
                self._check_room(connection, owner, 1)
                if _take_known(connection, owner, [(job, row)]):
                    connection.execute(_INSERT, row)
                    _call_back(connection, callback, job_id=row["id"])
                    values = {"job": row["id"], "caller": owner, "kind": job.resource}
                    found = connection.execute(_JOB, values)
                    return _job(found.one())
                sequence = connection.execute(_INSERT, row).scalar_one()
                _call_back(connection, callback, job_id=row["id"])
        except IntegrityError:
            return self.get(owner, self._accepted_before(JobRow, owner, row), job.resource)
        # As it was written, and nobody has changed it yet: no need to read it back.
        waiting = Snapshot(JobStatus.QUEUED, 0.0, None)
        created = row["created_at"]
        return Job(
            sequence, row["id"], waiting, created, None, None, job.request, None, None,
            resource=job.resource,
        )  # fmt: skip

    def submit_batch(
        self,
        owner: str,
        jobs: Sequence[NewJob],
        idempotency_key: str | None = None,
        callback: str | None = None,
    ) -> Batch:
        """Accept all jobs as one batch, or none; equal requests become one job.

        `callback` is a URL to be told when all have ended.

        Raises
        ------
        IdempotencyConflictError, QueueFullError
            As `submit`.

        """
        batch = {
            "id": uuid.uuid4().hex,
            "owner": owner,
            "created_at": time.time(),
            "count": len(jobs),
            "idempotency_key": idempotency_key,
            "digest": _digest("".join(_digest(job.request) for job in jobs)),
        }
        distinct = {job.request: job for job in jobs}
        rows = {
            request: _new_row(owner, job, Priority.BATCH, batch["id"])
            for request, job in distinct.items()
        }
        items = [
            {"batch_id": batch["id"], "position": position, "job_id": rows[job.request]["id"]}
            for position, job in enumerate(jobs)
        ]
        try:
            with self._transactions.writing() as connection:
                self._check_room(connection, owner, len(rows))
                _take_known(connection, owner, [(distinct[key], rows[key]) for key in rows])
                connection.execute(insert(BatchRow), batch)
                connection.execute(insert(JobRow), list(rows.values()))
                connection.execute(insert(BatchItemRow), items)
                _call_back(connection, callback, batch_id=batch["id"])
        except IntegrityError:
            return self.get_batch(owner, self._accepted_before(BatchRow, owner, batch))
        return self.get_batch(owner, str(batch["id"]))

    def _check_room(self, connection: Connection, owner: str, more: int) -> None:
        unfinished = connection.scalar(_UNFINISHED, {"caller": owner})
        if (unfinished or 0) + more > self._max_queued:
            raise QueueFullError

    def _accepted_before(
        self, table: type[JobRow | BatchRow], owner: str, row: Mapping[str, Any]
    ) -> str:
        with self._transactions.reading() as connection:
            earlier = connection.execute(
                select(table.id, table.digest)
                .where(table.owner == owner)
                .where(table.idempotency_key == row["idempotency_key"])
            ).one()
        if earlier.digest != row["digest"]:
            raise IdempotencyConflictError
        return str(earlier.id)

    def get_batch(self, owner: str, batch_id: str) -> Batch:
        """Return a batch.

        Raises
        ------
        KeyError
            There is none, or it is another owner's.

        """
        with self._transactions.reading() as connection:
            row = connection.execute(
                select(BatchRow.id, BatchRow.count.label("size"), BatchRow.created_at).where(
                    BatchRow.id == batch_id, BatchRow.owner == owner
                )
            ).one_or_none()
            if row is None:
                raise KeyError(batch_id)
            states = connection.execute(
                select(JobRow.status, func.count())
                .join(BatchItemRow, BatchItemRow.job_id == JobRow.id)
                .where(BatchItemRow.batch_id == batch_id)
                .group_by(JobRow.status)
            ).all()
        counts = {JobStatus(status): count for status, count in states}
        return Batch(row.id, row.size, row.created_at, counts)

    def cancel_batch(self, owner: str, batch_id: str) -> Batch:
        """Cancel all unfinished jobs of a batch.

        Raises
        ------
        KeyError
            There is none, or it is another owner's.

        """
        self._cancel(JobRow.batch_id == batch_id, JobRow.owner == owner)
        return self.get_batch(owner, batch_id)

    def batch_items(self, batch_id: str, start: int, limit: int) -> list[BatchItem]:
        """Return items of a batch from position `start` on, in order."""
        with self._transactions.reading() as connection:
            rows = connection.execute(
                _ITEMS, {"batch": batch_id, "start": start, "count": limit}
            ).all()
        return [
            BatchItem(row.position, row.id, Outcome(JobStatus(row.status), row.result, row.error))
            for row in rows
        ]

    def batch_requests(self, batch_id: str) -> list[str]:
        """Return the requests of a batch, in order."""
        with self._transactions.reading() as connection:
            return list(connection.scalars(_REQUESTS, {"batch": batch_id}))

    def get(self, owner: str, job_id: str, resource: str = TUNINGS) -> Job:
        """Return a job.

        Raises
        ------
        KeyError
            There is none, or it is another owner's, or one of another resource.

        """
        with self._transactions.reading() as connection:
            values = {"job": job_id, "caller": owner, "kind": resource}
            row = connection.execute(_JOB, values).one_or_none()
        if row is None:
            raise KeyError(job_id)
        return _job(row)

    def batches(self, owner: str, *, limit: int) -> list[Batch]:
        """Return the newest batches, newest first."""
        with self._transactions.reading() as connection:
            found = connection.scalars(
                select(BatchRow.id)
                .where(BatchRow.owner == owner)
                .order_by(BatchRow.sequence.desc())
                .limit(limit)
            ).all()
        return [self.get_batch(owner, batch_id) for batch_id in found]

    def page(
        self,
        owner: str,
        *,
        below: int | None,
        limit: int,
        status: JobStatus | None = None,
        batch: str | None = None,
    ) -> list[Job]:
        """Return tunings with a sequence below `below`, newest first, without results."""
        query = _SUMMARIES.where(JobRow.owner == owner, JobRow.resource == TUNINGS)
        if batch is not None:
            query = query.where(JobRow.batch_id == batch)
        if below is not None:
            query = query.where(JobRow.sequence < below)
        if status is not None:
            query = query.where(JobRow.status == status)
        with self._transactions.reading() as connection:
            rows = connection.execute(query.order_by(JobRow.sequence.desc()).limit(limit)).all()
        return [_job(row) for row in rows]

    def cancel(self, owner: str, job_id: str, resource: str = TUNINGS) -> Job:
        """Cancel a queued job, ask for the end of a running one, leave a finished one.

        Raises
        ------
        KeyError
            There is none, or it is another owner's.

        """
        self._cancel(JobRow.id == job_id, JobRow.owner == owner, JobRow.resource == resource)
        return self.get(owner, job_id, resource)

    def forget(self, owner: str, job_id: str, resource: str = TUNINGS) -> Job:
        """Delete a finished job for ever, and return it as it was; others stay as they are.

        Raises
        ------
        KeyError
            There is none, or it is another owner's.
        UnfinishedError
            It has not ended, or belongs to a batch, which goes as a whole when it expires.

        """
        job = self.get(owner, job_id, resource)
        with self._transactions.writing() as connection:
            gone = connection.execute(
                delete(JobRow)
                .where(JobRow.id == job_id, JobRow.owner == owner)
                .where(JobRow.status.in_(FINAL), JobRow.batch_id.is_(None))
            )
        if not gone.rowcount:
            raise UnfinishedError
        return job

    def _cancel(self, *which: ColumnElement[bool]) -> None:
        with self._transactions.writing() as connection:
            connection.execute(
                update(JobRow)
                .where(*which, JobRow.status == JobStatus.QUEUED)
                .values(status=JobStatus.CANCELLED, finished_at=time.time())
            )
            connection.execute(
                update(JobRow)
                .where(*which, JobRow.status == JobStatus.RUNNING)
                .values(cancel_requested=True)
            )

    def snapshots(self, job_ids: Iterable[str]) -> dict[str, Snapshot]:
        """Return the state of each job that exists."""
        with self._transactions.reading() as connection:
            rows = connection.execute(_SNAPSHOTS, {"jobs": list(job_ids)}).all()
        return {row.id: _snapshot(row) for row in rows}

    def counts(self) -> dict[JobStatus, int]:
        """Return the number of jobs in each state."""
        with self._transactions.reading() as connection:
            rows = connection.execute(
                select(JobRow.status, func.count()).group_by(JobRow.status)
            ).all()
        return {JobStatus(status): count for status, count in rows}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _new_row(
    owner: str, job: NewJob, priority: Priority, batch_id: object = None
) -> dict[str, Any]:
    # Tunings came first: only jobs of other resources are told apart from them by name.
    kind = "" if job.resource == TUNINGS else f"{job.resource} "
    return {
        "id": uuid.uuid4().hex,
        "owner": owner,
        "resource": job.resource,
        "idempotency_key": None,
        "priority": int(priority),
        "status": JobStatus.QUEUED,
        "attempts": 0,
        "cancel_requested": False,
        "fraction": 0.0,
        "created_at": time.time(),
        "batch_id": batch_id,
        "digest": _digest(kind + job.request),
        "computation": None if job.computation is None else _digest(kind + job.computation),
        "time_limit": job.time_limit,
        "request": job.request,
        "started_at": None,
        "finished_at": None,
        "best": None,
        "result": None,
        "error": None,
    } | ({} if job.error is None else _failed(job.error))


def _call_back(connection: Connection, url: str | None, **subject: object) -> None:
    """Keep whom to tell of an end, in the transaction that accepts what is to end."""
    if url is not None:
        connection.execute(insert(CallbackRow).values(url=url, due=0.0, tries=0, **subject))


def _failed(error: str) -> dict[str, Any]:
    return {"status": JobStatus.FAILED, "error": error, "finished_at": time.time()}


def _take_known(
    connection: Connection, owner: str, rows: Sequence[tuple[NewJob, dict[str, Any]]]
) -> bool:
    """Fill rows in whose results are there already, from equal computations of the same owner.

    Returns
    -------
    bool
        Whether there were any.

    """
    wanted = [row["computation"] for job, row in rows if job.reuse and job.computation is not None]
    known: dict[str, tuple[str, float | None]] = {}
    for start in range(0, len(wanted), _MANY):
        part = wanted[start : start + _MANY]
        for found in connection.execute(_KNOWN, {"caller": owner, "computations": part}):
            known[found.computation] = (found.result, found.best)
    for job, row in rows:
        if job.reuse and row["computation"] in known:
            text, best = known[row["computation"]]
            result = json.loads(text)
            result.pop("id", None)
            result.pop("labels", None)
            row |= {
                "status": JobStatus.SUCCEEDED,
                "fraction": 1.0,
                "best": best,
                "finished_at": time.time(),
                "result": json.dumps(result | dict(job.identity), separators=(",", ":")),
            }
    return bool(known)


# A write that changes nothing: what a full or read-only database refuses.
_NOTHING_NEW = text("UPDATE alembic_version SET version_num = version_num")
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
    JobRow.batch_id,
    JobRow.resource,
)
# Statements are built once: building costs several times as much as executing.
_JOB: Select[*tuple[Any, ...]] = select(*_COLUMNS, JobRow.result).where(
    JobRow.id == bindparam("job"),
    JobRow.owner == bindparam("caller"),
    JobRow.resource == bindparam("kind"),
)
_SUMMARIES: Select[*tuple[Any, ...]] = select(*_COLUMNS, null().label("result"))
_SNAPSHOTS = select(JobRow.id, JobRow.status, JobRow.fraction, JobRow.best).where(
    JobRow.id.in_(bindparam("jobs", expanding=True))
)
_ITEMS = (
    select(BatchItemRow.position, JobRow.id, JobRow.status, JobRow.result, JobRow.error)
    .join(JobRow, BatchItemRow.job_id == JobRow.id)
    .where(BatchItemRow.batch_id == bindparam("batch"))
    .where(BatchItemRow.position >= bindparam("start"))
    .order_by(BatchItemRow.position)
    .limit(bindparam("count", type_=Integer))
)
_REQUESTS = (
    select(JobRow.request)
    .join(BatchItemRow, BatchItemRow.job_id == JobRow.id)
    .where(BatchItemRow.batch_id == bindparam("batch"))
    .order_by(BatchItemRow.position)
)
_MANY = 500  # digests asked for at once
_KNOWN = select(JobRow.computation, JobRow.result, JobRow.best).where(
    JobRow.owner == bindparam("caller"),
    JobRow.computation.in_(bindparam("computations", expanding=True)),
    JobRow.status == JobStatus.SUCCEEDED,
    JobRow.result.is_not(None),
)
_UNFINISHED = (
    select(func.count())
    .select_from(JobRow)
    .where(JobRow.owner == bindparam("caller"), JobRow.status.in_(UNFINISHED))
)
_INSERT = insert(JobRow).returning(JobRow.sequence)


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
        row.batch_id,
        row.resource,
    )
