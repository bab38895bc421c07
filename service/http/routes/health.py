"""Health, readiness and metrics."""

from __future__ import annotations

import asyncio
import json

from fastapi import APIRouter, Depends, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import BaseModel, Field

from service.http.access import authenticate
from service.http.routes.common import described, json_response, problems
from service.jobs import forking
from service.jobs.transactions import StoreUnavailableError

__all__ = ["router"]

router = APIRouter(tags=["operations"])


class Health(BaseModel):
    """The process answers."""

    status: str = Field(description="Always ok.", examples=["ok"])


class Readiness(BaseModel):
    """What the service needs, and whether it is there."""

    database: bool = Field(description="The database answers.", examples=[True])
    workers: int = Field(description="Workers that take jobs.", examples=[2])
    refused_workers: list[str] = Field(
        description="Workers that get no work because they run another version of mutune.",
        examples=[[]],
    )
    starting: str | None = Field(
        default=None,
        description="What is done before there can be workers of this machine; the first start "
        "compiles for a minute or two.",
        examples=["compiling the kernels, which is done once: 12 functions so far", None],
    )


@router.get(
    "/healthz", summary="Is the process alive?", responses={200: described(Health, "It is.")}
)
async def healthz() -> Response:
    """Answer as long as the process can."""
    return json_response('{"status":"ok"}')


@router.get(
    "/readyz",
    summary="Can it work?",
    responses={
        200: described(Readiness, "Database and engine answer."),
        503: described(Readiness, "Something is missing."),
    },
)
async def readyz(request: Request) -> Response:
    """Look whether database and engine answer."""
    state = request.app.state
    try:
        await asyncio.to_thread(state.store.ping)
        database = True
    except StoreUnavailableError:
        database = False
    document = {
        "database": database,
        "workers": state.engine.workers,
        "refused_workers": sorted(state.engine.refused),
        "starting": None if state.engine.workers else forking.progress(),
    }
    ready = database and state.engine.workers > 0
    return json_response(json.dumps(document), 200 if ready else 503)


@router.get(
    "/metrics",
    dependencies=[Depends(authenticate)],
    summary="Metrics for Prometheus",
    response_class=Response,
    responses={
        200: {
            "description": "Metrics in the text format of Prometheus.",
            "content": {"text/plain": {"schema": {"type": "string"}}},
        },
        **problems(401, 403, 429, 503),
    },
)
async def metrics(request: Request) -> Response:
    """Return what was measured."""
    state = request.app.state
    counts = await asyncio.to_thread(state.store.counts)
    content = state.metrics.render(counts, state.engine.workers, len(state.engine.refused))
    return Response(content, media_type=CONTENT_TYPE_LATEST)
