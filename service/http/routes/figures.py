"""Figures, loop sheet and report of a tuning, and the figure of a trade-off."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse

from service import drawing
from service.analysis import Figures
from service.http.kept import Kept, key_of
from service.http.routes.analyses import add_figures
from service.http.routes.common import FIGURES, Unit, answer, computed, described, problems
from service.http.routes.jobs import JobId, find
from service.jobs.records import Job
from service.problems import ConflictError
from service.schemas.sheet import SheetResult
from service.schemas.trade_off import TradeOff
from service.wording import TIME_UNIT

__all__ = ["finished", "router"]

router = APIRouter()


@router.get(
    "/v1/tunings/{job_id}/figures",
    tags=["tunings"],
    summary="Figures of a tuning",
    responses={200: FIGURES, **problems(404, 409, 422, 503)},
)
async def get_figures(request: Request, job_id: JobId, unit: Unit = TIME_UNIT) -> Response:
    """Return everything that the result of a tuning has to show."""
    job, result = await finished(request, job_id)
    return answer(request, await _once(request, drawing.tuning, job.request, result, unit))


@router.get(
    "/v1/tunings/{job_id}/sheet",
    tags=["tunings"],
    summary="Loop sheet of a tuning",
    responses={
        200: described(SheetResult, "How the loops behave, and what can go wrong."),
        **problems(404, 409, 422, 503),
    },
)
async def get_sheet(request: Request, job_id: JobId, unit: Unit = TIME_UNIT) -> Response:
    """Return responses to set point and load with their measures, and what to know of them."""
    job, result = await finished(request, job_id)
    return answer(request, await _once(request, drawing.sheet, job.request, result, unit))


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
    job, result = await finished(request, job_id)
    drawn = await computed(request, drawing.report, job.request, result, unit, job.id)
    document = await asyncio.to_thread(json.loads, drawn)
    return HTMLResponse(
        document["html"],
        headers={
            "Content-Security-Policy": document["policy"],
            "Content-Disposition": f'attachment; filename="mutune-{job.id[:8]}.html"',
        },
    )


async def _once(
    request: Request, draw: Callable[[str, str, str], dict[str, Any]], *texts: str
) -> bytes:
    """Return what `computed` returns, or what it returned for the same texts before."""
    kept: Kept = request.app.state.kept
    key = await asyncio.to_thread(key_of, draw.__name__, *texts)
    found = kept.get(key)
    if found is None:
        found = await computed(request, draw, *texts)
        kept.keep(key, found)
    return found


async def finished(request: Request, job_id: str) -> tuple[Job, str]:
    """Return a job that has a result, and that result.

    Raises
    ------
    NotFoundError, ConflictError
        There is no such job, or it has no result.

    """
    job = await find(request, job_id)
    if job.result is None:
        message = f"The tuning is {job.snapshot.status.replace('_', ' ')} and has no result."
        raise ConflictError(message)
    return job, job.result


add_figures(router, "trade-offs", Figures(of="a trade-off", drawn=TradeOff, draw=drawing.trade_off))
