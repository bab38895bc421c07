"""From the queue to the engine and back: as many jobs as there are workers, each written once."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from service.jobs.engine import Engine, EngineLostError, WorkerLostError
from service.jobs.queue import Queue
from service.jobs.records import Claim, JobStatus, Outcome, Priority, Snapshot
from service.jobs.transactions import StoreUnavailableError
from service.jobs.watch import Watcher
from service.problems import WorkerDiedError, describe

__all__ = ["Dispatcher"]

_POLL = 0.25  # seconds: how late a request of another process is seen
_MOMENT = 0.05  # seconds between looks for cancelled jobs, however often this wakes
_RETRY = 1.0  # seconds between tries to write to a database that does not answer
_DRAIN = 10.0  # seconds for the running jobs to stop at shutdown
_PATIENCE = 0.25  # seconds that an interactive job waits before one of a batch makes room for it

logger = logging.getLogger(__name__)


@dataclass
class _Run:
    """A job on the engine."""

    claim: Claim
    since: float = field(default_factory=time.monotonic)
    task: asyncio.Task[None] | None = None

    def stop(self) -> None:
        """Cancel once: a second time would interrupt the stopping itself."""
        if self.task is not None and not self.task.cancelling():
            self.task.cancel()


class Dispatcher:
    """Keeps the engine busy with the next jobs of the queue.

    Parameters
    ----------
    queue : Queue
        The queue.
    engine : Engine
        Where the jobs run.
    max_attempts : int
        Workers that a job may lose before it counts as failed.
    watcher : Watcher
        Told of each write that somebody may wait for.
    on_end : callable
        Told of each job that ended: the claim, its outcome, and the seconds it ran.

    """

    def __init__(
        self,
        queue: Queue,
        engine: Engine,
        max_attempts: int,
        watcher: Watcher,
        on_end: Callable[[Claim, Outcome, float], None],
    ) -> None:
        self._queue = queue
        self._engine = engine
        self._max_attempts = max_attempts
        self._watcher = watcher
        self._on_end = on_end
        self._wake = asyncio.Event()
        self._runs: dict[str, _Run] = {}
        self._progress: dict[str, tuple[float, float | None]] = {}
        self._next_look = 0.0

    def wake(self) -> None:
        """Look at the queue now."""
        self._wake.set()

    async def run(self) -> None:
        """Dispatch until cancelled; then stop the running jobs and put them back."""
        await self._insist(self._queue.requeue_all)
        try:
            while True:
                try:
                    await self._round()
                except StoreUnavailableError as error:
                    logger.warning("the database does not answer: %s", error)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_POLL):
                        await self._wake.wait()
                self._wake.clear()
        finally:
            await self._drain()

    async def _round(self) -> None:
        if self._engine.idle:
            for claim in await asyncio.to_thread(self._queue.claim, self._engine.idle):
                # The earlier run of a job that was put back may just be ending.
                run = self._runs[claim.id] = _Run(claim)
                run.task = asyncio.create_task(self._run(run))
        elif any(run.claim.priority is Priority.BATCH for run in self._runs.values()):
            await self._make_room()
        if self._progress:
            progress, self._progress = self._progress, {}
            await asyncio.to_thread(self._queue.record_progress, progress)
            self._watcher.poke()
        if self._runs and time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + _MOMENT
            for job_id in await asyncio.to_thread(self._queue.cancellations, list(self._runs)):
                if job_id in self._runs:
                    self._runs[job_id].stop()

    async def _make_room(self) -> None:
        """Put the youngest jobs of batches back for interactive ones that have waited."""
        waiting = await asyncio.to_thread(self._queue.interactive_since, time.time() - _PATIENCE)
        of_batch = [run for run in self._runs.values() if run.claim.priority is Priority.BATCH]
        of_batch.sort(key=lambda run: run.since, reverse=True)
        for run in of_batch[:waiting]:
            run.stop()

    async def _run(self, run: _Run) -> None:
        claim = run.claim

        def note(fraction: float, best: float | None) -> None:
            self._progress[claim.id] = (fraction, best)

        try:
            await self._finish(run, await self._engine.run(claim, note))
        except WorkerLostError:
            await self._after_loss(run)
        except (EngineLostError, asyncio.CancelledError):
            # A job to be cancelled ends with this; any other goes back into the queue.
            await self._put_back(self._queue.requeue, [claim.id])
        except Exception as error:
            logger.exception("job %s", claim.id)
            await self._finish(run, Outcome(JobStatus.FAILED, error=json.dumps(describe(error))))
        finally:
            if self._runs.get(claim.id) is run:
                self._progress.pop(claim.id, None)
                del self._runs[claim.id]

    async def _after_loss(self, run: _Run) -> None:
        attempts = run.claim.attempts + 1
        logger.warning("job %s lost its worker, attempt %d", run.claim.id, attempts)
        if attempts < self._max_attempts:
            await self._put_back(self._queue.requeue_after_loss, run.claim.id)
            return
        detail = f"The worker process died in each of {attempts} attempts."
        error = json.dumps(describe(WorkerDiedError(detail)))
        await self._finish(run, Outcome(JobStatus.FAILED, error=error))

    async def _put_back(self, write: Callable[..., object], *arguments: object) -> None:
        await self._insist(write, *arguments)
        self._watcher.poke()
        self.wake()

    async def _finish(self, run: _Run, outcome: Outcome) -> None:
        if outcome.status is JobStatus.CANCELLED:  # it was stopped, but not by us: run it again
            raise EngineLostError
        await self._insist(self._queue.finish, run.claim.id, outcome)
        if outcome.status is JobStatus.SUCCEEDED:
            self._watcher.tell(run.claim.id, Snapshot(outcome.status, 1.0, outcome.best))
        else:
            self._watcher.poke()
        self._on_end(run.claim, outcome, time.monotonic() - run.since)

    async def _insist(self, write: Callable[..., object], *arguments: object) -> None:
        """Write, and try again until the database takes it: the result must not be lost."""
        while True:
            try:
                await asyncio.to_thread(write, *arguments)
            except StoreUnavailableError as error:
                logger.warning("the database does not answer: %s", error)
                await asyncio.sleep(_RETRY)
            else:
                return

    async def _drain(self) -> None:
        tasks = [run.task for run in self._runs.values() if run.task is not None]
        for run in self._runs.values():
            run.stop()
        if tasks:  # what the database does not take in time is put back at the next start
            await asyncio.wait(tasks, timeout=_DRAIN)
