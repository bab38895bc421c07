"""What the routes share: described errors and results, and common parameters."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any, ParamSpec

from fastapi import Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel
from starlette.datastructures import State
from starlette.requests import ClientDisconnect

from service.http.access import owner
from service.jobs.pool import Pool
from service.problems import MEDIA_TYPE, Problem, UnavailableError
from service.schemas.figures import FiguresResult

__all__ = [
    "BODY_PROBLEMS",
    "FIGURES",
    "Unit",
    "answer",
    "computed",
    "described",
    "json_response",
    "problems",
]


_P = ParamSpec("_P")
_PART = 65_536  # bytes of an answer that are compressed at once: a millisecond or two
_ROOM = 200_000_000  # bytes of long answers that wait for their callers

_REASONS = {
    400: "The body is not JSON.",
    404: "There is no such resource.",
    401: "A valid API key is needed.",
    403: "The API key does not permit this.",
    409: "The request contradicts an earlier one.",
    413: "The body is too large.",
    415: "The body is not declared as JSON.",
    422: "A value is not valid; `errors` names it.",
    429: "Too many requests, or too much in the queue; see Retry-After.",
    503: "Not available now; try again after the time in Retry-After.",
}
Unit = Annotated[
    str,
    Query(
        max_length=20,
        # It becomes part of titles, which Plotly reads as HTML.
        pattern=r"^[^<>&\x00-\x1f]+$",
        description="Name of the unit of time.",
        examples=["min"],
    ),
]

BODY_PROBLEMS = (400, 413, 415, 422)


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI descriptions of these error statuses."""
    schema = {"$ref": f"#/components/schemas/{Problem.__name__}"}
    return {
        status: {
            "model": Problem,
            "description": _REASONS[status],
            "content": {MEDIA_TYPE: {"schema": schema}},
        }
        for status in statuses
    }


def described(model: type[BaseModel], description: str) -> dict[str, Any]:
    """Return the OpenAPI description of a response of the form `model`."""
    return {"model": model, "description": description}


def json_response(
    content: str | bytes, status: int = 200, headers: dict[str, str] | None = None
) -> Response:
    """Return a response with JSON text."""
    return Response(content, status, headers, media_type="application/json")


def answer(request: Request, content: bytes) -> Response:
    """Return a response with the JSON text of a computation, in parts where it is long.

    A part is compressed and sent at a time, as fast as the caller takes it, and others are served
    between two parts.

    Raises
    ------
    UnavailableError
        So many long ones are on their way already that there is no room for another one.

    """
    if len(content) <= _PART:
        return json_response(content)
    state = request.app.state
    if state.on_their_way + len(content) > _ROOM:
        message = "Other callers have not yet taken their long answers."
        raise UnavailableError(message, {"Retry-After": "10"})
    return StreamingResponse(_parts(state, content), media_type="application/json")


async def _parts(state: State, content: bytes) -> AsyncIterator[bytes]:
    state.on_their_way += len(content)
    try:
        for start in range(0, len(content), _PART):
            yield content[start : start + _PART]
    finally:
        state.on_their_way -= len(content)


async def computed(
    request: Request, compute: Callable[_P, dict[str, Any]], *args: _P.args, **kwargs: _P.kwargs
) -> bytes:
    """Return what `Pool.run` returns, as long as the caller waits for it.

    Raises
    ------
    ClientDisconnect
        The caller has left; the computation has ended.

    """
    pool: Pool = request.app.state.pool
    computing = asyncio.ensure_future(pool.run(owner(request), compute, *args, **kwargs))
    leaving = asyncio.ensure_future(_left(request))
    try:
        await asyncio.wait({computing, leaving}, return_when=asyncio.FIRST_COMPLETED)
        if not computing.done():
            raise ClientDisconnect
        return await computing
    finally:
        computing.cancel()
        leaving.cancel()
        await asyncio.gather(computing, leaving, return_exceptions=True)


async def _left(request: Request) -> None:
    """Return when the caller has closed the connection."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


FIGURES = described(FiguresResult, "The figures.")
