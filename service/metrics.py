"""Prometheus metrics of one process."""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

from service.jobs.records import JobStatus

__all__ = ["Metrics"]

_LATENCY = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.06, 0.1, 0.25, 1.0, 2.5, 10.0, 60.0)


class Metrics:
    """What the service measures; each app has its own registry."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self._latency = Histogram(
            "mutune_http_request_seconds",
            "Time from the request to the end of its answer.",
            ("method", "route", "status"),
            buckets=_LATENCY,
            registry=self.registry,
        )
        self._jobs = Gauge("mutune_jobs", "Jobs in the table.", ("status",), registry=self.registry)
        self._workers = Gauge("mutune_workers", "Workers that take jobs.", registry=self.registry)
        self._refused = Gauge(
            "mutune_workers_refused",
            "Workers with another version of mutune.",
            registry=self.registry,
        )
        self._ended = Counter(
            "mutune_jobs_ended", "Jobs that ended here.", ("status",), registry=self.registry
        )

    def observe_request(self, method: str, route: str, status: int, seconds: float) -> None:
        """Note an answered request."""
        self._latency.labels(method, route, status).observe(seconds)

    def render(self, counts: dict[JobStatus, int], workers: int, refused: int) -> bytes:
        """Return the metrics in Prometheus's text format."""
        for status in JobStatus:
            self._jobs.labels(status).set(counts.get(status, 0))
        self._workers.set(workers)
        self._refused.set(refused)
        return generate_latest(self.registry)
