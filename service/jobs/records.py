"""Records of the job table as the rest of the service sees them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any

__all__ = [
    "FINAL",
    "TUNINGS",
    "UNFINISHED",
    "Batch",
    "BatchItem",
    "Dispatch",
    "Ended",
    "Job",
    "JobStatus",
    "NewJob",
    "Outcome",
    "Priority",
    "Snapshot",
    "TakenJob",
    "Waiting",
]


class JobStatus(StrEnum):
    """State of a job.

    TIMED_OUT jobs carry the best result up to their time limit, CANCELLED ones that up to their
    end, where there was one.
    """

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"
    TIMED_OUT = "timed_out"


class Priority(IntEnum):
    """Place in the queue: the lower goes first."""

    INTERACTIVE = 0
    BATCH = 10


TUNINGS = "tunings"  # the resource of most jobs
FINAL = frozenset({JobStatus.SUCCEEDED, JobStatus.FAILED, JobStatus.CANCELLED, JobStatus.TIMED_OUT})
UNFINISHED = frozenset(JobStatus) - FINAL


@dataclass(frozen=True)
class NewJob:
    """A job to be accepted.

    Parameters
    ----------
    request : str
        The request, or where it is at fault its text as it came.
    time_limit : float
        Seconds.
    computation : str or None
        What of it has a say in the result: jobs that share it have equal results.
    reuse : bool
        Whether a result that is there already will do.
    identity : mapping
        What of it comes back with the result.
    error : str or None
        What is wrong with it (JSON text of a problem): the job has failed before it began.
    resource : str
        What it is a job of, as in its URL path.

    """

    request: str
    time_limit: float
    computation: str | None = None
    reuse: bool = True
    identity: Mapping[str, Any] = field(default_factory=dict)
    error: str | None = None
    resource: str = TUNINGS


@dataclass(frozen=True)
class Snapshot:
    """State of a job: status, fraction done (0..1), best objective so far."""

    status: JobStatus
    fraction: float
    best: float | None


@dataclass(frozen=True)
class Job:
    """A job; times are seconds since 1970; request, result and error are JSON text."""

    sequence: int
    id: str
    snapshot: Snapshot
    created_at: float
    started_at: float | None
    finished_at: float | None
    request: str
    error: str | None
    result: str | None
    batch: str | None = None
    resource: str = TUNINGS


@dataclass(frozen=True)
class TakenJob:
    """A job that the dispatcher took from the queue; `attempts` counts the workers it lost."""

    id: str
    request: str
    time_limit: float
    attempts: int
    priority: Priority
    started_at: float
    owner: str = ""
    resource: str = TUNINGS


@dataclass(frozen=True)
class Waiting:
    """A job in the queue; `sequence` is its place."""

    id: str
    owner: str
    priority: Priority
    sequence: int


@dataclass(frozen=True)
class Outcome:
    """How a job ended; result and error are JSON text, `best` is the result's objective."""

    status: JobStatus
    result: str | None = None
    error: str | None = None
    best: float | None = None


@dataclass(frozen=True)
class Ended:
    """A claimed job that has ended, how and when."""

    claim: TakenJob
    outcome: Outcome
    finished_at: float

    @property
    def snapshot(self) -> Snapshot:
        """State of a job that succeeded."""
        return Snapshot(self.outcome.status, 1.0, self.outcome.best)


@dataclass(frozen=True)
class Dispatch:
    """What the queue has for the dispatcher.

    Parameters
    ----------
    claims : list of TakenJob
        Jobs to run next.
    cancelled : frozenset of str
        Running jobs that are to be cancelled, or that no longer exist.
    displaced : list of TakenJob
        Running jobs that make room for others that have waited.
    written : frozenset of str
        Jobs whose end counts, because they had not ended before.

    """

    claims: list[TakenJob]
    cancelled: frozenset[str]
    displaced: list[TakenJob]
    written: frozenset[str]


@dataclass(frozen=True)
class Batch:
    """A batch: number of items, and of items whose job is in each state."""

    id: str
    count: int
    created_at: float
    states: dict[JobStatus, int]

    @property
    def finished(self) -> bool:
        """Whether every item has ended."""
        return sum(self.states.get(status, 0) for status in FINAL) == self.count


@dataclass(frozen=True)
class BatchItem:
    """An item of a batch: its position, its job, and how that ended, where it has."""

    position: int
    job_id: str
    outcome: Outcome
