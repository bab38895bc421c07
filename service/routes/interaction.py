"""Interaction between the loops of a plant."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from service.bodies import described_body
from service.routes.common import BODY_PROBLEMS, analysis, described, problems
from service.schemas.interaction import (
    InteractionRequest,
    InteractionResult,
    interaction_to_json,
)
from solver.interaction.analysis import analyse_interaction
from solver.interaction.loop_effect import loop_effect

__all__ = ["compute", "router"]

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
    return await analysis(request, InteractionRequest, compute)


def compute(request: InteractionRequest) -> dict[str, Any]:
    """Return the interaction between the loops of the request's plant as JSON values."""
    task = request.build()
    effect = None if task.effect is None else loop_effect(task.effect)
    return interaction_to_json(analyse_interaction(task.plant, task.omega), effect)
