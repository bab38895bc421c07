"""How this service starts processes: forked from one server that has everything imported.

A worker is there in milliseconds instead of seconds, and all workers share the memory of the
imported libraries.
"""

from __future__ import annotations

from multiprocessing.context import BaseContext

import dask
from distributed.utils import get_mp_context

from service.jobs import forking

__all__ = ["prepare"]


def prepare() -> BaseContext:
    """Return the context for new processes, and make Dask use it too."""
    dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
    context: BaseContext = get_mp_context()  # sets a list of its own, which ours replaces
    forking.start()
    return context
