"""The dispatcher's side of the job table: whose turn it is, and how jobs end.

Every method is one transaction, so that a process may die between any two of them. A job's end
is written by an update that only an unfinished job satisfies: whoever comes second changes
nothing.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from sqlalchemy import ColumnElement, case, delete, func, select, true, update

from service.jobs.models import BatchRow, JobRow
from service.jobs.records import FINAL, UNFINISHED, Claim, JobStatus, Outcome, Priority
from service.jobs.transactions import Transactions

__all__ = ["Queue"]


class Queue:
    """The queue of jobs.

    Parameters
    ----------
    transactions : Transactions
        The database.

    """

    def __init__(self, transactions: Transactions) -> None:
        self._transactions = transactions

    def claim(self, limit: int) -> list[Claim]:
        """Take the next jobs from the queue: interactive before batch, then oldest first."""
        # Not durable: after a power cut the job is in the queue, where it would be put anyway.
        with self._transactions.writing(durable=False) as connection:
            rows = connection.execute(
                select(
                    JobRow.id,
                    JobRow.request,
                    JobRow.time_limit,
                    JobRow.attempts,
                    JobRow.priority,
                )
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
        return [
            Claim(row.id, row.request, row.time_limit, row.attempts, Priority(row.priority))
            for row in rows
        ]

    def interactive_since(self, before: float) -> int:
        """Return the number of interactive jobs in the queue since before the time `before`."""
        with self._transactions.reading() as connection:
            count = connection.scalar(
                select(func.count())
                .select_from(JobRow)
                .where(JobRow.status == JobStatus.QUEUED)
                .where(JobRow.priority == Priority.INTERACTIVE, JobRow.created_at < before)
            )
        return count or 0

    def record_progress(self, progress: Mapping[str, tuple[float, float | None]]) -> None:
        """Note fraction done and best value so far of running jobs."""
        with self._transactions.writing(durable=False) as connection:
            for job_id, (fraction, best) in progress.items():
                connection.execute(
                    update(JobRow)
                    .where(JobRow.id == job_id, JobRow.status == JobStatus.RUNNING)
                    .values(fraction=fraction, best=best)
                )

    def cancellations(self, job_ids: Sequence[str]) -> list[str]:
        """Return those of the jobs that are to be cancelled, or that no longer exist."""
        with self._transactions.reading() as connection:
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
        if outcome.result is not None:
            values["best"] = outcome.best
        if outcome.status is JobStatus.SUCCEEDED:
            values["fraction"] = 1.0
        with self._transactions.writing() as connection:
            done = connection.execute(
                update(JobRow)
                .where(JobRow.id == job_id, JobRow.status.in_(UNFINISHED))
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
