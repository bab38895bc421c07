"""The OpenAPI document of an app: the schemas of all bodies as components."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.encoders import jsonable_encoder
from fastapi.openapi.models import Schema
from fastapi.openapi.utils import get_openapi

from service.http import bodies

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
    for reference in sorted(_references(result)):
        for name, schema in bodies.schemas(reference).items():
            # In the form that FastAPI gives those of its own.
            found = jsonable_encoder(Schema(**schema), by_alias=True, exclude_none=True)
            if components.setdefault(name, found) != found:
                message = f"two different schemas are called {name}"
                raise ValueError(message)
    result["components"]["schemas"] = dict(sorted(components.items()))
    return result


def _references(document: dict[str, Any]) -> set[str]:
    """Return what the bodies of requests and responses refer to."""
    found = set()
    for operations in document["paths"].values():
        for method in _METHODS:
            operation = operations.get(method, {})
            parts = [operation.get("requestBody", {}), *operation.get("responses", {}).values()]
            for part in parts:
                for content in part.get("content", {}).values():
                    found.add(content["schema"].get("$ref", ""))
    return found
