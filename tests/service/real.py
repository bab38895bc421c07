"""The service as real processes, for tests that kill them."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import httpx

MUTUNE = str(Path(sys.executable).with_name("mutune"))
DASK = str(Path(sys.executable).with_name("dask"))
FAKE_TUNER = str(Path(__file__).with_name("fake_tune.py"))
PATIENCE = 300.0  # seconds: these machines are slow and busy; only a failure lasts as long


def free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def until(condition: Callable[[], object], what: str) -> None:
    """Wait for a condition."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"waited {PATIENCE:g} s for {what}"
        time.sleep(0.05)


class Process:
    """A process with its output in a file; everything that it starts dies with it at the end."""

    def __init__(self, log: Path, *command: str, **environment: str) -> None:
        self._log = log.open("ab")
        self._popen = subprocess.Popen(  # noqa: S603 - our own commands
            command,
            stdout=self._log,
            stderr=self._log,
            env={
                **os.environ,
                "DASK_DISTRIBUTED__WORKER__PRELOAD": FAKE_TUNER,
                **environment,
            },
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._popen.pid

    def signal(self, number: int) -> None:
        """Send a signal to the process alone."""
        self._popen.send_signal(number)

    def wait(self) -> int:
        """Return the exit code."""
        return self._popen.wait(PATIENCE)

    def kill(self) -> None:
        """Kill -9 of the process alone: its children see to themselves."""
        self.signal(signal.SIGKILL)
        self.wait()

    def wait_for_children(self) -> None:
        """Wait until everything that the dead process had started has ended too."""
        until(lambda: not session(self.pid), "children to end")

    def end(self) -> None:
        """Kill the process and whatever it has started."""
        with suppress(ProcessLookupError):  # it has ended already
            os.killpg(self.pid, signal.SIGKILL)
        self._popen.wait(PATIENCE)
        self._log.close()


class Service(Process):
    """``mutune serve`` on a free port."""

    def __init__(self, folder: Path, port: int | None = None, **environment: str) -> None:
        self.port = port or free_port()
        super().__init__(
            folder / "service.log",
            MUTUNE,
            "serve",
            "--port",
            str(self.port),
            **{"MUTUNE_DATA_DIR": str(folder / "data"), "MUTUNE_WORKERS": "2", **environment},
        )
        self.client = httpx.Client(
            base_url=f"http://127.0.0.1:{self.port}",
            timeout=PATIENCE,
            transport=httpx.HTTPTransport(retries=1),
        )

    def is_ready(self) -> bool:
        """Whether database and workers answer."""
        return self._answers("/readyz")

    def is_up(self) -> bool:
        """Whether it answers at all."""
        return self._answers("/healthz")

    def _answers(self, path: str) -> bool:
        try:
            return self.client.get(path).status_code == 200
        except httpx.TransportError:
            return False

    def worker_pids(self) -> list[int]:
        """Return the process ids of its Dask workers: the children of its fork server."""
        servers = [pid for pid in _children(self.pid) if "resource_tracker" not in _command(pid)]
        return [pid for server in servers for pid in _children(server)]

    def end(self) -> None:
        """Kill it with its workers."""
        self.client.close()
        super().end()


def _children(parent: int) -> list[int]:
    return [pid for pid, fields in _processes() if int(fields[1]) == parent]


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except FileNotFoundError:
        return ""


def session(leader: int) -> list[int]:
    """Return the living processes of the session that `leader` began."""
    return [pid for pid, fields in _processes() if int(fields[3]) == leader]


def _processes() -> Iterator[tuple[int, list[str]]]:
    """Yield id and status fields (state, parent, group, session, ...) of living processes."""
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            fields = entry.read_text().rpartition(")")[2].split()
            if fields[0] != "Z":
                yield int(entry.parent.name), fields
