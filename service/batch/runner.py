"""A batch on the service's engine: as many requests at a time as there are workers.

Equal requests are computed once. A slow request holds up nothing: whatever is done is kept at once,
and every worker that falls idle gets the next request that is left.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Sequence

from service.batch.request_lines import Item
from service.configuration import Configuration
from service.jobs import encryption
from service.jobs.engine import Engine, EngineLostError, WorkerLostError
from service.jobs.records import TUNINGS, JobStatus, Outcome
from service.problems import UnavailableError, describe

__all__ = ["NoWorkersError", "Run"]

_RETRY = 1.0  # seconds before a task is sent again to a scheduler that went away


class NoWorkersError(Exception):
    """The scheduler has had no worker for longer than the run is willing to wait."""


class Run:
    """The run of a batch.

    Parameters
    ----------
    items : sequence of Item
        The requests.
    done : set of int
        Those whose results are there already.
    settle : callable
        Called with the index of a request and its result, as members of a JSON object.
    say : callable
        Called with what a person should know.

    """

    def __init__(
        self,
        items: Sequence[Item],
        done: set[int],
        settle: Callable[[int, str], None],
        say: Callable[[str], None],
    ) -> None:
        self._items = items
        self._settle = settle
        self._say = say
        self._wake = asyncio.Event()
        # Equal requests are computed once: the first stands for the others.
        self._same: dict[str, list[int]] = {}
        for index, item in enumerate(items):
            if index not in done:
                self._same.setdefault(item.digest, []).append(index)
        self._left: list[str] = []
        for digest, places in reversed(self._same.items()):
            error = items[places[0]].error
            if error is None:
                self._left.append(digest)
            else:
                self._finish(digest, f'"error": {error}')
        self._running: set[asyncio.Task[None]] = set()

    async def run(self, scheduler: str | None) -> None:
        """Run to the end.

        Raises
        ------
        NoWorkersError
            See there.

        """
        if not self._left:
            return
        configuration = Configuration()
        engine = Engine(
            scheduler,
            configuration.workers,
            self._wake.set,
            encryption.for_cluster(configuration),
        )
        await engine.start()
        try:
            alone = 0.0  # seconds without any worker
            while self._left or self._running:
                self._begin(engine, configuration.max_attempts)
                try:
                    async with asyncio.timeout(_RETRY):
                        await self._wake.wait()
                except TimeoutError:
                    alone = 0.0 if engine.workers else alone + _RETRY
                    self._complain(alone, scheduler, configuration.worker_wait)
                self._wake.clear()
                for task in [task for task in self._running if task.done()]:
                    self._running.remove(task)
                    task.result()
        finally:
            for task in self._running:
                task.cancel()
            await asyncio.gather(*self._running, return_exceptions=True)
            await engine.close()

    def _complain(self, alone: float, scheduler: str | None, limit: float) -> None:
        where = scheduler or "this machine"
        if alone >= limit:
            message = f"no worker at {where} for {limit:g} s"
            raise NoWorkersError(message)
        if alone and alone % 10 == 0:
            self._say(f"No worker at {where} for {alone:g} s; waiting up to {limit:g} s.")

    def _begin(self, engine: Engine, max_attempts: int) -> None:
        """Give every idle worker a request."""
        while self._left and len(self._running) < engine.workers:
            digest = self._left.pop()
            item = self._items[self._same[digest][0]]
            task = asyncio.create_task(self._solve(engine, item, max_attempts))
            task.add_done_callback(lambda _task: self._wake.set())
            self._running.add(task)

    async def _solve(self, engine: Engine, item: Item, max_attempts: int) -> None:
        lost = 0
        while True:
            try:
                outcome = await engine.run(TUNINGS, item.request, item.time_limit, _ignore)
            except WorkerLostError:
                lost += 1
                if lost < max_attempts:
                    continue
                detail = f"The worker process died in each of {lost} attempts."
                error = json.dumps(describe(UnavailableError(detail)))
                outcome = Outcome(JobStatus.FAILED, error=error)
            except EngineLostError:
                await asyncio.sleep(_RETRY)
                continue
            break
        self._finish(item.digest, _content(outcome))

    def _finish(self, digest: str, content: str) -> None:
        for index in self._same[digest]:
            self._settle(index, content)


def _content(outcome: Outcome) -> str:
    if outcome.result is not None:
        return f'"result": {outcome.result}'
    if outcome.error is not None:
        return f'"error": {outcome.error}'
    detail = "The tuning was stopped from outside."
    return f'"error": {json.dumps(describe(UnavailableError(detail)))}'


def _ignore(_fraction: float, _best: float | None) -> None:
    """Take no notice of a single item's progress."""
