"""What the routes share: described errors and results, and common parameters."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query, Response
from pydantic import BaseModel

from service.problems import MEDIA_TYPE, Problem
from service.schemas.figures import FiguresResult

__all__ = ["BODY_PROBLEMS", "FIGURES", "Unit", "described", "json_response", "problems"]


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


FIGURES = described(FiguresResult, "The figures.")
