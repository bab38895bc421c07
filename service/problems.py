"""Errors as RFC 9457 problem details, from one table of exceptions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from service.schemas.parsing import Fault, RequestError
from solver.errors import InvalidInputError, UnsupportedPlantError

__all__ = ["MEDIA_TYPE", "Problem", "ProblemError", "describe", "install"]

MEDIA_TYPE = "application/problem+json"


class FaultModel(BaseModel):
    """One fault of the request."""

    pointer: str = Field(
        description="JSON pointer (RFC 6901) of the faulty value in the request body.",
        examples=["/plant/n"],
    )
    detail: str = Field(
        description="What is wrong there.", examples=["Input should be greater than or equal to 1"]
    )


class Problem(BaseModel):
    """An error, in the form of RFC 9457."""

    type: str = Field(
        description="Kind of problem; the same kind has the same type.",
        examples=["urn:mutune:problem:invalid-request"],
    )
    title: str = Field(
        description="The kind in words.", examples=["The request does not match its schema"]
    )
    status: int = Field(description="HTTP status.", examples=[422])
    detail: str = Field(
        description="What happened this time.",
        examples=["/plant/n: Input should be greater than or equal to 1"],
    )
    errors: list[FaultModel] = Field(
        description="The faulty values; empty where the fault is not in the body.",
        examples=[[{"pointer": "/plant/n", "detail": "Input should be at least 1"}]],
    )


@dataclass(frozen=True)
class _Kind:
    status: int
    slug: str
    title: str


class ProblemError(Exception):
    """A request that ends with a problem.

    Subclasses name their kind in the table below.

    Parameters
    ----------
    detail : str
        What happened this time.
    headers : mapping
        Headers of the answer.

    """

    def __init__(self, detail: str, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(detail)
        self.detail = detail
        self.headers = dict(headers or {})


class BodyTooLargeError(ProblemError):
    """The request body exceeds its limit."""


class MediaTypeError(ProblemError):
    """The request body is of a kind that the operation does not read."""


class NotFoundError(ProblemError):
    """There is no such resource, or it is another key's."""


class ConflictError(ProblemError):
    """The request contradicts an earlier one or the state of the resource."""


class AnalysisTimeoutError(ProblemError):
    """An analysis exceeded its time limit."""


class TimeLimitError(ProblemError):
    """A job exceeded its time limit and had to be stopped."""


class WorkerDiedError(ProblemError):
    """The worker process died each time that it ran the job."""


class UnavailableError(ProblemError):
    """Something that the request needs does not answer now."""


_NOT_JSON = _Kind(400, "not-json", "The body is not JSON")
_INTERNAL = _Kind(500, "internal", "Internal error")

_KINDS: dict[type[Exception], _Kind] = {
    RequestError: _Kind(422, "invalid-request", "The request does not match its schema"),
    RequestValidationError: _Kind(422, "invalid-parameter", "A parameter is not valid"),
    UnsupportedPlantError: _Kind(422, "unsupported-plant", "The plant is not supported"),
    InvalidInputError: _Kind(422, "invalid-input", "The mathematics cannot accept a value"),
    BodyTooLargeError: _Kind(413, "body-too-large", "The body is too large"),
    MediaTypeError: _Kind(415, "media-type", "The body must be JSON"),
    NotFoundError: _Kind(404, "not-found", "Not found"),
    ConflictError: _Kind(409, "conflict", "Conflict"),
    AnalysisTimeoutError: _Kind(503, "analysis-timeout", "The analysis took too long"),
    TimeLimitError: _Kind(503, "time-limit", "The time limit is over"),
    WorkerDiedError: _Kind(500, "worker-died", "The job kills its worker"),
    UnavailableError: _Kind(503, "unavailable", "Not available now"),
}


@dataclass(frozen=True)
class _Description:
    kind: _Kind
    detail: str
    faults: tuple[Fault, ...] = ()
    headers: dict[str, str] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        return {
            "type": f"urn:mutune:problem:{self.kind.slug}",
            "title": self.kind.title,
            "status": self.kind.status,
            "detail": self.detail,
            "errors": [{"pointer": fault.pointer, "detail": fault.detail} for fault in self.faults],
        }


def describe(error: Exception) -> dict[str, Any]:
    """Return the problem document of `error`; anything unforeseen is an internal error."""
    return _description(error).document()


def install(app: FastAPI) -> None:
    """Make `app` answer every error as a problem."""
    for kind in (*_KINDS, HTTPException, Exception):
        app.add_exception_handler(kind, _answer)


async def _answer(_request: Request, error: Exception) -> Response:
    description = _description(error)
    return Response(
        json.dumps(description.document()),
        status_code=description.kind.status,
        media_type=MEDIA_TYPE,
        headers=description.headers,
    )


def _description(error: Exception) -> _Description:
    if isinstance(error, HTTPException):
        slug = error.detail.lower().replace(" ", "-")
        kind = _Kind(error.status_code, slug, error.detail)
        return _Description(kind, error.detail, headers=dict(error.headers or {}))
    kind = next((_KINDS[base] for base in type(error).__mro__ if base in _KINDS), _INTERNAL)
    match error:
        case RequestError():
            if not error.is_json:
                kind = _NOT_JSON
            return _Description(kind, str(error), error.faults)
        case RequestValidationError():
            faults = tuple(
                Fault(f"/{'/'.join(str(part) for part in item['loc'])}", item["msg"])
                for item in error.errors()
            )
            return _Description(kind, str(RequestError(faults)), faults)
        case InvalidInputError():
            return _Description(kind, error.message, (Fault(error.field, error.message),))
        case ProblemError():
            return _Description(kind, error.detail, headers=error.headers)
    return _Description(kind, "The service met a fault of its own; it is in its log.")
