"""Tunings: jobs that find loop settings."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.responses import StreamingResponse

from service.http import bodies
from service.http.access import owner
from service.http.notices import is_allowed
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems
from service.jobs.engine import VERSION
from service.jobs.records import FINAL, Ended, Job, JobStatus, NewJob
from service.jobs.store import IdempotencyConflictError, QueueFullError, Store, UnfinishedError
from service.jobs.watch import Watcher
from service.problems import ConflictError, NotFoundError, ParameterError, RateError
from service.schemas import TuningRequest, canonical, computation
from service.schemas.jobs import Job as JobModel
from service.schemas.jobs import JobList, job_to_json, progress_to_json, summary_to_dict
from service.schemas.parsing import Fault
from solver.model.errors import InvalidInputError

__all__ = [
    "CallbackUrl",
    "IdempotencyKey",
    "JobId",
    "accepting",
    "check_callback",
    "find_job",
    "may_reuse",
    "new_job",
    "router",
]

router = APIRouter(prefix="/v1/tunings", tags=["tunings"])

_PING_SECONDS = 15.0

JobId = Annotated[
    str,
    Path(
        description="Identifier of the job.",
        pattern="^[0-9a-f]{32}$",
        examples=["9f1b0d3c5a7e4c0d8b6a2f4e1c3d5b7a"],
    ),
]
IdempotencyKey = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=255,
        description="A key of the caller's choice: the same key with the same request returns "
        "the job that it created first.",
        examples=["order-4711"],
    ),
]
CallbackUrl = Annotated[
    str | None,
    Header(
        alias="Callback-URL",
        max_length=2000,
        description="URL that gets a signed POST when all has ended, where the service allows it.",
        examples=["https://plant.example/hooks/mutune"],
    ),
]
Prefer = Annotated[
    str | None,
    Header(
        description="wait=N: answer with the finished job if it ends within N seconds.",
        examples=["wait=10"],
    ),
]
_LOCATION = {
    "Location": {"description": "URL path of the job.", "schema": {"type": "string"}},
}


def _store(request: Request) -> Store:
    store: Store = request.app.state.store
    return store


@router.post(
    "",
    status_code=202,
    summary="Start a tuning",
    responses={
        200: described(JobModel, "The job has ended (with `Prefer: wait=N`)."),
        202: {**described(JobModel, "The job is accepted and durable."), "headers": _LOCATION},
        **problems(*BODY_PROBLEMS, 409, 429, 503),
    },
    openapi_extra=bodies.described_body(TuningRequest),
)
async def post_tuning(
    request: Request,
    idempotency_key: IdempotencyKey = None,
    prefer: Prefer = None,
    callback_url: CallbackUrl = None,
) -> Response:
    """Accept a tuning as a job.

    A result of an equal request of the same caller is taken where there is one, and the job has
    ended at once; with `Cache-Control: no-cache` it is computed anew.
    """
    configuration = request.app.state.configuration
    body = await bodies.read(request, TuningRequest)
    new = await asyncio.to_thread(
        new_job, body, configuration.max_time_limit, reuse=may_reuse(request)
    )
    check_callback(request, callback_url)
    async with accepting():
        job = await asyncio.to_thread(
            _store(request).submit, owner(request), new, idempotency_key, callback_url
        )
    request.app.state.dispatcher.wake()
    headers = {"Location": f"/v1/tunings/{job.id}"}
    seconds = _preferred_wait(prefer, configuration.max_wait)
    if seconds is not None and job.snapshot.status not in FINAL:
        ended = await request.app.state.watcher.wait(job.id, seconds)
        job = await find_job(request, job.id) if ended is None else _after(job, ended)
    if seconds is not None:
        headers["Preference-Applied"] = f"wait={seconds:g}"
    status = 200 if job.snapshot.status in FINAL else 202
    return json_response(job_to_json(job), status, headers)


def _after(job: Job, ended: Ended) -> Job:
    """Return `job` as the table has it after its end: no need to read it back."""
    return replace(
        job,
        snapshot=ended.snapshot,
        started_at=ended.claim.started_at,
        finished_at=ended.finished_at,
        result=ended.outcome.result,
    )


def new_job(body: TuningRequest, longest: float, *, reuse: bool = True) -> NewJob:
    """Return the job that `body` asks for.

    Raises
    ------
    InvalidInputError
        A value that the mathematics cannot accept, or a time limit above `longest` seconds.

    """
    body.build()
    if body.search.time_limit > longest:
        message = f"this service computes for at most {longest:g} s"
        raise InvalidInputError(message, "/search/time_limit")
    return NewJob(
        canonical(body),
        body.search.time_limit,
        # Another version may find other digits.
        computation=f"{VERSION} {computation(body)}",
        reuse=reuse,
        identity=body.identity(),
    )


def check_callback(request: Request, url: str | None) -> None:
    """Refuse a URL that this service is not to call.

    Raises
    ------
    ParameterError
        It lies below none of the allowed ones.

    """
    if url is None or is_allowed(url, request.app.state.configuration.callback_urls):
        return
    message = "this service does not call that URL; see MUTUNE_CALLBACK_URLS"
    raise ParameterError(message, faults=(Fault("/header/callback-url", message),))


def may_reuse(request: Request) -> bool:
    """Whether the caller takes a result that is there already (RFC 9111)."""
    return "no-cache" not in request.headers.get("cache-control", "").lower()


@asynccontextmanager
async def accepting() -> AsyncIterator[None]:
    """Answer what can prevent that a job is accepted."""
    try:
        yield
    except IdempotencyConflictError:
        message = "This Idempotency-Key was used with another request."
        raise ConflictError(message) from None
    except QueueFullError:
        message = "Too many of your tunings wait in the queue; come back when some have ended."
        raise RateError(message, {"Retry-After": "30"}) from None


def _preferred_wait(prefer: str | None, longest: float) -> float | None:
    """Return the N of ``wait=N``; preferences that are not understood are ignored (RFC 7240)."""
    match = re.search(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,9})\"?(?:$|[,;\s])", prefer or "")
    return min(float(match[1]), longest) if match else None


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
    jobs = await asyncio.to_thread(
        _store(request).page,
        owner(request),
        below=cursor,
        limit=limit + 1,
        status=status,
        batch=batch,
    )
    more = len(jobs) > limit
    jobs = jobs[:limit]
    query = f"cursor={jobs[-1].sequence}&limit={limit}" if more else ""
    if status is not None:
        query += f"&status={status}"
    if batch is not None:
        query += f"&batch={batch}"
    page = {
        "items": [summary_to_dict(job) for job in jobs],
        "next": f"/v1/tunings?{query}" if more else None,
    }
    return json_response(json.dumps(page, separators=(",", ":")))


async def find_job(request: Request, job_id: str) -> Job:
    """Return a job of the caller.

    Raises
    ------
    NotFoundError
        There is none with this id.

    """
    try:
        return await asyncio.to_thread(_store(request).get, owner(request), job_id)
    except KeyError:
        message = f"There is no tuning {job_id}."
        raise NotFoundError(message) from None


@router.get(
    "/{job_id}",
    summary="Look at a tuning",
    responses={
        200: described(JobModel, "The job."),
        304: {"description": "The job has ended and is the one that the caller knows."},
        **problems(404, 422, 503),
    },
)
async def get_tuning(
    request: Request,
    job_id: JobId,
    if_none_match: Annotated[
        str | None, Header(description="ETag of the ended job that the caller knows.")
    ] = None,
) -> Response:
    """Return a job, with its result once it has one; an ended job never changes again."""
    job = await find_job(request, job_id)
    if job.snapshot.status not in FINAL:
        return json_response(job_to_json(job), headers={"Cache-Control": "no-store"})
    # Weak: the bytes differ where they are compressed.
    headers = {"ETag": f'W/"{job.id}"', "Cache-Control": "private, no-cache"}
    if if_none_match is not None and job.id in if_none_match:
        return Response(status_code=304, headers=headers)
    return json_response(job_to_json(job), headers=headers)


@router.delete(
    "/{job_id}",
    status_code=202,
    summary="Cancel a tuning",
    responses={
        200: described(JobModel, "The job has ended."),
        202: described(JobModel, "The job will stop soon, with the best so far if there is any."),
        **problems(404, 409, 422, 503),
    },
)
async def delete_tuning(
    request: Request,
    job_id: JobId,
    forget: Annotated[  # noqa: FBT002 - FastAPI's form of a query parameter
        bool,
        Query(description="Delete a job that has ended, for ever.", examples=[False]),
    ] = False,
) -> Response:
    """Cancel a job; it keeps the best so far, and one that has ended stays as it is.

    With `forget` a job that has ended is deleted, and answered as it was. One of a batch stays
    until the batch expires.
    """
    store = _store(request)
    try:
        which = store.forget if forget else store.cancel
        job = await asyncio.to_thread(which, owner(request), job_id)
    except KeyError:
        message = f"There is no tuning {job_id}."
        raise NotFoundError(message) from None
    except UnfinishedError:
        message = "Only a tuning of its own that has ended is deleted: cancel it first."
        raise ConflictError(message) from None
    request.app.state.dispatcher.wake()
    request.app.state.watcher.poke()
    return json_response(job_to_json(job), 200 if job.snapshot.status in FINAL else 202)


@router.get(
    "/{job_id}/events",
    summary="Follow a tuning",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "Server-sent events: `progress` with status and progress at each "
            "change, and `done` with the whole job at the end.",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        },
        **problems(404, 422, 503),
    },
)
async def follow_tuning(request: Request, job_id: JobId) -> Response:
    """Stream the progress of a job until it ends."""
    await find_job(request, job_id)  # 404 before the stream begins
    return StreamingResponse(
        _events(request, job_id),
        media_type="text/event-stream",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )


async def _events(request: Request, job_id: str) -> AsyncIterator[str]:
    watcher: Watcher = request.app.state.watcher
    changes = watcher.changes(job_id)
    pending = asyncio.ensure_future(anext(changes, None))
    try:
        while True:
            done, _ = await asyncio.wait({pending}, timeout=_PING_SECONDS)
            if not done:
                yield ": still here\n\n"
                continue
            snapshot = pending.result()
            if snapshot is None:
                return
            yield f"event: progress\ndata: {progress_to_json(snapshot)}\n\n"
            if snapshot.status in FINAL:
                yield f"event: done\ndata: {job_to_json(await find_job(request, job_id))}\n\n"
                return
            pending = asyncio.ensure_future(anext(changes, None))
    finally:
        pending.cancel()
