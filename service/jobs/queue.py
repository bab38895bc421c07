"""The dispatcher's side of the job table: whose turn it is, and how jobs end.

Every method is one transaction, so that a process may die between any two of them. A job's end
is written by an update that only an unfinished job satisfies: whoever comes second changes
nothing.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager

from sqlalchemy import (
    ColumnElement,
    Connection,
    Integer,
    bindparam,
    case,
    delete,
    func,
    select,
    true,
    update,
)

from service.jobs.models import BatchRow, JobRow
from service.jobs.records import FINAL, UNFINISHED, Dispatch, Ended, JobStatus, Priority, TakenJob
from service.jobs.transactions import Transactions

__all__ = ["Queue"]


# Statements are built once: building costs several times as much as executing.
_NEXT = (
    select(JobRow.id, JobRow.request, JobRow.time_limit, JobRow.attempts, JobRow.priority)
    .where(JobRow.status == JobStatus.QUEUED)
    .order_by(JobRow.priority, JobRow.sequence)
    .limit(bindparam("idle", type_=Integer))
    .with_for_update(skip_locked=True)
)
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
_WAITING = (
    select(func.count())
    .select_from(JobRow)
    .where(JobRow.status == JobStatus.QUEUED)
    .where(JobRow.priority == Priority.INTERACTIVE, JobRow.created_at < bindparam("before"))
)
_END = (
    update(JobRow)
    .where(JobRow.id == bindparam("job"), JobRow.status.in_(UNFINISHED))
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

    """

    def __init__(self, transactions: Transactions) -> None:
        self._transactions = transactions

    def exchange(
        self,
        ended: Sequence[Ended],
        progress: Mapping[str, tuple[float, float | None]],
        running: Sequence[str],
        idle: int,
        patience: float,
    ) -> Dispatch:
        """Write what happened and return what is to happen next, in one transaction.

        Parameters
        ----------
        ended : sequence of Ended
            Jobs that ended; one that had ended before stays as it is.
        progress : mapping
            Fraction done and best value so far, by job.
        running : sequence of str
            Jobs that are still running.
        idle : int
            Jobs that may begin: interactive before batch, then oldest first.
        patience : float
            Seconds after which an interactive job counts as waiting.

        """
        now = time.time()
        with self._transaction(ended, writes=bool(ended or progress or idle)) as connection:
            written = frozenset(one.claim.id for one in ended if _end(connection, one))
            if progress:
                connection.execute(
                    _PROGRESS,
                    [
                        {"job": job, "done": fraction, "reached": best}
                        for job, (fraction, best) in progress.items()
                    ],
                )
            kept = set(connection.scalars(_WANTED, {"jobs": running})) if running else set()
            waiting = 0
            if running and not idle:
                waiting = connection.scalar(_WAITING, {"before": now - patience}) or 0
            claims = _claim(connection, idle, now) if idle else []
        return Dispatch(claims, frozenset(running) - kept, waiting, written)

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


def _end(connection: Connection, ended: Ended) -> bool:
    """Write how a job ended; return whether it had not ended before."""
    outcome = ended.outcome
    values = {
        "job": ended.claim.id,
        "ending": outcome.status,
        "document": outcome.result,
        "problem": outcome.error,
        "now": ended.finished_at,
    }
    statement = _END
    if outcome.result is not None:
        values["reached"] = outcome.best
        succeeded = outcome.status is JobStatus.SUCCEEDED
        statement = _END_SUCCEEDED if succeeded else _END_WITH_RESULT
    return bool(connection.execute(statement, values).rowcount)


def _claim(connection: Connection, idle: int, now: float) -> list[TakenJob]:
    rows = connection.execute(_NEXT, {"idle": idle}).all()
    if rows:
        connection.execute(_START, [{"job": row.id, "now": now} for row in rows])
    return [
        TakenJob(row.id, row.request, row.time_limit, row.attempts, Priority(row.priority), now)
        for row in rows
    ]
