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
from service.jobs.records import TUNINGS, Dispatch, Ended, JobStatus, Outcome, Priority, TakenJob
from service.jobs.transactions import StoreUnavailableError
from service.jobs.watch import Watcher
from service.problems import WorkerDiedError, describe

__all__ = ["Dispatcher"]

_POLL = 0.25  # seconds: how late a request of another process is seen
_RETRY = 1.0  # seconds between tries to write to a database that does not answer
_DRAIN = 10.0  # seconds for the running jobs to stop at shutdown
_PATIENCE = 0.25  # seconds that a job waits before another one makes room for it

logger = logging.getLogger(__name__)


@dataclass(eq=False)
class _RunningJob:
    """A job on the engine."""

    claim: TakenJob
    task: asyncio.Task[None] | None = None
    enough: asyncio.Event = field(default_factory=asyncio.Event)

    @property
    def stopping(self) -> bool:
        """Whether it has been told to stop."""
        if self.enough.is_set():
            return True
        return self.task is not None and bool(self.task.cancelling())

    def end(self) -> None:
        """Stop because the caller wants no more; a tuning of its own keeps the best so far."""
        if self.claim.priority is Priority.INTERACTIVE and self.claim.resource == TUNINGS:
            self.enough.set()
        else:
            self.stop()

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
        Told of each job that ended.

    """

    def __init__(
        self,
        queue: Queue,
        engine: Engine,
        max_attempts: int,
        watcher: Watcher,
        on_end: Callable[[Ended], None],
    ) -> None:
        self._queue = queue
        self._engine = engine
        self._max_attempts = max_attempts
        self._watcher = watcher
        self._on_end = on_end
        self._wake = asyncio.Event()
        self._runs: set[_RunningJob] = set()
        self._ended: list[Ended] = []
        self._progress: dict[str, tuple[float, float | None]] = {}

    def wake(self) -> None:
        """Look at the queue now."""
        self._wake.set()

    async def run(self) -> None:
        """Dispatch until cancelled; then stop the running jobs and put them back."""
        await self._write_until_accepted(self._queue.requeue_all)
        try:
            while True:
                self._wake.clear()
                try:
                    await self._round()
                except StoreUnavailableError as error:
                    logger.warning("the database does not answer: %s", error)
                    await asyncio.sleep(_RETRY)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_POLL):
                        await self._wake.wait()
        finally:
            await self._drain()

    async def _round(self) -> None:
        """Tell the queue what happened, and begin, cancel and make room as it says."""
        progress, self._progress = self._progress, {}
        runs = {run.claim.id: run for run in self._runs}
        idle = max(self._engine.workers - len(self._runs), 0)
        dispatch = await self._exchange(progress, list(runs.values()), idle)
        for claim in dispatch.claims:
            self._begin(claim)
        for job_id in dispatch.cancelled:
            runs[job_id].end()
        for claim in dispatch.displaced:  # back into the queue: others have waited
            runs[claim.id].stop()
        if progress:
            self._watcher.poke()

    async def _exchange(
        self, progress: dict[str, tuple[float, float | None]], runs: list[_RunningJob], idle: int
    ) -> Dispatch:
        """Exchange with the queue; what could not be written stays for the next time."""
        ended, self._ended = self._ended, []
        try:
            dispatch = await asyncio.to_thread(
                self._queue.exchange,
                ended,
                progress,
                [run.claim for run in runs],
                idle,
                patience=_PATIENCE,
                stopping=frozenset(run.claim.id for run in runs if run.stopping),
            )
        except BaseException:
            self._ended = ended + self._ended
            raise
        for one in ended:
            if one.claim.id in dispatch.written:
                self._watcher.tell(one)
                self._on_end(one)
        return dispatch

    def _begin(self, claim: TakenJob) -> None:
        run = _RunningJob(claim)
        self._runs.add(run)
        run.task = asyncio.create_task(self._run(run))

    async def _run(self, run: _RunningJob) -> None:
        claim = run.claim

        def note(fraction: float, best: float | None) -> None:
            self._progress[claim.id] = (fraction, best)

        try:
            running = self._engine.run(
                claim.resource, claim.request, claim.time_limit, note, run.enough
            )
            self._end(claim, await running)
        except WorkerLostError:
            await self._after_loss(claim)
        except (EngineLostError, asyncio.CancelledError):
            # A job to be cancelled ends with this; any other goes back into the queue.
            await self._put_back(self._queue.requeue, [claim.id])
        except Exception as error:
            logger.exception("job %s", claim.id)
            self._end(claim, Outcome(JobStatus.FAILED, error=json.dumps(describe(error))))
        finally:
            self._runs.discard(run)

    async def _after_loss(self, claim: TakenJob) -> None:
        attempts = claim.attempts + 1
        logger.warning("job %s lost its worker, attempt %d", claim.id, attempts)
        if attempts < self._max_attempts:
            await self._put_back(self._queue.requeue_after_loss, claim.id)
            return
        detail = f"The worker process died in each of {attempts} attempts."
        error = json.dumps(describe(WorkerDiedError(detail)))
        self._end(claim, Outcome(JobStatus.FAILED, error=error))

    async def _put_back(self, write: Callable[..., object], *arguments: object) -> None:
        await self._write_until_accepted(write, *arguments)
        self._watcher.poke()
        self.wake()

    def _end(self, claim: TakenJob, outcome: Outcome) -> None:
        """Leave the end of a job to the next round, which writes it."""
        # Stopped, and without a result: the queue knows whether we wanted that, or runs it again.
        if outcome.status is JobStatus.CANCELLED and outcome.result is None:
            raise EngineLostError
        self._progress.pop(claim.id, None)
        self._ended.append(Ended(claim, outcome, time.time()))
        self.wake()

    async def _write_until_accepted(self, write: Callable[..., object], *arguments: object) -> None:
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
        tasks = [run.task for run in self._runs if run.task is not None]
        for run in self._runs:
            run.stop()
        # What the database does not take in time is put back at the next start.
        with contextlib.suppress(StoreUnavailableError, TimeoutError):
            async with asyncio.timeout(_DRAIN):
                if tasks:
                    await asyncio.wait(tasks)
                if self._ended:
                    await self._exchange({}, [], 0)
