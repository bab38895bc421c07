"""Interfaces of the machine: a browser drops its requests when one comes or goes.

Tests run beside each other in several processes, so they agree by a lock on a file.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FILE = Path(tempfile.gettempdir()) / f"mutune-tests-network-{os.getuid()}.lock"


@contextmanager
def unchanged() -> Iterator[None]:
    """Let no other test change interfaces meanwhile."""
    with _locked(fcntl.LOCK_SH):
        yield


@contextmanager
def changing() -> Iterator[None]:
    """Wait until no test needs the interfaces as they are, and let none begin meanwhile."""
    with _locked(fcntl.LOCK_EX):
        yield


@contextmanager
def _locked(kind: int) -> Iterator[None]:
    with _FILE.open("a") as file:
        fcntl.flock(file, kind)  # freed when the file is closed
        yield
