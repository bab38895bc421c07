"""Tunings: jobs that find loop settings."""

from __future__ import annotations

import asyncio
import json
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import StreamingResponse

from service.http import bodies
from service.http.access import owner
from service.http.routes import jobs
from service.http.routes.common import described, json_response, problems
from service.jobs.records import TUNINGS, JobStatus, NewJob
from service.schemas import TuningRequest
from service.schemas.jobs import Job, JobList, summary_to_dict

__all__ = ["new_job", "router"]

router = APIRouter(prefix=f"/v1/{TUNINGS}", tags=["tunings"])


@router.post(
    "",
    status_code=202,
    summary="Start a tuning",
    responses=jobs.started(Job),
    openapi_extra=bodies.described_body(TuningRequest),
)
async def post_tuning(
    request: Request,
    idempotency_key: jobs.IdempotencyKey = None,
    prefer: jobs.Prefer = None,
    callback_url: jobs.CallbackUrl = None,
) -> Response:
    """Accept a tuning as a job.

    A result of an equal request of the same caller is taken where there is one, and the job has
    ended at once; with `Cache-Control: no-cache` it is computed anew.
    """
    body = await bodies.read(request, TuningRequest)
    longest = request.app.state.configuration.max_time_limit
    new = await asyncio.to_thread(new_job, body, longest, reuse=jobs.may_reuse(request))
    return await jobs.accept(
        request, new, idempotency_key=idempotency_key, prefer=prefer, callback_url=callback_url
    )


def new_job(body: TuningRequest, longest: float, *, reuse: bool = True) -> NewJob:
    """Return the job that `body` asks for.

    Raises
    ------
    InvalidInputError
        A value that the mathematics cannot accept, or a time limit above `longest` seconds.

    """
    body.build()
    jobs.refuse_longer(body.search.time_limit, longest)
    return jobs.new_job(body, body.search.time_limit, reuse=reuse)


@router.get(
    "",
    summary="List tunings",
    responses={200: described(JobList, "One page, newest first."), **problems(422, 503)},
)
async def list_tunings(
    request: Request,
    cursor: Annotated[
        int | None,
        Query(ge=1, lt=2**63, description="From the `next` of the page before.", examples=[41]),
    ] = None,
    limit: Annotated[int, Query(ge=1, le=100, description="Jobs on a page.", examples=[20])] = 20,
    status: Annotated[
        JobStatus | None, Query(description="Only jobs in this state.", examples=["running"])
    ] = None,
    batch: Annotated[
        str | None,
        Query(
            description="Only jobs of this batch.",
            pattern="^[0-9a-f]{32}$",
            examples=["0c9a4f7e2b6d4e1f8a3c5d7e9b1f2a4c"],
        ),
    ] = None,
) -> Response:
    """Return a page of jobs, without their results."""
    found = await asyncio.to_thread(
        jobs.store_of(request).page,
        owner(request),
        below=cursor,
        limit=limit + 1,
        status=status,
        batch=batch,
    )
    more = len(found) > limit
    found = found[:limit]
    query = f"cursor={found[-1].sequence}&limit={limit}" if more else ""
    if status is not None:
        query += f"&status={status}"
    if batch is not None:
        query += f"&batch={batch}"
    page = {
        "items": [summary_to_dict(job) for job in found],
        "next": f"/v1/tunings?{query}" if more else None,
    }
    return json_response(json.dumps(page, separators=(",", ":")))


@router.get("/{job_id}", summary="Look at a tuning", responses=jobs.looked_at(Job))
async def get_tuning(
    request: Request, job_id: jobs.JobId, if_none_match: jobs.IfNoneMatch = None
) -> Response:
    """Return a job, with its result once it has one; an ended job never changes again."""
    return await jobs.look(request, job_id, if_none_match, TUNINGS)


@router.delete("/{job_id}", status_code=202, summary="Cancel a tuning", responses=jobs.stopped(Job))
async def delete_tuning(
    request: Request,
    job_id: jobs.JobId,
    forget: jobs.Forget = False,  # noqa: FBT002 - FastAPI's form of a parameter
) -> Response:
    """Cancel a job; it keeps the best so far, and one that has ended stays as it is.

    With `forget` a job that has ended is deleted, and answered as it was. One of a batch stays
    until the batch expires.
    """
    return await jobs.cancel(request, job_id, TUNINGS, forget=forget)


@router.get(
    "/{job_id}/events",
    summary="Follow a tuning",
    response_class=StreamingResponse,
    responses=jobs.FOLLOWED,
)
async def follow_tuning(request: Request, job_id: jobs.JobId) -> Response:
    """Stream the progress of a job until it ends."""
    return await jobs.follow(request, job_id, TUNINGS)
