"""Whom to tell that a job or a batch has ended: the rows of those still to be told.

A row is taken by moving its next time ahead, and goes when its receiver has answered. So a process
may die at any moment: the worst is that a receiver is told twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import Integer, bindparam, delete, select, update

from service.jobs.models import BatchItemRow, BatchRow, CallbackRow, JobRow
from service.jobs.records import FINAL, UNFINISHED
from service.jobs.transactions import Transactions

__all__ = ["WAITS", "Callbacks", "Due"]

# Seconds from one try to the next; after the last one nobody tries again. A day in all.
WAITS = (5.0, 30.0, 120.0, 600.0, 3600.0, 10_800.0, 28_800.0, 43_200.0)

_CALLBACK = (CallbackRow.sequence, CallbackRow.url, CallbackRow.tries)
_JOBS = (
    select(*_CALLBACK, JobRow.resource, JobRow.id, JobRow.status)
    .join(JobRow, CallbackRow.job_id == JobRow.id)
    .where(CallbackRow.due <= bindparam("now"), JobRow.status.in_(FINAL))
    .order_by(CallbackRow.due)
    .limit(bindparam("most", type_=Integer))
)
_BATCHES = (
    select(*_CALLBACK, BatchRow.id)
    .join(BatchRow, CallbackRow.batch_id == BatchRow.id)
    .where(CallbackRow.due <= bindparam("now"))
    .where(
        ~select(JobRow.id)
        .join(BatchItemRow, BatchItemRow.job_id == JobRow.id)
        .where(BatchItemRow.batch_id == BatchRow.id, JobRow.status.in_(UNFINISHED))
        .exists()
    )
    .order_by(CallbackRow.due)
    .limit(bindparam("most", type_=Integer))
)


@dataclass(frozen=True)
class Due:
    """Somebody to tell now: of which job or batch, how it ended, and how often it was tried."""

    sequence: int
    url: str
    tries: int
    resource: str
    id: str
    status: str

    @property
    def kind(self) -> str:
        """One of its resource."""
        return "batch" if self.resource == "batches" else self.resource.removesuffix("s")

    @property
    def is_last(self) -> bool:
        """Whether there is no further try."""
        return self.tries >= len(WAITS)


class Callbacks:
    """The table of callbacks.

    Parameters
    ----------
    transactions : Transactions
        The database.

    """

    def __init__(self, transactions: Transactions) -> None:
        self._transactions = transactions

    def take(self, now: float, most: int) -> list[Due]:
        """Return whom to tell now; each is due again later, should this process not tell it."""
        with self._transactions.reading() as connection:
            values = {"now": now, "most": most}
            found = [Due(*row) for row in connection.execute(_JOBS, values)]
            found += [
                Due(*row[:3], "batches", row[3], "finished")
                for row in connection.execute(_BATCHES, values)
            ]
        if not found:
            return []
        taken = []
        with self._transactions.writing(durable=False) as connection:
            for due in found:
                wait = WAITS[min(due.tries, len(WAITS) - 1)]
                statement = (
                    update(CallbackRow)
                    .where(CallbackRow.sequence == due.sequence, CallbackRow.tries == due.tries)
                    .values(due=now + wait, tries=due.tries + 1)
                )
                if connection.execute(statement).rowcount:  # or another process took it
                    taken.append(due)
        return taken

    def end(self, sequence: int) -> None:
        """Forget one: it was told, or given up."""
        with self._transactions.writing() as connection:
            connection.execute(delete(CallbackRow).where(CallbackRow.sequence == sequence))
