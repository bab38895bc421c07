"""Connections of the command's server: those that say or take nothing give way."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
import uvicorn
from real import PATIENCE, until
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from service.cli import connections
from service.cli.connections import PunctualProtocol

LONG = b"x" * 20_000_000
GET = b"GET /%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
MOST = 5


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer briefly, or at length."""
    content = LONG if scope["path"] == "/long" else b"brief"
    await Response(content)(scope, receive, send)


def has_ended(connection: socket.socket) -> bool:
    """Whether the other side has closed, in whichever way."""
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.fixture
def address() -> Iterator[tuple[str, int]]:
    """Return the address of a server that has room for a few connections."""
    with socket.socket(proto=socket.IPPROTO_TCP) as listening:
        listening.bind(("127.0.0.1", 0))
        config = uvicorn.Config(
            app, http=PunctualProtocol, limit_concurrency=MOST, log_config=None, lifespan="off"
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        until(lambda: server.started, "the server")
        yield listening.getsockname()
        server.should_exit = True
        thread.join()


def test_whoever_says_nothing_keeps_nobody_out(address: tuple[str, int]) -> None:
    """Connections without a request make room, that which has waited longest first."""
    with ExitStack() as stack:
        silent = [
            stack.enter_context(socket.create_connection(address, timeout=PATIENCE))
            for _ in range(4 * MOST)
        ]
        for one in silent[::2]:
            one.sendall(b"GET / HTTP/1.1\r\nHo")
        for _ in range(3):
            speaking = stack.enter_context(socket.create_connection(address, timeout=PATIENCE))
            speaking.sendall(GET % b"brief")
            assert speaking.recv(1000).startswith(b"HTTP/1.1 200")
        assert has_ended(silent[0])
        silent[-1].setblocking(False)
        with pytest.raises(BlockingIOError):
            silent[-1].recv(1)


@pytest.mark.parametrize("said", [b"", b"GET / HTTP/1.1\r\nHo"])
def test_whoever_sends_no_request_is_let_go(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch, said: bytes
) -> None:
    """A connection without a whole head is closed after a time that ten seconds stand for here."""
    monkeypatch.setattr(connections, "_HEAD_SECONDS", 0.2)
    with socket.create_connection(address, timeout=PATIENCE) as silent:
        silent.sendall(said)
        assert has_ended(silent)


def test_whoever_takes_nothing_is_let_go(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With what was to be sent; whoever takes it gets it all."""
    lost = threading.Event()
    losing = PunctualProtocol.connection_lost

    def connection_lost(self: PunctualProtocol, error: Exception | None) -> None:
        losing(self, error)
        lost.set()

    monkeypatch.setattr(PunctualProtocol, "connection_lost", connection_lost)
    for seconds, whole in ((0.2, False), (60.0, True)):
        monkeypatch.setattr(connections, "_TAKING_SECONDS", seconds)
        with socket.create_connection(address, timeout=PATIENCE) as caller:
            caller.sendall(GET % b"long")
            if not whole:
                assert lost.wait(PATIENCE)
            got = sum(len(part) for part in iter(lambda: caller.recv(1_000_000), b""))
        assert (got > len(LONG)) is whole
