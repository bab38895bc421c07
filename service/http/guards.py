"""What reaches the service at all: names of this host, pages of its own, bodies that keep coming.

A service without API keys trusts whoever reaches its loopback address. A page of elsewhere does, in
a browser on this machine, once its name resolves to that address (DNS rebinding): its requests
then carry that name as their Host, and the page's origin.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import socket
import time
from contextlib import suppress

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.problems import (
    MEDIA_TYPE,
    AmbiguousError,
    ForbiddenError,
    LargeHeadError,
    MisdirectedError,
    ProblemError,
    SlowBodyError,
    describe,
)

__all__ = ["HEAD_BYTES", "Head", "KnownHosts", "PlainHeads", "SteadyBodies"]

_READING = frozenset({"GET", "HEAD", "OPTIONS"})

HEAD_BYTES = 32_768  # request line and headers together
_PATIENCE = 30.0  # seconds for a body, whatever its length
_PACE = 10_000.0  # bytes in a second that a longer one has to come with


class KnownHosts:
    """Refuse requests to a name that is not this service's, and writes of pages from elsewhere.

    Parameters
    ----------
    app : ASGIApp
        What is guarded.
    hosts : tuple of str
        Names beside addresses, localhost and this machine's own.
    origins : tuple of str
        Origins beside that of the service itself.

    """

    def __init__(self, app: ASGIApp, hosts: tuple[str, ...], origins: tuple[str, ...]) -> None:
        self._app = app
        self._hosts = {"localhost", socket.gethostname().lower(), *(map(str.lower, hosts))}
        self._origins = set(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or refuse it."""
        if scope["type"] == "http" and (refusal := self._refusal(scope)) is not None:
            await _respond(refusal, scope, receive, send)
            return
        await self._app(scope, receive, send)

    def _refusal(self, scope: Scope) -> ProblemError | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "").lower()
        reached = (scope.get("server") or ("",))[0]
        if not (self._is_known(name := _name(host)) or name == reached):
            message = f"This service is not known as {name!r}; see MUTUNE_ALLOWED_HOSTS."
            return MisdirectedError(message)
        origin = headers.get("origin")
        if origin is None or scope["method"] in _READING or origin in self._origins:
            return None
        if origin.lower().partition("://")[2] == host:
            return None
        return ForbiddenError("Pages of other origins may not write here; see MUTUNE_CORS_ORIGINS.")

    def _is_known(self, name: str) -> bool:
        if name in self._hosts:
            return True
        with suppress(ValueError):  # an address cannot be made to mean another one
            ipaddress.ip_address(name)
            return True
        return False


def _name(host: str) -> str:
    """Return what a Host header names, without the port."""
    if host.startswith("["):  # IPv6
        return host[1:].partition("]")[0]
    return host.partition(":")[0]


class PlainHeads:
    """Refuse heads that are too large, or of which two readers would make two different things."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or refuse it."""
        if scope["type"] == "http" and (refusal := _refused_head(scope)) is not None:
            await _respond(refusal, scope, receive, send)
            return
        await self._app(scope, receive, send)


def _refused_head(scope: Scope) -> ProblemError | None:
    size = len(scope.get("raw_path") or b"") + len(scope.get("query_string", b""))
    size += sum(len(name) + len(value) for name, value in scope["headers"])
    if size > HEAD_BYTES:
        message = f"Request line and headers have at most {HEAD_BYTES} bytes."
        return LargeHeadError(message, {"Connection": "close"})
    names = {name for name, _ in scope["headers"]}
    if {b"content-length", b"transfer-encoding"} <= names:  # RFC 9112, 6.3: perhaps smuggled
        message = "A body has a Content-Length or a Transfer-Encoding, not both."
        return AmbiguousError(message, {"Connection": "close"})
    return None


class Head:
    """Answer HEAD as GET, without the body."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return

        async def send_head(message: Message) -> None:
            if message["type"] == "http.response.body":
                await send({"type": "http.response.body", "body": b"", "more_body": False})
                raise _HeadSentError
            await send(message)

        with suppress(_HeadSentError):  # a stream would go on for ever
            await self._app({**scope, "method": "GET"}, receive, send_head)


class _HeadSentError(Exception):
    """All that was asked for has been sent."""


class SteadyBodies:
    """Refuse bodies that come too slowly: each holds a connection and what has come of it."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started = time.monotonic()
        size, is_open = 0, True

        async def receive_soon() -> Message:
            nonlocal size, is_open
            if not is_open:  # nothing more comes but the end of the connection
                return await receive()
            try:
                async with asyncio.timeout(started + _PATIENCE + size / _PACE - time.monotonic()):
                    message = await receive()
            except TimeoutError:
                text = f"The body must come within {_PATIENCE:g} s or at {_PACE / 1000:g} kB/s."
                raise SlowBodyError(text, {"Connection": "close"}) from None
            size += len(message.get("body", b""))
            is_open = message.get("more_body", False)
            return message

        await self._app(scope, receive_soon, send)


async def _respond(problem: ProblemError, scope: Scope, receive: Receive, send: Send) -> None:
    document = describe(problem)
    response = Response(
        json.dumps(document), document["status"], problem.headers, media_type=MEDIA_TYPE
    )
    await response(scope, receive, send)
