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

# What Dask watches for a dashboard and for tasks that depend on each other. Here a worker has one
# call at a time and nothing else, and all this took a seventh of a core on an idle machine.
_QUIET = {
    "distributed.admin.low-level-log-length": 10,
    "distributed.admin.log-length": 100,
    "distributed.admin.system-monitor.disk": False,
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.log-length": 10,
    "distributed.admin.tick.interval": "1s",
    "distributed.client.scheduler-info-interval": "1m",
    "distributed.scheduler.http.routes": [],  # pages in the clear, for whoever finds the port
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.scheduler.work-stealing": False,
    "distributed.worker.http.routes": [],
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.worker.profile.enabled": False,
}


def prepare() -> BaseContext:
    """Return the context for new processes, and make Dask use it too."""
    dask.config.set({"distributed.worker.multiprocessing-method": "forkserver", **_QUIET})
    context: BaseContext = get_mp_context()  # sets a list of its own, which ours replaces
    forking.start()
    return context
