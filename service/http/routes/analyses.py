"""The analyses and their figures: the operations of each, made from its record."""

from __future__ import annotations

import asyncio
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import StreamingResponse

from service import registry
from service.analysis import Analysis, Figures, LongWork, compute
from service.effort import refuse
from service.http import bodies
from service.http.routes import jobs
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
    """Add the operation that answers with the result."""

    async def post(request: Request) -> Response:
        body = await bodies.read(request, analysis.request)
        if analysis.immediate(body):
            found = await asyncio.to_thread(to_json, compute, (analysis.compute, body), {})
            return answer(request, found)
        # Bad input is refused here, not in the process that computes.
        task = await asyncio.to_thread(body.build)
        limit = request.app.state.configuration.analysis_time_limit
        _refuse_beyond(request, analysis, task, limit)
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


def _add_job(analysis: Analysis[Any, Any], work: LongWork[Any]) -> None:
    """Add the operations of an analysis that is a job: start, look, cancel, follow."""
    resource = analysis.resource

    async def post(
        request: Request,
        idempotency_key: jobs.IdempotencyKey = None,
        prefer: jobs.Prefer = None,
        callback_url: jobs.CallbackUrl = None,
    ) -> Response:
        body = await bodies.read(request, analysis.request)
        longest = request.app.state.configuration.max_time_limit
        _refuse_beyond(request, analysis, await asyncio.to_thread(body.build), longest)
        if work.time_limit is not None:
            jobs.refuse_longer(work.time_limit(body), longest)
        new = jobs.new_job(body, longest, reuse=jobs.may_reuse(request), resource=resource)
        return await jobs.accept(
            request, new, idempotency_key=idempotency_key, prefer=prefer, callback_url=callback_url
        )

    async def get(
        request: Request, job_id: jobs.JobId, if_none_match: jobs.IfNoneMatch = None
    ) -> Response:
        return await jobs.look(request, job_id, if_none_match, resource)

    async def delete(
        request: Request,
        job_id: jobs.JobId,
        forget: jobs.Forget = False,  # noqa: FBT002 - FastAPI's form of a query parameter
    ) -> Response:
        return await jobs.cancel(request, job_id, resource, forget=forget)

    async def follow(request: Request, job_id: jobs.JobId) -> Response:
        return await jobs.follow(request, job_id, resource)

    one = resource.removesuffix("s")
    name = analysis.name
    router.add_api_route(
        analysis.path,
        post,
        methods=["POST"],
        status_code=202,
        tags=["analyses"],
        summary=analysis.summary,
        description=f"{analysis.description} It is computed as a job.",
        operation_id=f"post_{name}",
        responses=jobs.started(work.model),
        openapi_extra=bodies.described_body(analysis.request),
    )
    router.add_api_route(
        f"{analysis.path}/{{job_id}}",
        get,
        methods=["GET"],
        tags=["analyses"],
        summary=f"Look at a job: {one}",
        description="Return the job, with its result once it has one; an ended job never changes.",
        operation_id=f"get_{name}",
        responses=jobs.looked_at(work.model),
    )
    router.add_api_route(
        f"{analysis.path}/{{job_id}}",
        delete,
        methods=["DELETE"],
        status_code=202,
        tags=["analyses"],
        summary=f"Cancel a job: {one}",
        description="Cancel the job; one that has ended is deleted with `forget`, else left.",
        operation_id=f"delete_{name}",
        responses=jobs.stopped(work.model),
    )
    router.add_api_route(
        f"{analysis.path}/{{job_id}}/events",
        follow,
        methods=["GET"],
        response_class=StreamingResponse,
        tags=["analyses"],
        summary=f"Follow a job: {one}",
        description="Stream the progress of the job until it ends.",
        operation_id=f"follow_{name}",
        responses=jobs.FOLLOWED,
    )


def _refuse_beyond(
    request: Request, analysis: Analysis[Any, Any], task: object, seconds: float
) -> None:
    """Refuse a task that would not end within `seconds` and the memory of an analysis."""
    effort = None if analysis.effort is None else analysis.effort(task)
    if effort is not None:
        refuse(effort, seconds=seconds, memory=request.app.state.configuration.analysis_memory)


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
    if _analysis.job is None:
        _add(_analysis)
    else:
        _add_job(_analysis, _analysis.job)
    if _analysis.figures is not None:
        add_figures(router, _analysis.resource, _analysis.figures)
