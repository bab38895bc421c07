"""``mutune serve``: the service in this process, until it is stopped."""

from __future__ import annotations

import contextlib

import uvicorn

from service.app import create_app
from service.cli.outcomes import ExitCode, reported

__all__ = ["serve"]

_GRACE = 5  # seconds for open connections at the end


@reported
def serve(host: str, port: int) -> ExitCode:
    """Serve the API and the page until Ctrl-C or SIGTERM.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port to listen on; 0 lets the system choose.

    Returns
    -------
    ExitCode
        DONE once stopped; FAILED where the service could not start.

    """
    config = uvicorn.Config(create_app(), host=host, port=port, timeout_graceful_shutdown=_GRACE)
    server = uvicorn.Server(config)
    with contextlib.suppress(KeyboardInterrupt):  # uvicorn raises it again once it has shut down
        server.run()
    return ExitCode.DONE if server.started else ExitCode.FAILED
