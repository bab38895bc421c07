"""What the routes share: the parts of the app, described errors, answered analyses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from fastapi import Request, Response
from pydantic import BaseModel

from service.http import bodies
from service.problems import MEDIA_TYPE, Problem

__all__ = ["analysis", "described", "json_response", "problems"]


class Analysis(Protocol):
    """A request model that knows how to become the solver's input."""

    def build(self) -> object:
        """Return the solver's input; raise `InvalidInputError` for what it cannot accept."""


_Model = TypeVar("_Model", bound=BaseModel)

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
    """Return the OpenAPI description of an answer of the form `model`."""
    return {"model": model, "description": description}


def json_response(
    content: str | bytes, status: int = 200, headers: dict[str, str] | None = None
) -> Response:
    """Return JSON text as an answer."""
    return Response(content, status, headers, media_type="application/json")


async def analysis(
    request: Request, model: type[_Model], compute: Callable[[_Model], dict[str, Any]]
) -> Response:
    """Answer an analysis: read the body as a `model`, compute in another process, send JSON.

    Parameters
    ----------
    request : Request
        The request.
    model : type
        Request model; its method ``build`` finds the faults that the schema cannot express.
    compute : callable
        Function at the top level of a module: model in, JSON object out.

    """
    body = await bodies.read(request, model)
    body.build()  # type: ignore[attr-defined]  # bad input is refused here, not in the process
    return json_response(await request.app.state.analyses.run(compute, body))
