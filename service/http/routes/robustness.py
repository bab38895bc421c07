"""Robustness of given loops."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.robustness import RobustnessRequest, RobustnessResult
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/robustness",
    summary="Analyse given loop settings",
    responses={200: described(RobustnessResult, "The analysis."), **problems(*BODY_PROBLEMS, 503)},
    openapi_extra=described_body(RobustnessRequest),
)
async def post_robustness(request: Request) -> Response:
    """Return stability, the peaks and curves of mu, and a worst case, of given settings."""
    return await analysis(request, RobustnessRequest, computing.robustness)
