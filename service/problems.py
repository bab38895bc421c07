"""Errors as RFC 9457 problem details, from one table of exceptions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel, Field

from service.schemas.parsing import Fault, RequestError
from solver.model.errors import InvalidInputError, UnsupportedPlantError

__all__ = [
    "KINDS",
    "MEDIA_TYPE",
    "AmbiguousError",
    "AnalysisMemoryError",
    "AnalysisTimeoutError",
    "BodyTooLargeError",
    "CancelledError",
    "ConflictError",
    "EffortError",
    "ForbiddenError",
    "LargeHeadError",
    "MediaTypeError",
    "MethodError",
    "MisdirectedError",
    "NotFoundError",
    "NumbersError",
    "ParameterError",
    "Problem",
    "ProblemError",
    "RateError",
    "SlowBodyError",
    "TimeLimitError",
    "UnauthorizedError",
    "UnavailableError",
    "WorkerDiedError",
    "describe",
]

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


class ProblemError(Exception):
    """A request that ends with a problem.

    Parameters
    ----------
    detail : str
        What happened this time.
    headers : mapping
        Headers of the response.
    faults : tuple of Fault
        The faulty values.

    """

    def __init__(
        self,
        detail: str,
        headers: Mapping[str, str] | None = None,
        faults: tuple[Fault, ...] = (),
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.headers = dict(headers or {})
        self.faults = faults


class ParameterError(ProblemError):
    """A parameter in path, query or header is not valid."""


class NumbersError(ProblemError):
    """Numbers so far apart that double precision cannot hold the result."""

    def __init__(self) -> None:
        super().__init__("The numbers are too large, too small or too far apart to compute with.")

    def __reduce__(self) -> tuple[type[NumbersError], tuple[()]]:
        """Cross a process boundary."""
        return NumbersError, ()


class BodyTooLargeError(ProblemError):
    """The request body exceeds its limit."""


class MediaTypeError(ProblemError):
    """The request body is of a kind that the operation does not read."""


class SlowBodyError(ProblemError):
    """The request body comes too slowly."""


class LargeHeadError(ProblemError):
    """Request line and headers exceed their limit."""


class AmbiguousError(ProblemError):
    """The request could be read in two ways."""


class MisdirectedError(ProblemError):
    """The request is addressed to a name that is not this service's."""


class EffortError(ProblemError):
    """The request asks for more than can be computed while its caller waits."""


class UnauthorizedError(ProblemError):
    """The request carries no valid API key."""


class ForbiddenError(ProblemError):
    """The API key does not permit this."""


class RateError(ProblemError):
    """The caller asks too often, or has too much in the queue."""


class NotFoundError(ProblemError):
    """There is no such resource, or it is another key's."""


class MethodError(ProblemError):
    """The resource does not have this method."""


class ConflictError(ProblemError):
    """The request contradicts an earlier one or the state of the resource."""


class AnalysisTimeoutError(ProblemError):
    """An analysis exceeded its time limit."""


class AnalysisMemoryError(ProblemError):
    """An analysis needs more memory than the service gives it."""


class CancelledError(ProblemError):
    """An item of a batch was cancelled."""


class TimeLimitError(ProblemError):
    """A job exceeded its time limit and had to be stopped."""


class WorkerDiedError(ProblemError):
    """The worker process died each time that it ran the job."""


class UnavailableError(ProblemError):
    """Something that the request needs does not answer now."""


class Kind(NamedTuple):
    """A kind of problem: HTTP status, last part of its type, title."""

    status: int
    slug: str
    title: str


_NOT_JSON = Kind(400, "not-json", "The body is not JSON")
_INTERNAL = Kind(500, "internal", "Internal error")

KINDS: dict[type[Exception], Kind] = {
    RequestError: Kind(422, "invalid-request", "The request does not match its schema"),
    ParameterError: Kind(422, "invalid-parameter", "A parameter is not valid"),
    UnsupportedPlantError: Kind(422, "unsupported-plant", "The plant is not supported"),
    InvalidInputError: Kind(422, "invalid-input", "The mathematics cannot accept a value"),
    NumbersError: Kind(422, "numbers", "The numbers are beyond double precision"),
    EffortError: Kind(422, "too-much-work", "The analysis is too large for a request"),
    BodyTooLargeError: Kind(413, "body-too-large", "The body is too large"),
    MediaTypeError: Kind(415, "media-type", "The body must be JSON"),
    SlowBodyError: Kind(408, "slow-body", "The body comes too slowly"),
    LargeHeadError: Kind(431, "head-too-large", "The head is too large"),
    AmbiguousError: Kind(400, "ambiguous", "The request could be read in two ways"),
    MisdirectedError: Kind(421, "misdirected", "The request is for another host"),
    UnauthorizedError: Kind(401, "unauthorized", "An API key is needed"),
    ForbiddenError: Kind(403, "forbidden", "The caller may not do this"),
    RateError: Kind(429, "too-many", "Too many requests"),
    NotFoundError: Kind(404, "not-found", "Not found"),
    MethodError: Kind(405, "method", "The resource does not have this method"),
    ConflictError: Kind(409, "conflict", "Conflict"),
    AnalysisTimeoutError: Kind(503, "analysis-timeout", "The analysis took too long"),
    AnalysisMemoryError: Kind(503, "analysis-memory", "The analysis needs too much memory"),
    CancelledError: Kind(409, "cancelled", "The tuning was cancelled"),
    TimeLimitError: Kind(503, "time-limit", "The time limit is over"),
    WorkerDiedError: Kind(500, "worker-died", "The job kills its worker"),
    UnavailableError: Kind(503, "unavailable", "Not available now"),
}


def describe(error: Exception) -> dict[str, Any]:
    """Return the problem document of `error`; anything unforeseen is an internal error."""
    kind = next((KINDS[base] for base in type(error).__mro__ if base in KINDS), _INTERNAL)
    detail = "The service met a fault of its own; it is in its log."
    faults: tuple[Fault, ...] = ()
    match error:
        case RequestError():
            kind = kind if error.is_json else _NOT_JSON
            detail, faults = str(error), error.faults
        case InvalidInputError():
            detail, faults = error.message, (Fault(error.field, error.message),)
        case ProblemError():
            detail, faults = error.detail, error.faults
    return {
        "type": f"urn:mutune:problem:{kind.slug}",
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        "errors": [{"pointer": fault.pointer, "detail": fault.detail} for fault in faults],
    }
