"""Files of plant data as columns of numbers, read as the command line reads them."""

from __future__ import annotations

import base64
from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from service.http import bodies
from service.http.routes.common import BODY_PROBLEMS, answer, computed, described, problems
from service.schemas.fields import RequestModel, below
from solver.model.errors import InvalidInputError

__all__ = ["router"]

router = APIRouter(tags=["records"])


class RecordFile(RequestModel):
    """A file of plant data."""

    name: str = Field(
        min_length=1,
        max_length=200,
        description="Of the file; .parquet or .pq at its end tells Parquet from text.",
        examples=["steps.csv"],
    )
    content: str = Field(
        description="What the file holds, in base64.", examples=["dCx1LHkKMCwwLDIwCg=="]
    )


class RecordColumn(BaseModel):
    """A column of the file."""

    name: str = Field(
        description="Its head without the unit; with its number where another has the same.",
        examples=["valve"],
    )
    unit: str | None = Field(description="As the file tells it.", examples=["%"])
    values: list[float | None] | None = Field(
        description="Its numbers, null where there is no reading; null: it holds no numbers.",
        examples=[[0.0]],
    )
    fault: str | None = Field(description="Why it has no values.", examples=[None])


class RecordColumns(BaseModel):
    """The columns of a file of plant data."""

    clock: str = Field(description="Head of the column of times.", examples=["time"])
    unit: str | None = Field(description="Of the times; s of time stamps.", examples=["s"])
    time: list[float] = Field(
        description="Increasing; time stamps are counted from the first.", examples=[[0.0]]
    )
    columns: list[RecordColumn] = Field(description="The others.", examples=[[]])


@router.post(
    "/v1/record-columns",
    summary="Read a file of plant data",
    responses={
        200: described(RecordColumns, "Its columns, for an identification."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=bodies.described_body(RecordFile),
)
async def post_record_columns(request: Request) -> Response:
    """Read a file of columns of any form that `mutune identify` reads; nothing of it is kept."""
    body = await bodies.read(request, RecordFile)
    try:
        raw = base64.b64decode(body.content, validate=True)
    except ValueError:
        message = "is no base64"
        raise InvalidInputError(message, "/content") from None
    return answer(request, await computed(request, _columns, raw, body.name))


def _columns(raw: bytes, name: str) -> dict[str, Any]:
    from service.schemas.encoding import encode  # noqa: PLC0415 - numerical, and so is the reader
    from solver.identification.reading import read_table  # noqa: PLC0415

    with below("/content"):
        found: dict[str, Any] = encode(read_table(raw, name))
    return found
