"""Time responses of plants and loops."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.step_response import (
    StepResponseRequest,
    StepResponseResult,
)
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/step-responses",
    summary="Simulate responses to steps",
    responses={
        200: described(StepResponseResult, "The responses."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=described_body(StepResponseRequest),
)
async def post_step_response(request: Request) -> Response:
    """Return how a plant and its loops move after steps, dead time exact."""
    return await analysis(request, StepResponseRequest, computing.step_response)
