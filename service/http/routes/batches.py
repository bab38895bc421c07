"""Batches: many tunings accepted as one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from service.http import bodies
from service.http.access import owner
from service.http.json_stream import ArrayReader
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems
from service.http.routes.jobs import (
    CallbackUrl,
    IdempotencyKey,
    accepting,
    check_callback,
    may_reuse,
)
from service.http.routes.tunings import new_job
from service.jobs.records import Batch as BatchRecord
from service.jobs.records import NewJob
from service.problems import BodyTooLargeError, NotFoundError, describe
from service.schemas.batches import Batch, BatchList, BatchRequest, batch_to_json
from service.schemas.parsing import Fault, RequestError, parse_batch_tuning
from service.schemas.tunings import BatchTuningRequest
from solver.model.errors import InvalidInputError

__all__ = ["BatchId", "find_batch", "router"]

router = APIRouter(prefix="/v1/batches", tags=["tunings"])

_MAX_FAULTS = 100  # named at once
_BREATH = 10  # items parsed before others get their turn: about 2 ms

BatchId = Annotated[
    str,
    Path(
        description="Identifier of the batch.",
        pattern="^[0-9a-f]{32}$",
        examples=["0c9a4f7e2b6d4e1f8a3c5d7e9b1f2a4c"],
    ),
]


@router.post(
    "",
    status_code=202,
    summary="Start a batch",
    responses={
        202: {
            **described(Batch, "All tunings are accepted and durable."),
            "headers": {
                "Location": {"description": "URL path.", "schema": {"type": "string"}},
            },
        },
        **problems(*BODY_PROBLEMS, 409, 429, 503),
    },
    openapi_extra=bodies.described_body(BatchRequest, lines=BatchTuningRequest),
)
async def post_batch(
    request: Request, idempotency_key: IdempotencyKey = None, callback_url: CallbackUrl = None
) -> Response:
    """Accept up to 10,000 tunings at once: all of them, or none.

    As one JSON object, or as `application/x-ndjson`, a tuning a line. With `"on_error": "skip"`, or
    `?on_error=skip` for lines, faulty tunings are accepted as jobs that have failed.
    """
    check_callback(request, callback_url)
    jobs = await _jobs(request)
    if not jobs:
        raise RequestError((Fault("/tunings", "a batch has at least one tuning"),))
    async with accepting():
        batch = await asyncio.to_thread(
            request.app.state.store.submit_batch,
            owner(request),
            jobs,
            idempotency_key,
            callback_url,
        )
    request.app.state.dispatcher.wake()
    return json_response(batch_to_json(batch), 202, {"Location": f"/v1/batches/{batch.id}"})


async def _jobs(request: Request) -> list[NewJob]:
    """Parse the tunings one by one as they arrive; all faulty ones are named at once.

    Raises
    ------
    MediaTypeError, BodyTooLargeError, RequestError
        It is not declared as JSON or NDJSON, too large, or tunings in it are at fault.

    """
    configuration = request.app.state.configuration
    reuse = may_reuse(request)
    others: dict[str, object] = dict(request.query_params)
    jobs: list[NewJob] = []
    faults: list[Fault] = []
    is_json = True
    async for text in _texts(request, others):
        if len(jobs) >= configuration.max_batch_items:
            detail = f"a batch has at most {configuration.max_batch_items} tunings"
            raise RequestError((Fault("/tunings", detail),))
        pointer, longest = f"/tunings/{len(jobs)}", configuration.max_time_limit
        if len(text) > bodies.SHORT:
            job, error = await asyncio.to_thread(_job, text, pointer, longest, reuse=reuse)
        else:
            job, error = _job(text, pointer, longest, reuse=reuse)
        jobs.append(job)
        if error is not None:
            faults += error.faults
            is_json &= error.is_json
        if len(jobs) % _BREATH == 0:
            await asyncio.sleep(0)
    on_error = others.pop("on_error", "refuse")
    if others:
        detail = f"no such member: {', '.join(sorted(others))}"
        raise RequestError((Fault("", detail),))
    if on_error not in ("refuse", "skip"):
        raise RequestError((Fault("/on_error", "refuse or skip"),))
    if faults and on_error == "refuse":
        raise RequestError(tuple(faults[:_MAX_FAULTS]), is_json=is_json)
    return jobs


async def _texts(request: Request, others: dict[str, object]) -> AsyncIterator[bytes]:
    """Yield the text of each tuning; the other members of the body are put into `others`."""
    configuration = request.app.state.configuration
    stream = _limited(request, configuration.max_batch_bytes)
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type == bodies.NDJSON:
        rest = b""
        async for chunk in stream:
            *lines, rest = (rest + chunk).split(b"\n")
            if len(rest) > configuration.max_body_bytes:
                detail = f"a line has at most {configuration.max_body_bytes} bytes"
                raise RequestError((Fault("", detail),))
            for line in lines:
                if line.strip():
                    yield line
        if rest.strip():
            yield rest
        return
    bodies.check_media_type(request)
    reader = ArrayReader("tunings", configuration.max_body_bytes)
    async for text in reader.items(stream):
        yield text
    others |= reader.others


def _job(
    text: bytes, pointer: str, longest: float, *, reuse: bool
) -> tuple[NewJob, RequestError | None]:
    """Return the job that a text asks for, and what is wrong with it."""
    try:
        return new_job(parse_batch_tuning(text), longest, reuse=reuse), None
    except RequestError as error:
        fault = error
    except InvalidInputError as error:
        fault = RequestError((Fault(error.field, error.message),))
    problem = json.dumps(describe(fault))
    return NewJob(_as_object(text), 1.0, error=problem), fault.within(pointer)


def _as_object(text: bytes) -> str:
    """Return a faulty request as a JSON object: as it came, where it is one."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        value = text.decode(errors="replace")
    return json.dumps(value if isinstance(value, dict) else {"unreadable": value})


async def _limited(request: Request, limit: int) -> AsyncIterator[bytes]:
    size = 0
    async for chunk in request.stream():
        size += len(chunk)
        if size > limit:
            message = f"The limit is {limit} bytes."
            raise BodyTooLargeError(message, {"Connection": "close"})
        yield chunk


@router.get(
    "",
    summary="List batches",
    responses={200: described(BatchList, "The newest, newest first."), **problems(422, 503)},
)
async def list_batches(
    request: Request,
    limit: Annotated[int, Query(ge=1, le=100, description="Batches shown.", examples=[20])] = 20,
) -> Response:
    """Return the newest batches."""
    found = await asyncio.to_thread(request.app.state.store.batches, owner(request), limit=limit)
    items = ",".join(batch_to_json(batch) for batch in found)
    return json_response(f'{{"items":[{items}]}}')


@router.get(
    "/{batch_id}",
    summary="Look at a batch",
    responses={200: described(Batch, "The batch."), **problems(404, 422, 503)},
)
async def get_batch(request: Request, batch_id: BatchId) -> Response:
    """Return how far a batch is."""
    return json_response(batch_to_json(await find_batch(request, batch_id)))


@router.delete(
    "/{batch_id}",
    status_code=202,
    summary="Cancel a batch",
    responses={
        202: described(Batch, "What runs will stop within half a second."),
        **problems(404, 422, 503),
    },
)
async def delete_batch(request: Request, batch_id: BatchId) -> Response:
    """Cancel every tuning of a batch that has not ended."""
    batch = await _found(request, batch_id, request.app.state.store.cancel_batch)
    request.app.state.dispatcher.wake()
    request.app.state.watcher.poke()
    return json_response(batch_to_json(batch), 202)


async def find_batch(request: Request, batch_id: str) -> BatchRecord:
    """Return a batch of the caller.

    Raises
    ------
    NotFoundError
        There is none with this id.

    """
    return await _found(request, batch_id, request.app.state.store.get_batch)


async def _found(
    request: Request, batch_id: str, action: Callable[[str, str], BatchRecord]
) -> BatchRecord:
    try:
        return await asyncio.to_thread(action, owner(request), batch_id)
    except KeyError:
        message = f"There is no batch {batch_id}."
        raise NotFoundError(message) from None
