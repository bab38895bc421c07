"""Around every request: an id, a line in the log, metrics, security headers."""

from __future__ import annotations

import logging
import re
import time
import uuid

from starlette.datastructures import Headers
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.audit import Trail
from service.http.metrics import RequestMetrics
from service.logs import fields
from service.logs import request_id as request_id_of_log

__all__ = ["Compressed", "Observed", "SecurityHeaders"]

logger = logging.getLogger("mutune.http")

_READING = frozenset({"GET", "HEAD", "OPTIONS"})
_REFUSALS = frozenset({401, 403, 421, 429})
_FAULTS = 400
_KEY = re.compile(r"mutune_[0-9a-f]+_[A-Za-z0-9_-]+")
_ID = re.compile(r"[0-9a-f]{32}")
_TRACE = re.compile(r"[0-9a-f]{2}-([0-9a-f]{32})-[0-9a-f]{16}-[0-9a-f]{2}")
_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")


class Observed:
    """Give each request an id (the caller's X-Request-Id, where sane), log it and measure it.

    Neither query strings nor bodies are logged: they are the caller's business. Nor is a key, where
    somebody has put it into a path. What changes something, and what was refused for want of
    rights, goes into the trail of acts too.
    """

    def __init__(self, app: ASGIApp, metrics: RequestMetrics, trail: Trail) -> None:
        self._app = app
        self._metrics = metrics
        self._trail = trail

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request_id = _request_id(scope)
        token = request_id_of_log.set(request_id)
        started = time.perf_counter()
        status = 500
        location = ""
        state = scope.setdefault("state", {})

        async def send_with_id(message: Message) -> None:
            nonlocal status, location
            if message["type"] == "http.response.start":
                status = message["status"]
                location = Headers(raw=message["headers"]).get("location", "")
                message["headers"].append((b"x-request-id", request_id.encode()))
                if rate := state.get("rate"):
                    message["headers"].append((b"ratelimit-policy", rate[0].encode()))
                    message["headers"].append((b"ratelimit", rate[1].encode()))
            await send(message)

        try:
            await self._app(scope, receive, send_with_id)
        finally:
            route = getattr(scope.get("route"), "path", "unknown")
            seconds = time.perf_counter() - started
            self._metrics.observe_request(scope["method"], route, status, seconds)
            key = {"key": state["owner"]} if state.get("owner") else {}
            logger.info(
                "request",
                extra=fields(
                    method=scope["method"],
                    path=_KEY.sub("KEY", scope["path"]),
                    status=status,
                    milliseconds=round(1000 * seconds, 1),
                    **key,
                ),
            )
            if status in _REFUSALS or (scope["method"] not in _READING and status < _FAULTS):
                client = scope.get("client")
                names = scope.get("path_params", {})
                self._trail.write(
                    action=f"{scope['method']} {route}",
                    key=state.get("owner"),
                    job=_known(names.get("job_id")) or _known(location.rpartition("/")[2]),
                    batch=_known(names.get("batch_id")),
                    status=status,
                    address=client[0] if client else None,
                    request_id=request_id,
                )
            request_id_of_log.reset(token)


def _known(name: str | None) -> str | None:
    """Return the id of a job or batch; None for what is no id: it may be a key."""
    return name if name is not None and _ID.fullmatch(name) else None


def _request_id(scope: Scope) -> str:
    headers = dict(scope["headers"])
    # The trace id of W3C Trace Context, where the caller's side is traced.
    if trace := _TRACE.fullmatch(headers.get(b"traceparent", b"").decode("latin-1")):
        return trace[1]
    given = headers.get(b"x-request-id", b"").decode("latin-1")
    is_id = _REQUEST_ID.fullmatch(given) and not _KEY.search(given)
    return given if is_id else uuid.uuid4().hex


class Compressed:
    """Compress responses, except the streams that a client reads line by line as they come."""

    def __init__(self, app: ASGIApp) -> None:
        self._plain = app
        self._gzip = GZipMiddleware(app, minimum_size=1000, compresslevel=4)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        is_stream = scope["type"] == "http" and scope["path"].endswith(("/events", "/results"))
        await (self._plain if is_stream else self._gzip)(scope, receive, send)


_HEADERS = [
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), geolocation=(), microphone=()"),
]
_POLICY = (
    b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    b"connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)


class SecurityHeaders:
    """Add security headers; a page that needs another content policy sets its own."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = message["headers"]
                headers.extend(_HEADERS)
                if not any(name == b"content-security-policy" for name, _ in headers):
                    headers.append((b"content-security-policy", _POLICY))
            await send(message)

        await self._app(scope, receive, send_with_headers)
