"""Batches as JSON."""

from __future__ import annotations

import json
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from service.jobs.records import Batch as BatchRecord
from service.jobs.records import BatchItem, JobStatus
from service.problems import CancelledError, Problem, describe
from service.schemas.fields import RequestModel
from service.schemas.jobs import Timestamp, timestamp
from service.schemas.tunings import EXAMPLE, BatchTuningRequest, TuningResult

__all__ = ["Batch", "BatchLine", "BatchList", "BatchRequest", "batch_to_json", "item_to_json"]

MAX_ITEMS = 10_000
_ID = "0c9a4f7e2b6d4e1f8a3c5d7e9b1f2a4c"


class BatchRequest(RequestModel):
    """Many tunings as one batch."""

    tunings: Annotated[
        tuple[BatchTuningRequest, ...], Field(min_length=1, max_length=MAX_ITEMS)
    ] = Field(
        description="The tunings; equal ones are computed once. All are accepted, or none.",
        examples=[[EXAMPLE]],
    )

    on_error: Literal["refuse", "skip"] = Field(
        default="refuse",
        description="refuse: a faulty tuning has the whole batch refused; skip: it becomes a job "
        "that has failed.",
        examples=["skip"],
    )


class BatchStates(BaseModel):
    """Number of items in each state."""

    queued: int = Field(description="Waiting for a worker.", examples=[90])
    running: int = Field(description="Being computed.", examples=[2])
    succeeded: int = Field(description="Ended with a result.", examples=[8])
    failed: int = Field(description="Ended with an error.", examples=[0])
    cancelled: int = Field(description="Cancelled.", examples=[0])
    timed_out: int = Field(description="Ended by their time limit.", examples=[0])


class BatchLinks(BaseModel):
    """Where to go from a batch."""

    self: str = Field(description="The batch.", examples=[f"/v1/batches/{_ID}"])
    results: str = Field(
        description="Its results, in order, as they come.",
        examples=[f"/v1/batches/{_ID}/results"],
    )


class Batch(BaseModel):
    """A batch of tunings."""

    id: str = Field(description="Identifier.", examples=[_ID])
    status: Literal["running", "finished"] = Field(
        description="finished: every item has ended.", examples=["running"]
    )
    count: int = Field(description="Number of items.", examples=[100])
    states: BatchStates = Field(
        description="Number of items in each state.",
        examples=[
            {
                "queued": 90,
                "running": 2,
                "succeeded": 8,
                "failed": 0,
                "cancelled": 0,
                "timed_out": 0,
            }
        ],
    )
    created_at: Timestamp = Field(
        description="When it was accepted (UTC).", examples=["2026-01-31T12:00:00.000000Z"]
    )
    links: BatchLinks = Field(
        description="Where to go from here.",
        examples=[{"self": f"/v1/batches/{_ID}", "results": f"/v1/batches/{_ID}/results"}],
    )


class BatchLine(BaseModel):
    """A line of the results of a batch: `result`, or `error` where there is none."""

    index: int = Field(description="Place in the batch, from 0.", examples=[0])
    id: str = Field(description="Identifier of the job.", examples=[_ID])
    result: TuningResult | None = Field(
        default=None, description="The settings found.", examples=[None]
    )
    error: Problem | None = Field(default=None, description="Why there are none.", examples=[None])


class BatchList(BaseModel):
    """The newest batches, newest first."""

    items: list[Batch] = Field(description="The batches.", examples=[[]])


def batch_to_json(batch: BatchRecord) -> str:
    """Return the batch as the JSON text that `Batch` describes."""
    path = f"/v1/batches/{batch.id}"
    return json.dumps(
        {
            "id": batch.id,
            "status": "finished" if batch.finished else "running",
            "count": batch.count,
            "states": {status: batch.states.get(status, 0) for status in JobStatus},
            "created_at": timestamp(batch.created_at),
            "links": {"self": path, "results": f"{path}/results"},
        }
    )


def item_to_json(item: BatchItem, *, curves: bool = True) -> str:
    """Return an ended item as a line of JSON: its index, its job, and result or error."""
    head = f'{{"index":{item.position},"id":"{item.job_id}",'
    outcome = item.outcome
    if outcome.result is not None:
        result = outcome.result if curves else _without_curves(outcome.result)
        return f'{head}"result":{result}}}\n'
    error = outcome.error or json.dumps(describe(CancelledError("The tuning was cancelled.")))
    return f'{head}"error":{error}}}\n'


def _without_curves(result: str) -> str:
    return json.dumps(json.loads(result) | {"curves": None}, separators=(",", ":"))
