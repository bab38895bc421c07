"""The OpenAPI document of the service; ``python -m service.http.openapi`` writes it to a file."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.http.bodies import REFERENCE

__all__ = ["document", "text"]

_METHODS = ("get", "post", "put", "patch", "delete")


def document(app: FastAPI) -> dict[str, Any]:
    """Return the OpenAPI document of `app`, with the schemas of all bodies as components."""
    result = get_openapi(
        title=app.title,
        version=app.version,
        summary=app.summary,
        description=app.description,
        license_info=app.license_info,
        tags=app.openapi_tags,
        routes=app.routes,
        separate_input_output_schemas=False,
    )
    components = result["components"]["schemas"]
    for operations in result["paths"].values():
        for method in _METHODS:
            operation = operations.get(method, {})
            parts = [operation.get("requestBody", {}), *operation.get("responses", {}).values()]
            for part in parts:
                for content in part.get("content", {}).values():
                    if "title" in content["schema"]:
                        _move_to_components(content, components)
    result["components"]["schemas"] = dict(sorted(components.items()))
    return result


def _move_to_components(content: dict[str, Any], components: dict[str, Any]) -> None:
    schema = dict(content["schema"])
    name = schema["title"]
    for key, value in {**schema.pop("$defs", {}), name: schema}.items():
        if components.setdefault(key, value) != value:
            message = f"two different schemas are called {key}"
            raise ValueError(message)
    content["schema"] = {"$ref": REFERENCE.format(model=name)}


def text() -> str:
    """Return the committed form of the document."""
    from service.http.app import create_app  # noqa: PLC0415 - the app itself imports this module

    return json.dumps(create_app().openapi(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(text(), encoding="utf-8")
