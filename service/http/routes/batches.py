"""Batches: many tunings accepted as one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import StreamingResponse

from service.http import bodies
from service.http.access import owner
from service.http.json_stream import ArrayReader
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems
from service.http.routes.tunings import IdempotencyKey, accepting, new_job
from service.jobs.records import FINAL, NewJob
from service.jobs.records import Batch as BatchRecord
from service.problems import BodyTooLargeError, NotFoundError
from service.schemas.batches import Batch, BatchRequest, batch_to_json, item_to_json
from service.schemas.fields import below
from service.schemas.parsing import Fault, RequestError, parse_tuning_request

__all__ = ["router"]

router = APIRouter(prefix="/v1/batches", tags=["tunings"])

_PAGE = 100  # items read from the database at once
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
    """Accept up to 10,000 tunings at once: all of them, or none."""
    bodies.check_media_type(request)
    jobs = [job async for job in _jobs(request)]
    if not jobs:
        raise RequestError((Fault("/tunings", "a batch has at least one tuning"),))
    async with accepting():
        batch = await asyncio.to_thread(
            request.app.state.store.submit_batch, owner(request), jobs, idempotency_key
        )
    request.app.state.dispatcher.wake()
    return json_response(batch_to_json(batch), 202, {"Location": f"/v1/batches/{batch.id}"})


async def _jobs(request: Request) -> AsyncIterator[NewJob]:
    """Parse the tunings one by one as they arrive."""
    configuration = request.app.state.configuration
    reader = ArrayReader("tunings", configuration.max_body_bytes)
    index = 0
    async for text in reader.items(_limited(request, configuration.max_batch_bytes)):
        pointer = f"/tunings/{index}"
        if index >= configuration.max_batch_items:
            detail = f"a batch has at most {configuration.max_batch_items} tunings"
            raise RequestError((Fault("/tunings", detail),))
        try:
            body = parse_tuning_request(text)
        except RequestError as error:
            raise error.within(pointer) from None
        with below(pointer):
            yield new_job(body, configuration.max_time_limit)
        index += 1
        if index % _BREATH == 0:
            await asyncio.sleep(0)


async def _limited(request: Request, limit: int) -> AsyncIterator[bytes]:
    size = 0
    async for chunk in request.stream():
        size += len(chunk)
        if size > limit:
            message = f"The limit is {limit} bytes."
            raise BodyTooLargeError(message, {"Connection": "close"})
        yield chunk


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
) -> Response:
    """Stream the results in order, waiting for those that are not there yet."""
    await _batch(request, batch_id, request.app.state.store.get_batch)
    return StreamingResponse(
        _results(request, batch_id, start),
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


async def _batch(
    request: Request, batch_id: str, action: Callable[[str, str], BatchRecord], status: int = 200
) -> Response:
    try:
        batch = await asyncio.to_thread(action, owner(request), batch_id)
    except KeyError:
        message = f"There is no batch {batch_id}."
        raise NotFoundError(message) from None
    return json_response(batch_to_json(batch), status)
