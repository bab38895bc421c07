"""Batches: many tunings accepted as one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import StreamingResponse

from service.http import bodies
from service.http.access import owner
from service.http.json_stream import ArrayReader
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems
from service.http.routes.tunings import IdempotencyKey, accepting, may_reuse, new_job
from service.jobs.records import FINAL, NewJob
from service.jobs.records import Batch as BatchRecord
from service.problems import BodyTooLargeError, NotFoundError, describe
from service.schemas.batches import Batch, BatchList, BatchRequest, batch_to_json, item_to_json
from service.schemas.parsing import Fault, RequestError, parse_tuning_request
from solver.model.errors import InvalidInputError

__all__ = ["router"]

router = APIRouter(prefix="/v1/batches", tags=["tunings"])

_LOOK = 0.5  # seconds between looks at what has ended out of turn
_PAGE = 100  # items read from the database at once
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
    openapi_extra=bodies.described_body(BatchRequest),
)
async def post_batch(request: Request, idempotency_key: IdempotencyKey = None) -> Response:
    """Accept up to 10,000 tunings at once: all of them, or none.

    As one JSON object, or as `application/x-ndjson`, a tuning a line. With `"on_error": "skip"`, or
    `?on_error=skip` for lines, faulty tunings are accepted as jobs that have failed.
    """
    jobs = await _jobs(request)
    if not jobs:
        raise RequestError((Fault("/tunings", "a batch has at least one tuning"),))
    async with accepting():
        batch = await asyncio.to_thread(
            request.app.state.store.submit_batch, owner(request), jobs, idempotency_key
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
        job, error = _job(text, f"/tunings/{len(jobs)}", configuration.max_time_limit, reuse=reuse)
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
    if media_type == "application/x-ndjson":
        rest = b""
        async for chunk in stream:
            *lines, rest = (rest + chunk).split(b"\n")
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
        return new_job(parse_tuning_request(text), longest, reuse=reuse), None
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
    except ValueError:
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
    return await _batch(request, batch_id, request.app.state.store.get_batch)


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
    response = await _batch(request, batch_id, request.app.state.store.cancel_batch, 202)
    request.app.state.dispatcher.wake()
    request.app.state.watcher.poke()
    return response


@router.get(
    "/{batch_id}/results",
    summary="Results of a batch",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "A line of JSON for each tuning, in order, as they come: "
            '`{"index": 0, "id": ..., "result": {...}}` or with "error" for "result".',
            "content": {"application/x-ndjson": {"schema": {"type": "string"}}},
        },
        **problems(404, 422, 503),
    },
)
async def get_results(
    request: Request,
    batch_id: BatchId,
    start: Annotated[
        int, Query(ge=0, lt=2**31, description="Index of the first line.", examples=[0])
    ] = 0,
    order: Annotated[
        Literal["index", "completion"],
        Query(description="completion: each as soon as it is there.", examples=["completion"]),
    ] = "index",
) -> Response:
    """Stream the results in order, waiting for those that are not there yet."""
    await _batch(request, batch_id, request.app.state.store.get_batch)
    stream = _results if order == "index" else _results_as_they_come
    return StreamingResponse(
        stream(request, batch_id, start),
        media_type="application/x-ndjson",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )


async def _results(request: Request, batch_id: str, start: int) -> AsyncIterator[str]:
    state = request.app.state
    while not state.watcher.closed:
        items = await asyncio.to_thread(state.store.batch_items, batch_id, start, _PAGE)
        if not items:
            return
        ended = []
        for item in items:
            if item.outcome.status not in FINAL:
                break
            ended.append(item_to_json(item))
        if ended:
            yield "".join(ended)
            start += len(ended)
        else:
            await state.watcher.wait(items[0].job_id, state.configuration.max_wait)


async def _results_as_they_come(request: Request, batch_id: str, start: int) -> AsyncIterator[str]:
    """Stream what has ended; look again for the rest, which is kept by position alone."""
    state = request.app.state
    waiting: set[int] | None = None
    while waiting is None or waiting:
        left: set[int] = set()
        position, end = (start, None) if waiting is None else (min(waiting), max(waiting))
        last = ""
        while end is None or position <= end:
            items = await asyncio.to_thread(state.store.batch_items, batch_id, position, _PAGE)
            if not items:
                break
            for item in items:
                if waiting is not None and item.position not in waiting:
                    continue
                if item.outcome.status in FINAL:
                    yield item_to_json(item)
                else:
                    left.add(item.position)
                    last = item.job_id
            position = items[-1].position + 1
        waiting = left
        if state.watcher.closed:
            return
        if waiting:
            await state.watcher.wait(last, _LOOK)


async def _batch(
    request: Request, batch_id: str, action: Callable[[str, str], BatchRecord], status: int = 200
) -> Response:
    try:
        batch = await asyncio.to_thread(action, owner(request), batch_id)
    except KeyError:
        message = f"There is no batch {batch_id}."
        raise NotFoundError(message) from None
    return json_response(batch_to_json(batch), status)
