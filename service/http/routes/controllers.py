"""Control systems whose law is known: what settings can be typed into."""

from __future__ import annotations

import json
from functools import cache

from fastapi import APIRouter, Response

from service.http.routes.common import described, json_response
from service.schemas.known_controllers import KnownControllerList, known_controllers

__all__ = ["router"]

router = APIRouter(tags=["controllers"])


@router.get(
    "/v1/controllers",
    summary="List known controllers",
    responses={200: described(KnownControllerList, "The controllers.")},
)
async def list_controllers() -> Response:
    """Return control systems whose law is published, for `target` of the controller forms."""
    return json_response(_document(), headers={"Cache-Control": "no-cache"})


@cache
def _document() -> str:
    return json.dumps({"items": known_controllers()}, separators=(",", ":"))
