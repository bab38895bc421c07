"""Request bodies: read within a limit, parsed by their schema, described in OpenAPI."""

from __future__ import annotations

import asyncio
from typing import Any, TypeVar

from fastapi import Request
from pydantic import BaseModel

from service.problems import BodyTooLargeError, MediaTypeError
from service.schemas.parsing import parse

__all__ = [
    "NDJSON",
    "REFERENCE",
    "SHORT",
    "described_body",
    "described_lines",
    "read",
    "read_bytes",
    "schemas",
]

REFERENCE = "#/components/schemas/{model}"

NDJSON = "application/x-ndjson"
_FORGOTTEN = 8_000_000  # bytes
SHORT = 10_000  # bytes that are parsed in about a millisecond; more are in another thread

_Model = TypeVar("_Model", bound=BaseModel)


async def read(request: Request, model: type[_Model]) -> _Model:
    """Return the body of `request` as a `model`.

    Raises
    ------
    MediaTypeError, BodyTooLargeError, RequestError
        It is not declared as JSON, too large, or does not match the schema.

    """
    text = await read_bytes(request)
    if len(text) <= SHORT:
        return parse(model, text)
    # One at a time: its faults may take hundreds of megabytes, and side by side none is faster.
    async with request.app.state.parsing:
        return await asyncio.to_thread(parse, model, text)


async def read_bytes(request: Request) -> bytes:
    """Return the body of `request`, which must be declared as JSON.

    Raises
    ------
    MediaTypeError, BodyTooLargeError
        It is not declared as JSON, or too large; reading stops at the limit.

    """
    check_media_type(request)
    limit: int = request.app.state.configuration.max_body_bytes
    chunks: list[bytes] = []
    size = 0
    async for chunk in request.stream():
        size += len(chunk)
        # A connection closed with unread data is reset, and the response may be lost with it: a
        # body not far beyond the limit is read to its end, and forgotten.
        if size > limit + _FORGOTTEN:
            break
        if size <= limit:
            chunks.append(chunk)
    if size > limit:
        message = f"The limit is {limit} bytes."
        raise BodyTooLargeError(message, {"Connection": "close"})
    return b"".join(chunks)


def check_media_type(request: Request) -> None:
    """Refuse a body that is not declared as JSON.

    Raises
    ------
    MediaTypeError
        The Content-Type header is absent or names another type.

    """
    header = request.headers.get("content-type", "")
    media_type = header.partition(";")[0].strip().lower()
    if media_type != "application/json":
        message = "Send the body with Content-Type: application/json."
        raise MediaTypeError(message, {"Accept-Post": "application/json"})


def described_lines(model: type[BaseModel]) -> dict[str, Any]:
    """Return the OpenAPI content of lines of JSON, each of the form `model`."""
    return {NDJSON: {"schema": _reference(model)}}


def described_body(
    model: type[BaseModel], *, lines: type[BaseModel] | None = None
) -> dict[str, Any]:
    """Return the OpenAPI description of a required body that `read` parses as `model`.

    With `lines` the body may be lines of that form instead.
    """
    content = {"application/json": {"schema": _reference(model)}}
    if lines is not None:
        content |= described_lines(lines)
    return {"requestBody": {"required": True, "content": content}}


# Schemas of these take a third of a second of every start, so the document alone asks for them.
_described: dict[str, type[BaseModel]] = {}


def _reference(model: type[BaseModel]) -> dict[str, str]:
    name = model.model_config.get("title") or model.__name__
    if _described.setdefault(name, model) is not model:
        message = f"two different bodies are called {name}"
        raise ValueError(message)
    return {"$ref": REFERENCE.format(model=name)}


def schemas(reference: str) -> dict[str, Any]:
    """Return the schema of a described body, and those of its parts, by their names.

    Parameters
    ----------
    reference : str
        As it stands in the description; that of anything else has no schemas here.

    """
    name = reference.rpartition("/")[2]
    if name not in _described:
        return {}
    schema = _described[name].model_json_schema(ref_template=REFERENCE)
    return {**schema.pop("$defs", {}), name: schema}
