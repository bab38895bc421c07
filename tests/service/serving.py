"""A service in a thread of the tests, on a free port, spoken to over real sockets."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import uvicorn
from fastapi import FastAPI
from real import PATIENCE


@contextmanager
def served(app: FastAPI) -> Iterator[httpx.Client]:
    """Serve `app` and yield a client of it."""
    # With the protocol named asyncio turns off Nagle's algorithm, as it does in `mutune serve`;
    # without it every answer takes 40 ms longer.
    with socket.socket(proto=socket.IPPROTO_TCP) as listening:
        listening.bind(("127.0.0.1", 0))
        port = listening.getsockname()[1]
        server = uvicorn.Server(uvicorn.Config(app, log_config=None))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            while not server.started and thread.is_alive():
                time.sleep(0.01)
            with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE) as client:
                yield client
        finally:
            server.should_exit = True
            thread.join()


class _Kept(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.entries: list[dict[str, object]] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep what a line of the log would hold, but for its time and the id of the request."""
        event = {"event": record.getMessage(), "log_level": record.levelname.lower()}
        self.entries.append({**getattr(record, "fields", {}), **event})


@contextmanager
def captured_logs() -> Iterator[list[dict[str, object]]]:
    """Yield the lines that requests and acts leave in the log."""
    logger, kept = logging.getLogger("mutune"), _Kept()
    level = logger.level
    logger.addHandler(kept)
    logger.setLevel(logging.INFO)
    try:
        yield kept.entries
    finally:
        logger.setLevel(level)
        logger.removeHandler(kept)
