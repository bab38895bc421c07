"""The server that this service's processes are forked from; it has everything imported.

This module imports next to nothing, so that a command can start the server first and do its own
imports meanwhile: both take seconds.
"""

from __future__ import annotations

import os
from multiprocessing import forkserver

__all__ = ["start"]

# BLAS on one thread: a server without threads can be forked, results do not depend on the number
# of cores, and as many workers as cores do not get into each other's way.
_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def start() -> None:
    """Start the server, unless it runs; do not wait until it has done its imports."""
    for name in _THREADS:
        os.environ[name] = "1"
    forkserver.set_forkserver_preload(["service.jobs.fork_server"])
    forkserver.ensure_running()
