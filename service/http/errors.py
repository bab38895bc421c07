"""Exceptions as responses: every error leaves the service as a problem."""

from __future__ import annotations

import json

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from service.jobs.transactions import StoreUnavailableError
from service.problems import (
    KINDS,
    MEDIA_TYPE,
    BodyTooLargeError,
    MethodError,
    NotFoundError,
    ParameterError,
    ProblemError,
    UnavailableError,
    describe,
)
from service.schemas.parsing import Fault

__all__ = ["install", "problem_response"]

_ROUTING: dict[int, type[ProblemError]] = {
    404: NotFoundError,
    405: MethodError,
    413: BodyTooLargeError,
}


def install(app: FastAPI) -> None:
    """Make every error of `app` leave it as a problem."""
    for kind in (
        *KINDS,
        RequestValidationError,
        HTTPException,
        StoreUnavailableError,
        Exception,
    ):
        app.add_exception_handler(kind, _to_response)
    app.add_exception_handler(ClientDisconnect, _to_nobody)


async def _to_nobody(_request: Request, _error: Exception) -> Response:
    """Answer a caller who has left: for the log, with the status that nginx gives it."""
    return Response(status_code=499)


async def _to_response(request: Request, error: Exception) -> Response:
    problem = _translated(error)
    if isinstance(problem, MethodError):
        # The router names the methods of the first route with this path only.
        problem.headers = {"Allow": ", ".join(_methods(request))}
    return problem_response(problem)


def _methods(request: Request) -> list[str]:
    """Return the methods of the resource that a request asked for."""
    routes: list[APIRoute] = request.app.state.routes
    found = {
        method
        for route in routes
        if route.path_regex.match(request.url.path)
        for method in route.methods or ()
    }
    return sorted(found) or ["GET"]  # what is not a route of the interface is only read


def problem_response(error: Exception) -> Response:
    """Return the response for `error`."""
    document = describe(error)
    headers = error.headers if isinstance(error, ProblemError) else {}
    return Response(json.dumps(document), document["status"], headers, media_type=MEDIA_TYPE)


def _translated(error: Exception) -> Exception:
    """Translate the exceptions of framework and database into those of the table."""
    match error:
        case HTTPException():
            kind = _ROUTING.get(error.status_code, UnavailableError)
            return kind(error.detail, error.headers)
        case RequestValidationError():
            faults = tuple(
                Fault("".join(f"/{part}" for part in item["loc"]), item["msg"])
                for item in error.errors()
            )
            detail = "; ".join(f"{fault.pointer}: {fault.detail}" for fault in faults)
            return ParameterError(detail, faults=faults)
        case StoreUnavailableError():
            return UnavailableError("The database does not answer.", {"Retry-After": "2"})
    return error
