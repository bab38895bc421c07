"""Static decoupling of a plant."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.decouple import DecouplingRequest, DecouplingResult
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/decouplings",
    summary="Decouple a plant statically and design its loops",
    responses={
        200: described(DecouplingResult, "The decoupler and its loops."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=described_body(DecouplingRequest),
)
async def post_decoupling(request: Request) -> Response:
    """Return a static decoupler, PI settings with the greatest integral gain, and responses."""
    return await analysis(request, DecouplingRequest, computing.decoupling)
