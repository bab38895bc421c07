"""The dispatcher's side of the job table: whose turn it is, and how jobs end.

Every method is one transaction, so that a process may die between any two of them. A job's end
is written by an update that only an unfinished job satisfies: whoever comes second changes
nothing.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Integer,
    Select,
    Update,
    bindparam,
    case,
    delete,
    func,
    insert,
    select,
    true,
    update,
)

from service.jobs.models import BatchRow, ClockRow, JobRow
from service.jobs.records import (
    FINAL,
    UNFINISHED,
    Dispatch,
    Ended,
    JobStatus,
    Priority,
    TakenJob,
    Waiting,
)
from service.jobs.shares import to_begin, to_stop
from service.jobs.transactions import Transactions

__all__ = ["Queue"]


# Statements are built once: building costs several times as much as executing.
_QUEUED = select(func.min(JobRow.owner)).where(JobRow.status == JobStatus.QUEUED)
_FIRST = select(_QUEUED.scalar_subquery().label("owner")).cte("callers", recursive=True)
# From one caller to the next by the index, however many jobs each has in the queue.
_CALLERS = select(
    _FIRST.union_all(
        select(_QUEUED.where(JobRow.owner > _FIRST.c.owner).scalar_subquery()).where(
            _FIRST.c.owner.is_not(None)
        )
    ).c.owner
)
_NEXT = (
    select(JobRow.id, JobRow.owner, JobRow.priority, JobRow.sequence)
    .where(JobRow.status == JobStatus.QUEUED, JobRow.owner == bindparam("caller"))
    .where(JobRow.created_at < bindparam("before"))
    .order_by(JobRow.priority, JobRow.sequence)
    .limit(bindparam("most", type_=Integer))
)
_NEXT_TO_BEGIN = _NEXT.with_for_update(skip_locked=True)
_TAKEN = select(
    JobRow.id,
    JobRow.request,
    JobRow.time_limit,
    JobRow.attempts,
    JobRow.priority,
    JobRow.owner,
    JobRow.resource,
).where(JobRow.id.in_(bindparam("jobs", expanding=True)))
_START = (
    update(JobRow)
    .where(JobRow.id == bindparam("job"))
    .values(status=JobStatus.RUNNING, started_at=bindparam("now"))
)
_PROGRESS = (
    update(JobRow)
    .where(JobRow.id == bindparam("job"), JobRow.status == JobStatus.RUNNING)
    .values(fraction=bindparam("done"), best=bindparam("reached"))
)
_WANTED = select(JobRow.id).where(
    JobRow.id.in_(bindparam("jobs", expanding=True)), JobRow.cancel_requested.is_(False)
)
_UNENDED = (
    select(JobRow.id)
    .where(JobRow.id.in_(bindparam("jobs", expanding=True)), JobRow.status.in_(UNFINISHED))
    .with_for_update()
)
_END = (
    update(JobRow)
    .where(JobRow.id == bindparam("job"), JobRow.finished_at.is_(None))
    .values(
        status=bindparam("ending"),
        result=bindparam("document"),
        error=bindparam("problem"),
        finished_at=bindparam("now"),
    )
)
_END_WITH_RESULT = _END.values(best=bindparam("reached"))
_END_SUCCEEDED = _END_WITH_RESULT.values(fraction=1.0)


class Queue:
    """The queue of jobs.

    Parameters
    ----------
    transactions : Transactions
        The database.
    max_running : int or None
        Jobs of one caller that may run at once; None: as many as there are workers.

    """

    def __init__(self, transactions: Transactions, max_running: int | None = None) -> None:
        self._transactions = transactions
        self._max_running = max_running

    def exchange(
        self,
        ended: Sequence[Ended],
        progress: Mapping[str, tuple[float, float | None]],
        running: Sequence[TakenJob],
        idle: int,
        *,
        patience: float,
        stopping: Collection[str] = (),
    ) -> Dispatch:
        """Write what happened and return what is to happen next, in one transaction.

        Parameters
        ----------
        ended : sequence of Ended
            Jobs that ended; one that had ended before stays as it is.
        progress : mapping
            Fraction done and best value so far, by job.
        running : sequence of TakenJob
            Jobs that are still running.
        idle : int
            Jobs that may begin, in the order of `service.jobs.shares`.
        patience : float
            Seconds after which others make room for a job that waits.
        stopping : collection of str
            Those of `running` that have been told to stop.

        """
        now = time.time()
        with self._transaction(ended, writes=bool(ended or progress or idle)) as connection:
            written = _end(connection, ended)
            if progress:
                connection.execute(
                    _PROGRESS,
                    [
                        {"job": job, "done": fraction, "reached": best}
                        for job, (fraction, best) in progress.items()
                    ],
                )
            ids = [claim.id for claim in running]
            kept = set(connection.scalars(_WANTED, {"jobs": ids})) if ids else set()
            displaced: list[TakenJob] = []
            claims: list[TakenJob] = []
            if idle:
                held = Counter(claim.owner for claim in running)
                waiting = _waiting(connection, _NEXT_TO_BEGIN, math.inf, idle)
                begun = to_begin(waiting, held, idle, self._max_running)
                claims = _claim(connection, [job.id for job in begun], now)
            elif running:
                staying = [claim for claim in running if claim.id not in stopping]
                waiting = _waiting(connection, _NEXT, now - patience, len(running))
                leaving = len(running) - len(staying)
                displaced = to_stop(waiting, staying, leaving, self._max_running)
        return Dispatch(claims, frozenset(ids) - kept, displaced, written)

    def _transaction(
        self, ended: Sequence[Ended], *, writes: bool
    ) -> AbstractContextManager[Connection]:
        if not writes:
            return self._transactions.reading()
        # A result must survive a power cut. After one, what was only begun is in the queue, where
        # it would be put anyway.
        return self._transactions.writing(durable=bool(ended))

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
        with self._transactions.writing() as connection:
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

    def clock(self, now: float) -> tuple[float, float]:
        """Return the time that retention goes by, and how long the machine's was in doubt.

        Where none is kept yet, the time of the last end in the table: it was not later than now.
        """
        with self._transactions.reading() as connection:
            row = connection.execute(select(ClockRow.believed, ClockRow.doubted)).one_or_none()
            if row is not None:
                return row.believed, row.doubted
            last = connection.scalar(select(func.max(JobRow.finished_at)))
        return min(now, last) if last is not None else now, 0.0

    def set_clock(self, believed: float, doubted: float) -> None:
        """Keep the time that retention goes by."""
        values = {"believed": believed, "doubted": doubted}
        with self._transactions.writing(durable=False) as connection:
            if not connection.execute(update(ClockRow).values(values)).rowcount:
                connection.execute(insert(ClockRow).values(id=1, **values))

    def expire(self, before: float) -> int:
        """Delete the jobs and batches that ended before the time `before`; return how many.

        A batch goes as a whole, with its jobs.
        """
        alive = (
            select(JobRow.id)
            .where(JobRow.batch_id == BatchRow.id)
            .where(JobRow.finished_at.is_(None) | (JobRow.finished_at >= before))
            .exists()
        )
        with self._transactions.writing() as connection:
            jobs = connection.execute(
                delete(JobRow)
                .where(JobRow.batch_id.is_(None))
                .where(JobRow.status.in_(FINAL), JobRow.finished_at < before)
            )
            batches = connection.execute(
                delete(BatchRow).where(BatchRow.created_at < before, ~alive)
            )
        return int(jobs.rowcount + batches.rowcount)


def _end(connection: Connection, ended: Sequence[Ended]) -> frozenset[str]:
    """Write how jobs ended; return those that had not ended before."""
    if not ended:
        return frozenset()
    ends = {one.claim.id: one for one in reversed(ended)}
    written = frozenset(connection.scalars(_UNENDED, {"jobs": list(ends)}))
    rows: dict[Update, list[dict[str, object]]] = {}
    for job in written:
        statement, values = _end_of(ends[job])
        rows.setdefault(statement, []).append(values)
    # Many at once: with PostgreSQL each by itself would wait for its answer.
    for statement, many in rows.items():
        connection.execute(statement, many)
    return written


def _end_of(ended: Ended) -> tuple[Update, dict[str, object]]:
    """Return how the end of a job is written."""
    outcome = ended.outcome
    values: dict[str, object] = {
        "job": ended.claim.id,
        "ending": outcome.status,
        "document": outcome.result,
        "problem": outcome.error,
        "now": ended.finished_at,
    }
    if outcome.result is None:
        return _END, values
    values["reached"] = outcome.best
    succeeded = outcome.status is JobStatus.SUCCEEDED
    return (_END_SUCCEEDED if succeeded else _END_WITH_RESULT), values


def _waiting(
    connection: Connection, statement: Select[*tuple[Any, ...]], before: float, most: int
) -> dict[str, list[Waiting]]:
    """Return the next jobs of each caller that were there `before` a time."""
    found = {}
    for owner in connection.scalars(_CALLERS).all():
        if owner is None:
            continue
        rows = connection.execute(statement, {"caller": owner, "before": before, "most": most})
        found[owner] = [
            Waiting(row.id, row.owner, Priority(row.priority), row.sequence) for row in rows
        ]
    return found


def _claim(connection: Connection, ids: list[str], now: float) -> list[TakenJob]:
    """Begin these jobs, which `_NEXT_TO_BEGIN` keeps from anybody else."""
    if not ids:
        return []
    rows = {row.id: row for row in connection.execute(_TAKEN, {"jobs": ids})}
    connection.execute(_START, [{"job": job, "now": now} for job in ids])
    return [
        TakenJob(
            row.id, row.request, row.time_limit, row.attempts, Priority(row.priority), now,
            row.owner, row.resource,
        )
        for row in (rows[job] for job in ids)
    ]  # fmt: skip
