"""The server that this service's processes are forked from; it has everything imported.

This module imports next to nothing, so that a command can start the server first and do its own
imports meanwhile: both take seconds.
"""

from __future__ import annotations

import os
from multiprocessing import forkserver

__all__ = ["listen", "progress", "start", "tell"]

_VARIABLE = "MUTUNE_START_PROGRESS"  # for the server alone: where it tells how far it is
_SIZE = 200

# BLAS on one thread: a server without threads can be forked, results do not depend on the number
# of cores, and as many workers as cores do not get into each other's way.
_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


_kept: dict[str, int] = {}  # the file in memory that the server writes to, once there is one


def start() -> None:
    """Start the server, unless it runs; do not wait until it has done its imports."""
    for name in _THREADS:
        os.environ[name] = "1"
    listen()
    forkserver.set_forkserver_preload(["service.jobs.fork_server"])
    forkserver.ensure_running()


def listen() -> None:
    """Make what the server writes its progress to; where there is no such thing it is not told."""
    if "sheet" not in _kept and hasattr(os, "memfd_create"):
        _kept["sheet"] = os.memfd_create("mutune-start")
        os.environ[_VARIABLE] = f"/proc/{os.getpid()}/fd/{_kept['sheet']}"


def progress() -> str | None:
    """Return what the server is doing before it can be forked; None: nothing, or nobody knows."""
    if "sheet" not in _kept:
        return None
    return os.pread(_kept["sheet"], _SIZE, 0).rstrip(b" \0").decode() or None


def tell(text: str) -> None:
    """Say, in the server, what it is doing."""
    path = os.environ.get(_VARIABLE)
    if path is None:
        return
    try:
        descriptor = os.open(path, os.O_WRONLY)
    except OSError:  # whoever started this server has gone
        return
    os.pwrite(descriptor, text.encode().ljust(_SIZE)[:_SIZE], 0)
    os.close(descriptor)
