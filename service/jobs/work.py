"""What runs inside a worker process: one job, from JSON text to JSON text."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable

import numpy as np
from distributed import Status as WorkerStatus
from distributed import Worker, get_worker
from pydantic_core import to_json

import service.schemas
from service import registry
from service.beyond import unfinished
from service.jobs.records import TUNINGS, JobStatus, Outcome
from service.problems import NumbersError, describe
from service.valves import finished
from solver.model.errors import Cancelled, InvalidInputError
from solver.tuning.record import Progress, Status, Tuning

__all__ = ["TOPIC", "SolvingActor"]

TOPIC = "mutune"
_REPORT_EVERY = 0.25  # seconds: each report wakes three event loops

logger = logging.getLogger(__name__)


class SolvingActor:
    """A Dask actor: lives in a worker process and computes there, one job at a time.

    The engine calls it directly, without the scheduler in between, which would cost several
    times as much as the call.

    Parameters
    ----------
    key : str
        Key under which Dask knows this actor.

    """

    def __init__(self, key: str) -> None:
        self._key = key
        self._worker: Worker = get_worker()
        self._unwanted: set[str] = set()
        self._enough: set[str] = set()

    def solve(self, call: str, resource: str, request: str) -> Outcome:
        """Compute; tell the progress under `TOPIC`; stop when the call is not wanted any more.

        Parameters
        ----------
        call : str
            Name of this call.
        resource : str
            What it is a job of.
        request : str
            JSON text of a request of that.

        """
        try:
            report = _Reporter(call, self._worker, self._wants, self._enough.__contains__)
            return _outcome(resource, request, report)
        finally:
            self._unwanted.discard(call)
            self._enough.discard(call)

    async def stop(self, call: str) -> None:
        """Make a call of `solve` end soon; a coroutine runs beside it, in the event loop."""
        self._unwanted.add(call)

    async def finish(self, call: str) -> None:
        """Make a call of `solve` end soon with the best so far."""
        self._enough.add(call)

    def _wants(self, call: str) -> bool:
        """Whether anybody waits for the result of a call."""
        return (
            call not in self._unwanted
            # Dask drops an actor whose client has gone.
            and self._key in self._worker.state.actors
            # A worker that is told to leave hands its work back.
            and self._worker.status in {WorkerStatus.running, WorkerStatus.paused}
        )


class _Reporter:
    """Progress callback of the solver."""

    def __init__(
        self,
        call: str,
        worker: Worker,
        wants: Callable[[str], bool],
        has_enough: Callable[[str], bool],
    ) -> None:
        self._call = call
        self._worker = worker
        self._wants = wants
        self._has_enough = has_enough
        self._next = time.monotonic() + _REPORT_EVERY

    def check(self) -> bool:
        """Return whether the best so far will do; raise `Cancelled` where nobody waits for it."""
        if not self._wants(self._call):
            raise Cancelled
        return self._has_enough(self._call)

    def keep(self, result: str, best: float | None) -> None:
        """Tell a result that stands even if the computation has to be stopped."""
        self._worker.log_event(TOPIC, {"call": self._call, "result": result, "best": best})

    def __call__(self, progress: Progress) -> bool:
        enough = self.check()
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _REPORT_EVERY
            self._worker.log_event(
                TOPIC,
                {"call": self._call, "fraction": progress.fraction, "best": progress.best},
            )
        return enough


def _outcome(resource: str, request: str, report: _Reporter) -> Outcome:
    try:
        if resource == TUNINGS:
            return _tuned(request, report)
        return _analysed(resource, request, report)
    except Cancelled:
        return Outcome(JobStatus.CANCELLED)
    except InvalidInputError as error:
        return Outcome(JobStatus.FAILED, error=json.dumps(describe(error)))
    except (ArithmeticError, np.linalg.LinAlgError):
        logger.exception("numbers beyond double precision")
        return Outcome(JobStatus.FAILED, error=json.dumps(describe(NumbersError())))
    except Exception as error:
        logger.exception("a job failed")
        return Outcome(JobStatus.FAILED, error=json.dumps(describe(error)))


def _tuned(request: str, report: _Reporter) -> Outcome:
    from solver.tuning import tuner  # noqa: PLC0415 - compiled kernels, where tunings run alone

    asked = service.schemas.parse_tuning_request(request)
    tuning = tuner.tune(asked.build(), report)
    if asked.search.limit and tuning.loops:
        # What follows may take longer than anybody waits: the settings are there already.
        search = asked.search.model_copy(update={"limit": False})
        alone = finished(asked.model_copy(update={"search": search}), tuning, report.check)
        kept = alone | {"limit": unfinished()} | asked.identity()
        report.keep(to_json(kept).decode(), _reached(tuning))
    document = finished(asked, tuning, report.check)
    enough = report.check()
    # Pydantic's writer takes a tenth of the time of the standard library's.
    result = to_json(document | asked.identity()).decode()
    status = JobStatus.SUCCEEDED
    if tuning.status is Status.TIME_LIMIT:
        status = JobStatus.CANCELLED if enough else JobStatus.TIMED_OUT
    if status is JobStatus.CANCELLED and not tuning.loops:
        return Outcome(status)
    return Outcome(status, result, best=_reached(tuning))


def _analysed(resource: str, request: str, report: _Reporter) -> Outcome:
    analysis = next(one for one in registry.every() if one.resource == resource)
    if analysis.job is None:
        message = f"{resource} are not computed as jobs"
        raise ValueError(message)
    asked = service.schemas.parse(analysis.request, request.encode())
    document = analysis.job.compute(asked, report) | asked.identity()
    return Outcome(JobStatus.SUCCEEDED, to_json(document).decode())


def _reached(tuning: Tuning) -> float | None:
    """Return the objective of the final settings; the search reports that of its own grid."""
    if tuning.objective == "tau_p":
        return tuning.tau_p
    return None if tuning.peaks is None else tuning.peaks.robust_performance.value
