"""Who waits for a job: one look at the table serves all watchers of a process."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager, suppress

from service.jobs.records import FINAL, Ended, JobStatus, Snapshot
from service.jobs.store import Store
from service.jobs.transactions import StoreUnavailableError

__all__ = ["Watcher"]

_POLL = 0.25  # seconds: how late a process sees what another one wrote
_CHUNK = 500  # ids in one query; SQLite takes some thousand parameters

logger = logging.getLogger(__name__)


class _Watched:
    """A job with watchers: its last state, and an event that the next state sets."""

    def __init__(self) -> None:
        self.watchers = 0
        self.state: Snapshot | None = None
        self.ended: Ended | None = None
        self.changed = asyncio.Event()

    def become(self, state: Snapshot | None) -> None:
        """Take a state, and wake those who wait for another one."""
        if state != self.state:
            self.state = state
            self.changed.set()
            self.changed = asyncio.Event()


class Watcher:
    """Tells the changes of jobs to any number of watchers.

    A slow watcher misses intermediate states and holds up nobody: it is handed the latest.

    Parameters
    ----------
    store : Store
        The job table.

    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._watched: dict[str, _Watched] = {}
        self._poke = asyncio.Event()
        self._closed = False

    @property
    def closed(self) -> bool:
        """Whether the service is going down."""
        return self._closed

    def close(self) -> None:
        """End all watching: the service is going down."""
        self._closed = True
        for watched in self._watched.values():
            watched.state = None
            watched.changed.set()

    def poke(self) -> None:
        """Look now: this process has just written."""
        self._poke.set()

    def tell(self, ended: Ended) -> None:
        """Tell the watchers of a job that it has ended, as this process has just written."""
        if ended.outcome.status is not JobStatus.SUCCEEDED:
            self.poke()  # how far it was is in the table
            return
        watched = self._watched.get(ended.claim.id)
        if watched is not None:
            watched.ended = ended
            watched.become(ended.snapshot)

    async def run(self) -> None:
        """Look at the table, for ever."""
        while True:
            try:
                async with asyncio.timeout(_POLL):
                    await self._poke.wait()
            except TimeoutError:
                pass
            self._poke.clear()
            try:
                await self._look()
            except StoreUnavailableError as error:
                logger.warning("the database does not answer: %s", error)

    async def _look(self) -> None:
        ids = list(self._watched)
        for start in range(0, len(ids), _CHUNK):
            chunk = ids[start : start + _CHUNK]
            states = await asyncio.to_thread(self._store.snapshots, chunk)
            for job_id in chunk:
                watched = self._watched.get(job_id)
                if watched is not None and not (
                    # Told since this look began.
                    watched.state is not None and watched.state.status in FINAL
                ):
                    watched.become(states.get(job_id))

    @contextmanager
    def _watching(self, job_id: str) -> Iterator[_Watched]:
        watched = self._watched.setdefault(job_id, _Watched())
        watched.watchers += 1
        try:
            yield watched
        finally:
            watched.watchers -= 1
            if not watched.watchers:
                del self._watched[job_id]

    async def changes(self, job_id: str) -> AsyncIterator[Snapshot]:
        """Yield the state now and at each change, the last one final.

        Ends early when the job is deleted or the service goes down.
        """
        with self._watching(job_id) as watched:
            changed = watched.changed
            states = await asyncio.to_thread(self._store.snapshots, [job_id])
            state = states.get(job_id)
            while state is not None and not self._closed:
                yield state
                if state.status in FINAL:
                    return
                await changed.wait()
                changed, state = watched.changed, watched.state

    async def wait(self, job_id: str, seconds: float) -> Ended | None:
        """Return when the job has ended or the time is over.

        The state at the beginning is that of the next look, so this asks nothing by itself.

        Returns
        -------
        Ended or None
            The end, where it succeeded and this process wrote that meanwhile.

        """
        with self._watching(job_id) as watched, suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self._closed:
                    if watched.state is not None and watched.state.status in FINAL:
                        return watched.ended
                    await watched.changed.wait()
        return None
