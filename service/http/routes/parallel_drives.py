"""Units in parallel on one load."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.parallel_drives import (
    ParallelDrivesRequest,
    ParallelDrivesResult,
)
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/parallel-drives",
    summary="Analyse units with integral action on one load",
    responses={
        200: described(ParallelDrivesResult, "Free modes, remedy and simulation."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=described_body(ParallelDrivesRequest),
)
async def post_parallel_drives(request: Request) -> Response:
    """Return the integrator modes that are free, what mends them, and both in simulation."""
    return await analysis(request, ParallelDrivesRequest, computing.parallel_drives)
