"""Figures of tunings and of analyses, and the report of a tuning."""

from __future__ import annotations

import asyncio
import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import HTMLResponse

from service import computing
from service.http import bodies
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems
from service.http.routes.tunings import JobId, find_job
from service.jobs.records import Job
from service.problems import ConflictError
from service.schemas.drawn import (
    Drawn,
    DrawnDecoupling,
    DrawnInteraction,
    DrawnParallelDrives,
    DrawnRelayExperiment,
    DrawnRobustness,
    DrawnStepResponse,
)
from service.schemas.figures import FiguresResult
from service.schemas.trade_off import TradeOff
from service.wording import TIME_UNIT

__all__ = ["Unit", "finished", "router"]

router = APIRouter()

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
_RESULT: dict[int | str, dict[str, Any]] = {200: described(FiguresResult, "The figures.")}


@router.get(
    "/v1/tunings/{job_id}/figures",
    tags=["tunings"],
    summary="Figures of a tuning",
    responses={**_RESULT, **problems(404, 409, 422, 503)},
)
async def get_figures(request: Request, job_id: JobId, unit: Unit = TIME_UNIT) -> Response:
    """Return everything that the result of a tuning has to show."""
    job = await finished(request, job_id)
    drawn = await request.app.state.analyses.run(
        computing.figures_of_tuning, job.request, job.result, unit
    )
    return json_response(drawn)


@router.get(
    "/v1/tunings/{job_id}/report",
    tags=["tunings"],
    summary="Report of a tuning",
    response_class=HTMLResponse,
    responses={
        200: {
            "description": "One HTML file that opens without network.",
            "content": {"text/html": {"schema": {"type": "string"}}},
        },
        **problems(404, 409, 422, 503),
    },
)
async def get_report(request: Request, job_id: JobId, unit: Unit = TIME_UNIT) -> Response:
    """Return inputs, settings, figures and proof of a tuning, to print, sign and file."""
    job = await finished(request, job_id)
    answer = await request.app.state.analyses.run(
        computing.report, job.request, job.result, unit, job.id
    )
    document = await asyncio.to_thread(json.loads, answer)
    return HTMLResponse(
        document["html"],
        headers={
            "Content-Security-Policy": document["policy"],
            "Content-Disposition": f'attachment; filename="mutune-{job.id[:8]}.html"',
        },
    )


async def finished(request: Request, job_id: str) -> Job:
    """Return a job that has a result.

    Raises
    ------
    NotFoundError, ConflictError
        There is no such job, or it has no result.

    """
    job = await find_job(request, job_id)
    if job.result is None:
        message = f"The tuning is {job.snapshot.status.replace('_', ' ')} and has no result."
        raise ConflictError(message)
    return job


def _add(kind: str, model: type[Drawn], title: str) -> None:
    """Add the operation that draws the results of an analysis."""

    async def post_figures(request: Request, unit: Unit = TIME_UNIT) -> Response:
        body = await bodies.read(request, model)
        return json_response(await request.app.state.analyses.run(computing.figures, body, unit))

    router.add_api_route(
        f"/v1/figures/{kind}",
        post_figures,
        methods=["POST"],
        tags=["analyses"],
        summary=f"Figures of {title}",
        description="Send the answer of the analysis as it came; what is not drawn is ignored.",
        operation_id=f"post_figures_{kind.replace('-', '_')}",
        responses={**_RESULT, **problems(*BODY_PROBLEMS, 503)},
        openapi_extra=bodies.described_body(model),
    )


_add("robustness", DrawnRobustness, "a robustness analysis")
_add("interaction", DrawnInteraction, "an interaction analysis")
_add("step-responses", DrawnStepResponse, "a step response")
_add("relay-experiments", DrawnRelayExperiment, "a relay experiment")
_add("decouplings", DrawnDecoupling, "a decoupling")
_add("parallel-drives", DrawnParallelDrives, "parallel drives")
_add("trade-offs", TradeOff, "a trade-off")
