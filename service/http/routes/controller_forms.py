"""Controllers in the forms that control systems ask for."""

from __future__ import annotations

import json

from fastapi import APIRouter, Request, Response

from service.analyses.controller_forms import (
    ControllerFormsRequest,
    ControllerFormsResult,
    controller_forms_to_json,
)
from service.http import bodies
from service.http.routes.common import BODY_PROBLEMS, described, json_response, problems

__all__ = ["router"]

router = APIRouter(tags=["analyses"])


@router.post(
    "/v1/controller-forms",
    summary="Convert controllers to other forms",
    responses={
        200: described(ControllerFormsResult, "The forms."),
        **problems(*BODY_PROBLEMS, 503),
    },
    openapi_extra=bodies.described_body(ControllerFormsRequest),
)
async def post_controller_forms(request: Request) -> Response:
    """Return the ideal and parallel forms of controllers in cascade form."""
    body = await bodies.read(request, ControllerFormsRequest)
    document = controller_forms_to_json(body.build())
    return json_response(json.dumps(document, separators=(",", ":")))
