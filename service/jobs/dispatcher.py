"""From the table to the engine and back: as many jobs as there are workers, each written once."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Callable

from service.jobs.engine import Engine, EngineLostError, WorkerLostError
from service.jobs.records import Claim, JobStatus, Outcome
from service.jobs.store import Store, StoreUnavailableError
from service.problems import WorkerDiedError, describe

__all__ = ["Dispatcher"]

_POLL = 0.25  # seconds: how late a request of another process is seen
_RETRY = 1.0  # seconds between tries to write to a database that does not answer
_DRAIN = 10.0  # seconds for the running jobs to stop at shutdown

logger = logging.getLogger(__name__)


class Dispatcher:
    """Keeps the engine busy with the next jobs of the queue.

    Parameters
    ----------
    store : Store
        The job table.
    engine : Engine
        Where the jobs run.
    max_attempts : int
        Workers that a job may lose before it counts as failed.
    on_change : callable
        Called after each write that a watcher may wait for.

    """

    def __init__(
        self, store: Store, engine: Engine, max_attempts: int, on_change: Callable[[], None]
    ) -> None:
        self._store = store
        self._engine = engine
        self._max_attempts = max_attempts
        self._on_change = on_change
        self._wake = asyncio.Event()
        self._runs: dict[str, asyncio.Task[None]] = {}
        self._progress: dict[str, tuple[float, float | None]] = {}

    def wake(self) -> None:
        """Look at the queue now."""
        self._wake.set()

    async def run(self) -> None:
        """Dispatch until cancelled; then stop the running jobs and put them back."""
        await self._insist(self._store.requeue_all)
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
            for claim in await asyncio.to_thread(self._store.claim, self._engine.idle):
                self._runs[claim.id] = asyncio.create_task(self._run(claim))
        if self._progress:
            progress, self._progress = self._progress, {}
            await asyncio.to_thread(self._store.record_progress, progress)
            self._on_change()
        if self._runs:
            ids = list(self._runs)
            for job_id in await asyncio.to_thread(self._store.cancellations, ids):
                if task := self._runs.get(job_id):
                    _stop(task)

    async def _run(self, claim: Claim) -> None:
        def note(fraction: float, best: float | None) -> None:
            self._progress[claim.id] = (fraction, best)

        try:
            await self._finish(claim, await self._engine.run(claim, note))
        except WorkerLostError:
            await self._after_loss(claim)
        except (EngineLostError, asyncio.CancelledError):
            # A job to be cancelled ends with this; any other goes back into the queue.
            await self._insist(self._store.requeue, [claim.id])
        except Exception as error:
            logger.exception("job %s", claim.id)
            await self._finish(claim, Outcome(JobStatus.FAILED, error=json.dumps(describe(error))))
        finally:
            self._progress.pop(claim.id, None)
            del self._runs[claim.id]
            self._on_change()
            self.wake()

    async def _after_loss(self, claim: Claim) -> None:
        attempts = claim.attempts + 1
        logger.warning("job %s lost its worker, attempt %d", claim.id, attempts)
        if attempts < self._max_attempts:
            await self._insist(self._store.requeue_after_loss, claim.id)
            return
        detail = f"The worker process died in each of {attempts} attempts."
        error = json.dumps(describe(WorkerDiedError(detail)))
        await self._finish(claim, Outcome(JobStatus.FAILED, error=error))

    async def _finish(self, claim: Claim, outcome: Outcome) -> None:
        if outcome.status is JobStatus.CANCELLED:  # stopped by whatever Dask had in mind
            raise EngineLostError
        await self._insist(self._store.finish, claim.id, outcome)

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
        tasks = list(self._runs.values())
        for task in tasks:
            _stop(task)
        if tasks:  # what the database does not take in time is put back at the next start
            await asyncio.wait(tasks, timeout=_DRAIN)


def _stop(task: asyncio.Task[None]) -> None:
    """Cancel once: a second time would interrupt the stopping itself."""
    if not task.cancelling():
        task.cancel()
