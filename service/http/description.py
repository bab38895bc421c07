"""The OpenAPI document of an app: the schemas of all bodies as components."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.http.bodies import REFERENCE

__all__ = ["document"]

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
