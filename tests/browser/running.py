"""The service as a user starts it, in a process of its own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

__all__ = ["MUTUNE", "Service"]

MUTUNE = str(Path(sys.executable).with_name("mutune"))
PATIENCE = 300.0  # seconds; a start takes four, only a failure as long as this


class Service:
    """``mutune serve`` on a free port, which it keeps when it is started again.

    Parameters
    ----------
    folder : Path
        For its data and its log.
    environment : str
        Further settings.

    """

    def __init__(self, folder: Path, **environment: str) -> None:
        self._folder = folder
        ours = {
            "MUTUNE_DATA_DIR": str(folder),
            "MUTUNE_WORKERS": "1",
            "MUTUNE_ANALYSIS_TIME_LIMIT": "300",
        }
        self._environment = {**os.environ, **ours, **environment}
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port: int = probe.getsockname()[1]
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        """Where it is."""
        return f"http://127.0.0.1:{self._port}"

    @property
    def log(self) -> Path:
        """File of what it prints."""
        return self._folder / "service.log"

    def start(self) -> None:
        """Start it and wait until it can work."""
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(  # noqa: S603 - our own command
                [MUTUNE, "serve", "--port", str(self._port)],
                stdout=log,
                stderr=log,
                env=self._environment,
            )
        deadline = time.monotonic() + PATIENCE
        while not self._is_ready():
            if self._process.poll() is not None or time.monotonic() > deadline:
                self.stop()
                pytest.fail(self.log.read_text())
            time.sleep(0.1)

    def _is_ready(self) -> bool:
        try:
            return httpx.get(f"{self.url}/readyz").is_success
        except httpx.TransportError:
            return False

    def stop(self) -> None:
        """Stop it as Ctrl-C or a service manager does."""
        assert self._process is not None
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(PATIENCE)
