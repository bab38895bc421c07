"""Loops out of service."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.integrity import IntegrityRequest, IntegrityResult
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/integrity",
    summary="Analyse loops out of service",
    responses={200: described(IntegrityResult, "The analysis."), **problems(*BODY_PROBLEMS, 503)},
    openapi_extra=described_body(IntegrityRequest),
)
async def post_integrity(request: Request) -> Response:
    """Return stability and robustness with every set of loops in service, others in manual."""
    return await analysis(request, IntegrityRequest, computing.integrity)
