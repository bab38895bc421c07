"""``scripts/run`` as a process of the tests."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import psutil

__all__ = ["ROOT", "Tour", "touring"]

ROOT = Path(__file__).parent.parent
PATIENCE = 300.0  # seconds; a run takes 15, on a busy machine more
GRACE = 60.0  # seconds; helpers of multiprocessing end when they see that their parent has


@dataclass
class Tour:
    """A running ``scripts/run``."""

    process: subprocess.Popen[str]
    lines: list[str] = field(default_factory=list)

    @property
    def output(self) -> str:
        """What it has printed so far."""
        return "".join(self.lines)

    @property
    def url(self) -> str:
        """Address of the service."""
        return self.wait_for(r"Page: +(http://\S+)/\n")[1]

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Return the first match in the output, as soon as it is there."""
        deadline = time.monotonic() + PATIENCE
        while True:
            ended = self.process.poll() is not None
            if match := re.search(pattern, self.output):
                return match
            assert not ended, self.output
            assert time.monotonic() < deadline, self.output
            time.sleep(0.05)

    def interrupt(self) -> int:
        """Press Ctrl-C; return the exit code."""
        os.killpg(self.process.pid, signal.SIGINT)
        return self.process.wait(PATIENCE)

    def left_behind(self) -> list[str]:
        """Return the command lines of its processes that do not end by themselves."""
        deadline = time.monotonic() + GRACE
        while (left := self._alive()) and time.monotonic() < deadline:
            time.sleep(0.05)
        return left

    def _alive(self) -> list[str]:
        found = []
        for process in psutil.process_iter(["cmdline", "status"]):
            try:
                ours = os.getsid(process.pid) == self.process.pid
            except ProcessLookupError:
                continue
            if ours and process.info["status"] != psutil.STATUS_ZOMBIE:
                found.append(" ".join(process.info["cmdline"] or []))
        return found


@contextmanager
def touring(folder: Path, *arguments: str) -> Iterator[Tour]:
    """Run ``scripts/run`` in a session of its own, with its data in `folder`."""
    process = subprocess.Popen(  # noqa: S603 - our own script
        [ROOT / "scripts" / "run", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "MUTUNE_DATA_DIR": str(folder), "MUTUNE_WORKERS": "1"},
    )
    tour = Tour(process)
    assert process.stdout is not None
    reader = threading.Thread(target=tour.lines.extend, args=(process.stdout,))
    reader.start()
    try:
        yield tour
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        reader.join()
        process.stdout.close()
