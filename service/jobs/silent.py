"""Scheduler and worker without the HTTP server that Dask opens beside each, in the clear."""

from __future__ import annotations

from distributed import Scheduler, Worker

__all__ = ["SilentScheduler", "SilentWorker"]


class _Silent:
    """Opens no port for HTTP: service and `/metrics` tell what there is to know."""

    def start_http_server(self, *_args: object, **_options: object) -> None:
        """Do nothing where `distributed.node.ServerNode` would listen."""


class SilentScheduler(_Silent, Scheduler):  # type: ignore[misc]  # Dask has no types
    """A scheduler that listens on its own port alone."""


class SilentWorker(_Silent, Worker):  # type: ignore[misc]  # the same
    """A worker that listens on its own port alone."""
