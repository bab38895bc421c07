"""``mutune serve``: the service in this process, until it is stopped."""

from __future__ import annotations

import contextlib
import gc
import socket
import sys

import uvicorn
from fastapi import FastAPI

from service import logs
from service.cli.outcomes import ExitCode, is_loopback, reported, say
from service.configuration import Configuration
from service.http.app import create_app

__all__ = ["serve"]

_GRACE = 5  # seconds for open connections at the end
# Seconds that a thread may keep the interpreter while another waits for it: a request changes
# between event loop and database threads several times, each time behind this at worst.
_TURN = 0.0005


class _Server(uvicorn.Server):
    """A server that ends its streams at shutdown, before it waits for connections to close."""

    def __init__(self, app: FastAPI, host: str, port: int) -> None:
        self._app = app
        super().__init__(
            uvicorn.Config(
                app,
                host=host,
                port=port,
                timeout_graceful_shutdown=_GRACE,
                log_config=None,
                access_log=False,
            )
        )

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        # What the start left in memory stays for good: looking through it for garbage would stop
        # everybody for a tenth of a second, again and again.
        gc.collect()
        gc.freeze()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._app.state.watcher.close()
        await super().shutdown(sockets)


@reported
def serve(host: str, port: int, *, insecure: bool = False) -> ExitCode:
    """Serve the API and the page until Ctrl-C or SIGTERM.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port to listen on; 0 lets the system choose.
    insecure : bool
        Listen beyond this machine though no API keys are set.

    Returns
    -------
    ExitCode
        DONE once stopped; BAD_INPUT where the address needs API keys and there are none; FAILED
        where the service could not start.

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
    server = _Server(create_app(configuration), host, port)
    with contextlib.suppress(KeyboardInterrupt):  # uvicorn raises it again once it has shut down
        server.run()
    return ExitCode.DONE if server.started else ExitCode.FAILED
