"""Results of analyses as lines and tables for people, the same as in a terminal."""

from __future__ import annotations

import asyncio
from typing import Annotated, Literal

from fastapi import APIRouter, Path, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from service import registry
from service.analysis import Analysis
from service.http import bodies
from service.http.routes.common import BODY_PROBLEMS, Unit, described, json_response, problems
from service.printing import Line, Part, in_unit
from service.problems import NotFoundError
from service.schemas.parsing import parse

__all__ = ["router"]

router = APIRouter(prefix="/v1/tables", tags=["analyses"])

_ANALYSES = {analysis.resource: analysis for analysis in registry.every()}


class TextLine(BaseModel):
    """A line of text."""

    text: str = Field(description="The line.", examples=["Nominally stable, demand met."])
    style: Literal["plain", "strong", "alarm", "warning"] = Field(
        description="How much it should catch the eye.", examples=["strong"]
    )


class TextTable(BaseModel):
    """A table."""

    heads: list[str] = Field(description="Heads of the columns.", examples=[["peak of μ", "value"]])
    rows: list[list[str]] = Field(
        description="Rows, a text for each column.", examples=[[["robust performance", "1"]]]
    )


class TablesResult(BaseModel):
    """A result as people read it."""

    parts: list[TextLine | TextTable] = Field(
        description="Lines and tables in their order.",
        examples=[[{"text": "Nominally stable, demand met.", "style": "strong"}]],
    )


class AnalysisAnswer(BaseModel):
    """The answer of an analysis as it came; its own schema is that of its route."""

    model_config = ConfigDict(extra="allow")


@router.post(
    "/{resource}",
    summary="Tables of a result",
    responses={
        200: described(TablesResult, "Lines and tables."),
        **problems(*BODY_PROBLEMS, 404, 503),
    },
    openapi_extra=bodies.described_body(AnalysisAnswer),
)
async def post_tables(
    request: Request,
    resource: Annotated[
        str, Path(description="Last part of the analysis's path.", examples=["robustness"])
    ],
    unit: Unit | None = None,
) -> Response:
    """Say in lines and tables what an analysis found; send its answer as it came."""
    analysis = _ANALYSES.get(resource)
    if analysis is None:
        message = f"There is no analysis {resource}."
        raise NotFoundError(message)
    found = await asyncio.to_thread(_tables, analysis, await bodies.read_bytes(request), unit)
    return json_response(found.model_dump_json())


def _tables(
    analysis: Analysis,  # type: ignore[type-arg]  # any
    body: bytes,
    unit: str | None,
) -> TablesResult:
    found = in_unit(analysis.table(parse(analysis.result, body)), unit)
    return TablesResult(parts=[_part(part) for part in found])


def _part(part: Part) -> TextLine | TextTable:
    if isinstance(part, Line):
        return TextLine(text=part.text, style=part.style)
    return TextTable(heads=list(part.heads), rows=[list(row) for row in part.rows])
