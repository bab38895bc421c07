"""What runs inside a worker process: one tuning, from JSON text to JSON text."""

from __future__ import annotations

import json
import logging
import time

import numpy as np
from distributed import Worker, get_worker

import service.schemas
import solver.tuning
from service.jobs.records import JobStatus, Outcome
from service.problems import NumbersError, describe
from solver.errors import Cancelled, InvalidInputError
from solver.results import Progress, Status, Tuning

__all__ = ["TOPIC", "solve"]

TOPIC = "mutune"
_REPORT_EVERY = 0.1  # seconds; a watcher sees no finer steps

logger = logging.getLogger(__name__)


def solve(address: str, key: str, request: str) -> Outcome:
    """Tune; tell start, progress and end under `TOPIC`; stop when the task is released.

    Parameters
    ----------
    address : str
        Address of this worker.
    key : str
        Key of this Dask task.
    request : str
        JSON text of a `TuningRequest`.

    """
    worker: Worker = get_worker()
    message = {"worker": address, "key": key}
    worker.log_event(TOPIC, {**message, "what": "started"})
    try:
        return _outcome(request, _Reporter(worker, message))
    finally:
        worker.log_event(TOPIC, {**message, "what": "ended"})


class _Reporter:
    """Progress callback of the solver."""

    def __init__(self, worker: Worker, message: dict[str, str]) -> None:
        self._worker = worker
        self._message = message
        self._next = 0.0

    def __call__(self, progress: Progress) -> None:
        task = self._worker.state.tasks.get(self._message["key"])
        # Dask marks a running task whose result nobody wants any more: it was cancelled, or the
        # process that asked for it is gone.
        if task is None or task.state != "executing":
            raise Cancelled
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _REPORT_EVERY
            state = {"what": "progress", "fraction": progress.fraction, "best": progress.best}
            self._worker.log_event(TOPIC, {**self._message, **state})


def _outcome(request: str, report: _Reporter) -> Outcome:
    try:
        specification = service.schemas.parse_tuning_request(request).build()
        tuning = solver.tuning.tune(specification, report)
    except Cancelled:
        return Outcome(JobStatus.CANCELLED)
    except InvalidInputError as error:
        return Outcome(JobStatus.FAILED, error=json.dumps(describe(error)))
    except (ArithmeticError, np.linalg.LinAlgError):
        logger.exception("numbers beyond double precision")
        return Outcome(JobStatus.FAILED, error=json.dumps(describe(NumbersError())))
    except Exception as error:
        logger.exception("a tuning failed")
        return Outcome(JobStatus.FAILED, error=json.dumps(describe(error)))
    result = json.dumps(service.schemas.tuning_to_json(tuning), separators=(",", ":"))
    timed_out = tuning.status is Status.TIME_LIMIT
    status = JobStatus.TIMED_OUT if timed_out else JobStatus.SUCCEEDED
    return Outcome(status, result, best=_reached(tuning))


def _reached(tuning: Tuning) -> float | None:
    """Return the objective of the final settings; the search reports that of its own grid."""
    if tuning.objective == "tau_p":
        return tuning.tau_p
    return None if tuning.peaks is None else tuning.peaks.robust_performance.value
