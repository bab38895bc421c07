"""Prometheus metrics of one process."""

from __future__ import annotations

import json
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

from service.jobs.records import Ended, JobStatus

__all__ = ["RequestMetrics"]

_UNITS = (1, 2, 5, 10, 100, 1000)
_DURATION = (0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 3600.0)
_LATENCY = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.06, 0.1, 0.25, 1.0, 2.5, 10.0, 60.0)


class RequestMetrics:
    """What the service measures; each app has its own registry."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self._latency = Histogram(
            "mutune_http_request_seconds",
            "Time from the request to the end of its response.",
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
            "mutune_jobs_ended",
            "Jobs that this process has seen end.",
            ("status", "reason"),
            registry=self.registry,
        )
        self._durations = Histogram(
            "mutune_job_seconds",
            "Time from the start of a job to its end.",
            ("resource", "objective", "units"),
            buckets=_DURATION,
            registry=self.registry,
        )

    def observe_request(self, method: str, route: str, status: int, seconds: float) -> None:
        """Note a request that has its response."""
        self._latency.labels(method, route, status).observe(seconds)

    def observe_job(self, ended: Ended) -> None:
        """Note a job that ended."""
        request = json.loads(ended.claim.request)
        label = _units(request.get("plant"))
        error = ended.outcome.error
        reason = "" if error is None else json.loads(error)["type"]
        seconds = ended.finished_at - ended.claim.started_at
        objective = request.get("objective", "")
        self._durations.labels(ended.claim.resource, objective, label).observe(seconds)
        self._ended.labels(ended.outcome.status, reason).inc()

    def render(self, counts: dict[JobStatus, int], workers: int, refused: int) -> bytes:
        """Return the metrics in Prometheus's text format."""
        for status in JobStatus:
            self._jobs.labels(status).set(counts.get(status, 0))
        self._workers.set(workers)
        self._refused.set(refused)
        return generate_latest(self.registry)


def _units(plant: dict[str, Any] | None) -> str:
    """Return in words how many units a plant has."""
    if plant is None:
        return ""
    units = plant["n"] if "n" in plant else len(plant["elements"])
    bound = next((bound for bound in _UNITS if units <= bound), None)
    return "more" if bound is None else f"up to {bound}"
