"""Relay experiments."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service import computing
from service.analyses.relay.models import (
    RelayExperimentRequest,
    RelayExperimentResult,
)
from service.http.bodies import described_body
from service.http.routes.common import BODY_PROBLEMS, analysis, described, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/relay-experiments",
    summary="Simulate a relay experiment",
    responses={
        200: described(RelayExperimentResult, "The outcome."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=described_body(RelayExperimentRequest),
)
async def post_relay_experiment(request: Request) -> Response:
    """Return the oscillation under relay feedback, what it means, and what theory says of it."""
    return await analysis(request, RelayExperimentRequest, computing.relay_experiment)
