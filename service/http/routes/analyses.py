"""The analyses and their figures: two operations for each, made from its record."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Request, Response

from service import registry
from service.analysis import Analysis, Figures, compute
from service.effort import refuse
from service.http import bodies
from service.http.routes.common import (
    BODY_PROBLEMS,
    FIGURES,
    Unit,
    answer,
    computed,
    described,
    problems,
)
from service.jobs.pool import to_json
from service.wording import TIME_UNIT

__all__ = ["add_figures", "router"]

router = APIRouter()


def _add(analysis: Analysis[Any, Any]) -> None:
    """Add the operation that analyses."""

    async def post(request: Request) -> Response:
        body = await bodies.read(request, analysis.request)
        if analysis.immediate(body):
            found = await asyncio.to_thread(to_json, compute, (analysis.compute, body), {})
            return answer(request, found)
        # Bad input is refused here, not in the process that computes.
        task = await asyncio.to_thread(body.build)
        effort = None if analysis.effort is None else analysis.effort(task)
        if effort is not None:
            configuration = request.app.state.configuration
            refuse(
                effort,
                seconds=configuration.analysis_time_limit,
                memory=configuration.analysis_memory,
            )
        return answer(request, await computed(request, compute, analysis.compute, body))

    router.add_api_route(
        analysis.path,
        post,
        methods=["POST"],
        tags=["analyses"],
        summary=analysis.summary,
        description=analysis.description,
        operation_id=f"post_{analysis.name}",
        responses={
            200: described(analysis.result, analysis.outcome),
            **problems(*BODY_PROBLEMS, 503),
        },
        openapi_extra=bodies.described_body(analysis.request),
    )


def add_figures(router: APIRouter, resource: str, figures: Figures[Any]) -> None:
    """Add the operation that draws results to `router`."""

    async def post(request: Request, unit: Unit = TIME_UNIT) -> Response:
        body = await bodies.read(request, figures.drawn)
        return answer(request, await computed(request, figures.draw, body, unit))

    router.add_api_route(
        f"/v1/figures/{resource}",
        post,
        methods=["POST"],
        tags=["analyses"],
        summary=f"Figures of {figures.of}",
        description="Send the answer of the analysis as it came; what is not drawn is ignored.",
        operation_id=f"post_figures_{resource.replace('-', '_')}",
        responses={200: FIGURES, **problems(*BODY_PROBLEMS, 503)},
        openapi_extra=bodies.described_body(figures.drawn),
    )


for _analysis in registry.every():
    _add(_analysis)
    if _analysis.figures is not None:
        add_figures(router, _analysis.resource, _analysis.figures)
