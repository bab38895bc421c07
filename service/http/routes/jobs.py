"""What all jobs share over HTTP, whatever they compute: start, look, cancel, follow."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Annotated, Any

from fastapi import Header, Path, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel

from service.http.access import owner
from service.http.notices import is_allowed
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems
from service.jobs.engine import VERSION
from service.jobs.records import FINAL, TUNINGS, Ended, Job, NewJob
from service.jobs.store import IdempotencyConflictError, QueueFullError, Store, UnfinishedError
from service.jobs.watch import Watcher
from service.problems import ConflictError, NotFoundError, ParameterError, RateError
from service.schemas import canonical, computation
from service.schemas.fields import RecordedRequest
from service.schemas.jobs import job_to_json, progress_to_json
from service.schemas.parsing import Fault
from solver.model.errors import InvalidInputError

__all__ = [
    "FOLLOWED",
    "CallbackUrl",
    "Forget",
    "IdempotencyKey",
    "IfNoneMatch",
    "JobId",
    "Prefer",
    "accept",
    "accepting",
    "cancel",
    "check_callback",
    "find",
    "follow",
    "look",
    "looked_at",
    "may_reuse",
    "new_job",
    "refuse_longer",
    "started",
    "stopped",
    "store_of",
]

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
IfNoneMatch = Annotated[
    str | None, Header(description="ETag of the ended job that the caller knows.")
]
Forget = Annotated[
    bool, Query(description="Delete a job that has ended, for ever.", examples=[False])
]
_LOCATION = {
    "Location": {"description": "URL path of the job.", "schema": {"type": "string"}},
}


def started(model: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI descriptions of the answers to a request that starts a job."""
    return {
        200: described(model, "The job has ended (with `Prefer: wait=N`)."),
        202: {**described(model, "The job is accepted and durable."), "headers": _LOCATION},
        **problems(*BODY_PROBLEMS, 409, 429, 503),
    }


def looked_at(model: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI descriptions of the answers to a look at a job."""
    return {
        200: described(model, "The job."),
        304: {"description": "The job has ended and is the one that the caller knows."},
        **problems(404, 422, 503),
    }


def stopped(model: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI descriptions of the answers to a cancellation."""
    return {
        200: described(model, "The job has ended."),
        202: described(model, "The job will stop soon, with the best so far if there is any."),
        **problems(404, 409, 422, 503),
    }


FOLLOWED: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "Server-sent events: `progress` with status and progress at each "
        "change, and `done` with the whole job at the end.",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    },
    **problems(404, 422, 503),
}


def store_of(request: Request) -> Store:
    """Return the job table."""
    store: Store = request.app.state.store
    return store


async def accept(
    request: Request,
    new: NewJob,
    *,
    idempotency_key: str | None,
    prefer: str | None,
    callback_url: str | None,
) -> Response:
    """Accept a job, and answer with it: at once, or when it ends within the preferred wait."""
    check_callback(request, callback_url)
    async with accepting():
        job = await asyncio.to_thread(
            store_of(request).submit, owner(request), new, idempotency_key, callback_url
        )
    request.app.state.dispatcher.wake()
    headers = {"Location": f"/v1/{job.resource}/{job.id}"}
    seconds = _preferred_wait(prefer, request.app.state.configuration.max_wait)
    if seconds is not None and job.snapshot.status not in FINAL:
        ended = await request.app.state.watcher.wait(job.id, seconds)
        job = await find(request, job.id, job.resource) if ended is None else _after(job, ended)
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


def refuse_longer(seconds: float, longest: float) -> None:
    """Raise InvalidInputError for a time limit above the `longest` of this service."""
    if seconds > longest:
        message = f"this service computes for at most {longest:g} s"
        raise InvalidInputError(message, "/search/time_limit")


def new_job(
    body: RecordedRequest, seconds: float, *, reuse: bool, resource: str = TUNINGS
) -> NewJob:
    """Return the job that a request asks for, of at most so many seconds."""
    return NewJob(
        canonical(body),
        seconds,
        # Another version may find other digits.
        computation=f"{VERSION} {computation(body)}",
        reuse=reuse,
        identity=body.identity(),
        resource=resource,
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
        message = "Too many of your jobs wait in the queue; come back when some have ended."
        raise RateError(message, {"Retry-After": "30"}) from None


def _preferred_wait(prefer: str | None, longest: float) -> float | None:
    """Return the N of ``wait=N``; preferences that are not understood are ignored (RFC 7240)."""
    match = re.search(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,9})\"?(?:$|[,;\s])", prefer or "")
    return min(float(match[1]), longest) if match else None


async def find(request: Request, job_id: str, resource: str = TUNINGS) -> Job:
    """Return a job of the caller.

    Raises
    ------
    NotFoundError
        There is none with this id.

    """
    try:
        return await asyncio.to_thread(store_of(request).get, owner(request), job_id, resource)
    except KeyError:
        raise NotFoundError(_absent(job_id, resource)) from None


def _absent(job_id: str, resource: str) -> str:
    return f"There is no {resource.removesuffix('s')} {job_id}."


async def look(request: Request, job_id: str, known: str | None, resource: str) -> Response:
    """Answer with a job, unless it has ended and is the one that the caller has."""
    job = await find(request, job_id, resource)
    if job.snapshot.status not in FINAL:
        return json_response(job_to_json(job), headers={"Cache-Control": "no-store"})
    # Weak: the bytes differ where they are compressed.
    headers = {"ETag": f'W/"{job.id}"', "Cache-Control": "private, no-cache"}
    if known is not None and job.id in known:
        return Response(status_code=304, headers=headers)
    return json_response(job_to_json(job), headers=headers)


async def cancel(request: Request, job_id: str, resource: str, *, forget: bool) -> Response:
    """Cancel a job, or with `forget` delete one that has ended, and answer with it."""
    store = store_of(request)
    try:
        which = store.forget if forget else store.cancel
        job = await asyncio.to_thread(which, owner(request), job_id, resource)
    except KeyError:
        raise NotFoundError(_absent(job_id, resource)) from None
    except UnfinishedError:
        one = resource.removesuffix("s")
        message = f"Only a job of its own that has ended is deleted: cancel the {one} first."
        raise ConflictError(message) from None
    request.app.state.dispatcher.wake()
    request.app.state.watcher.poke()
    return json_response(job_to_json(job), 200 if job.snapshot.status in FINAL else 202)


async def follow(request: Request, job_id: str, resource: str) -> Response:
    """Stream the progress of a job until it ends."""
    await find(request, job_id, resource)  # 404 before the stream begins
    return StreamingResponse(
        _events(request, job_id, resource),
        media_type="text/event-stream",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )


async def _events(request: Request, job_id: str, resource: str) -> AsyncIterator[str]:
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
                job = await find(request, job_id, resource)
                yield f"event: done\ndata: {job_to_json(job)}\n\n"
                return
            pending = asyncio.ensure_future(anext(changes, None))
    finally:
        pending.cancel()
