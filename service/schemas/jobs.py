"""Jobs as JSON."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, JsonValue

from service.jobs.records import TUNINGS, Snapshot
from service.jobs.records import Job as JobRecord
from service.problems import Problem
from service.schemas.tunings import EXAMPLE, TuningRequest, TuningResult

__all__ = [
    "Job",
    "JobList",
    "JobState",
    "JobSummary",
    "Timestamp",
    "job_to_json",
    "progress_to_json",
    "summary_to_dict",
    "timestamp",
]

_TIME = "2026-01-31T12:00:00.000000Z"
_ID = "9f1b0d3c5a7e4c0d8b6a2f4e1c3d5b7a"

Timestamp = Annotated[str, Field(json_schema_extra={"format": "date-time"})]


class JobProgress(BaseModel):
    """How far a job is."""

    fraction: float = Field(description="Part done, 0..1.", examples=[0.4])
    best: float | None = Field(
        description="Best value of the objective so far; at the end that of the result.",
        examples=[19.2],
    )


class Links(BaseModel):
    """Where to go from a job."""

    self: str = Field(description="The job.", examples=[f"/v1/tunings/{_ID}"])
    events: str = Field(
        description="Its progress as server-sent events.", examples=[f"/v1/tunings/{_ID}/events"]
    )


class JobState(BaseModel):
    """A job without its request and its result."""

    id: str = Field(description="Identifier.", examples=[_ID])
    status: Literal["queued", "running", "succeeded", "failed", "cancelled", "timed_out"] = Field(
        description="State; a timed-out or cancelled job may carry the best result up to then.",
        examples=["succeeded"],
    )
    progress: JobProgress = Field(
        description="How far it is.", examples=[{"fraction": 1.0, "best": 18.4}]
    )
    error: Problem | None = Field(description="Why it failed.", examples=[None])
    created_at: Timestamp = Field(description="When it was accepted (UTC).", examples=[_TIME])
    started_at: Timestamp | None = Field(description="When it was last started.", examples=[_TIME])
    finished_at: Timestamp | None = Field(description="When it ended.", examples=[_TIME])
    links: Links = Field(
        description="Where to go from here.",
        examples=[{"self": f"/v1/tunings/{_ID}", "events": f"/v1/tunings/{_ID}/events"}],
    )


class JobSummary(JobState):
    """A tuning job without its result."""

    request: TuningRequest | dict[str, JsonValue] = Field(
        union_mode="left_to_right",
        description="The request, with all defaults; as it came, where it is at fault.",
        examples=[EXAMPLE],
    )
    batch: str | None = Field(
        default=None, description="The batch that it belongs to.", examples=[None]
    )


class Job(JobSummary):
    """A tuning job."""

    result: TuningResult | None = Field(
        description="The settings found, once the job has ended with some.", examples=[None]
    )


class JobList(BaseModel):
    """One page of jobs, newest first."""

    items: list[JobSummary] = Field(description="The jobs.", examples=[[]])
    next: str | None = Field(
        description="Where the next page is; null on the last one.",
        examples=["/v1/tunings?cursor=41", None],
    )


def summary_to_dict(job: JobRecord) -> dict[str, Any]:
    """Return the job as the JSON object that `JobState` and the request beside it describe."""
    path = f"/v1/{job.resource}/{job.id}"
    return {
        "id": job.id,
        "status": job.snapshot.status,
        "progress": {"fraction": job.snapshot.fraction, "best": job.snapshot.best},
        "request": json.loads(job.request),
        "error": None if job.error is None else json.loads(job.error),
        "created_at": timestamp(job.created_at),
        "started_at": timestamp(job.started_at),
        "finished_at": timestamp(job.finished_at),
        "links": {"self": path, "events": f"{path}/events"},
    } | ({"batch": job.batch} if job.resource == TUNINGS else {})


def job_to_json(job: JobRecord) -> str:
    """Return the job as the JSON text that `Job` describes."""
    head = json.dumps(summary_to_dict(job), separators=(",", ":"))
    # The result is spliced in as text: it can be long, and the event loop serves others too.
    return f'{head[:-1]},"result":{job.result or "null"}}}'


def progress_to_json(snapshot: Snapshot) -> str:
    """Return status and progress as JSON text."""
    return json.dumps(
        {
            "status": snapshot.status,
            "progress": {"fraction": snapshot.fraction, "best": snapshot.best},
        }
    )


def timestamp(seconds: float | None) -> str | None:
    """Return a time in the form of RFC 3339."""
    if seconds is None:
        return None
    moment = datetime.fromtimestamp(seconds, UTC)
    return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")
