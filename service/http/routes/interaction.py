"""Interaction between the loops of a plant."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.interaction.models import (
    InteractionRequest,
    InteractionResult,
)
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/interaction",
    summary="Analyse the interaction between loops",
    responses={
        200: described(InteractionResult, "The analysis."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=described_body(InteractionRequest),
)
async def post_interaction(request: Request) -> Response:
    """Return relative gains, pairings, integral controllability and zeros of a plant."""
    return await analysis(request, InteractionRequest, computing.interaction)
