"""``mutune serve``: the service in this process, until it is stopped."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import os
import socket
import sys
from contextlib import AsyncExitStack
from pathlib import Path

import uvicorn
from fastapi import FastAPI

from service import logs
from service.cli.connections import PunctualProtocol
from service.cli.outcomes import ExitCode, is_loopback, reported, say
from service.configuration import Configuration
from service.http.app import create_app
from service.http.guards import HEAD_BYTES
from service.jobs import forking
from service.keys import KeyFile

__all__ = ["serve"]

_GRACE = 5  # seconds for open connections at the end
# Seconds that a thread may keep the interpreter while another waits for it: a request changes
# between event loop and database threads several times, each time behind this at worst.
_TURN = 0.0005
_LOOK = 0.1  # seconds between looks for a signal during the start

logger = logging.getLogger(__name__)


class _Server(uvicorn.Server):
    """A server that starts and stops the service around itself.

    What keeps the service from starting is raised, where uvicorn would print a traceback; streams
    end at shutdown before it waits for connections to close.
    """

    def __init__(self, app: FastAPI, config: uvicorn.Config) -> None:
        self._app = app
        self._service = AsyncExitStack()
        super().__init__(config)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        starting = asyncio.ensure_future(
            self._service.enter_async_context(self._app.router.lifespan_context(self._app))
        )
        while not starting.done():
            await asyncio.wait({starting}, timeout=_LOOK)
            if self.should_exit:  # stopped while it waits for its database
                starting.cancel()
                await asyncio.gather(starting, return_exceptions=True)
                return
        starting.result()
        await super().startup(sockets)
        # What the start left in memory stays for good: looking through it for garbage would stop
        # everybody for a tenth of a second, again and again.
        gc.collect()
        forking.give_back()
        gc.freeze()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._app.state.watcher.close()
        await super().shutdown(sockets)
        await self._service.aclose()


@reported
def serve(
    host: str,
    port: int,
    *,
    insecure: bool = False,
    certfile: Path | None = None,
    keyfile: Path | None = None,
) -> ExitCode:
    """Serve the API and the page until Ctrl-C or SIGTERM.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port to listen on; 0 lets the system choose.
    insecure : bool
        Listen beyond this machine though no API keys are set.
    certfile, keyfile : Path or None
        Certificate with its chain, and its key, PEM; None: HTTP in the clear. The key may stand in
        the file of the certificate.

    Returns
    -------
    ExitCode
        DONE once stopped; BAD_INPUT where the address needs API keys and there are none, or the
        certificate cannot be used; CANNOT_START where the port is taken, or the database does not
        serve.

    """
    configuration = Configuration()
    if configuration.api_keys_file is None and not insecure and not is_loopback(host):
        say(
            f"error: {host} is open to others and no API keys are set. Create some (mutune keys "
            "create) and set MUTUNE_API_KEYS_FILE, or pass --insecure."
        )
        return ExitCode.BAD_INPUT
    logs.configure()
    sys.setswitchinterval(_TURN)
    app = create_app(configuration)
    config = uvicorn.Config(
        app,
        host=host,
        port=port,
        http=PunctualProtocol,
        ws="none",
        lifespan="off",  # the server's own affair, see there
        ssl_certfile=certfile,
        ssl_keyfile=keyfile,
        h11_max_incomplete_event_size=HEAD_BYTES,
        limit_concurrency=configuration.max_connections,
        timeout_graceful_shutdown=_GRACE,
        log_config=None,
        access_log=False,
        server_header=False,
    )
    try:
        config.load()
    except (OSError, ValueError) as error:  # SSLError is an OSError
        say(f"error: {certfile}: {error}")
        return ExitCode.BAD_INPUT
    try:
        listening = _bound(host, port)
    except OSError as error:
        say(f"error: {host}:{port}: {error.strerror}")
        return ExitCode.CANNOT_START
    _warn_of_missing_keys(configuration)
    server = _Server(app, config)
    scheme = "http" if certfile is None else "https"
    logger.info("will serve at %s://%s:%d", scheme, host, listening.getsockname()[1])
    # uvicorn raises the signal again once it has shut down.
    with listening, contextlib.suppress(KeyboardInterrupt):
        server.run([listening])
    return ExitCode.DONE


def _warn_of_missing_keys(configuration: Configuration) -> None:
    """Say what is missing where nobody could call: the first thing that a new container shows."""
    path = configuration.api_keys_file
    if path is not None and not KeyFile(path).all():
        logger.warning(
            "%s holds no API keys, so every request is refused; make one with the same "
            "MUTUNE_API_KEYS_FILE, at any time: mutune keys create NAME",
            path,
        )


def _bound(host: str, port: int) -> socket.socket:
    """Return a socket bound to an address; it does not listen yet."""
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    # With the protocol named asyncio turns off Nagle's algorithm.
    found = socket.socket(family, kind, protocol or socket.IPPROTO_TCP)
    try:
        if os.name == "posix":  # elsewhere it would permit two services on one port
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind(address)
    except OSError:
        found.close()
        raise
    return found
