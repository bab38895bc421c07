"""Requests to start from: the files of ``examples/``."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from service.http.routes.common import described, json_response

__all__ = ["router"]

router = APIRouter(tags=["examples"])


class Example(BaseModel):
    """A request to start from."""

    name: str = Field(description="Name, unique.", examples=["parallel_reactors"])
    request: dict[str, Any] = Field(
        description="Body of the operation whose schema it matches.",
        examples=[{"plant": {"kind": "first_order"}}],
    )


class ExampleList(BaseModel):
    """Requests to start from."""

    items: list[Example] = Field(
        description="The examples, by name.",
        examples=[[{"name": "parallel_reactors", "request": {"plant": {"kind": "first_order"}}}]],
    )


@router.get(
    "/v1/examples",
    summary="List example requests",
    responses={200: described(ExampleList, "The examples.")},
)
async def list_examples() -> Response:
    """Return requests to start from, for any of the operations."""
    return json_response(_document(), headers={"Cache-Control": "no-cache"})


@cache
def _document() -> str:
    folder = files("service") / "examples"
    found = sorted((item for item in folder.iterdir() if item.name.endswith(".json")), key=str)
    items = [
        {"name": item.name.removesuffix(".json"), "request": json.loads(item.read_text("utf-8"))}
        for item in found
    ]
    return json.dumps({"items": items}, separators=(",", ":"))
