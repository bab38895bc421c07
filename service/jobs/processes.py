"""How this service starts processes: forked from one server that has everything imported.

A worker is there in milliseconds instead of seconds, and all workers share the memory of the
imported libraries.
"""

from __future__ import annotations

import multiprocessing
import os
from multiprocessing.context import BaseContext

import dask
from distributed.utils import get_mp_context

__all__ = ["prepare"]

# BLAS on one thread: a server without threads can be forked, results do not depend on the number
# of cores, and as many workers as cores do not get into each other's way.
_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def prepare() -> BaseContext:
    """Return the context for new processes, and make Dask use it too."""
    for name in _THREADS:
        os.environ[name] = "1"
    dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
    context: BaseContext = get_mp_context()  # sets a list of its own, which ours replaces
    multiprocessing.set_forkserver_preload(["service.jobs.fork_server"])
    return context
