"""The computing side: Dask workers in this machine's processes, or a Dask cluster by address.

Both sizes take the same path: the engine is a client of a scheduler, admits each worker that
runs the same version, and gives it one task at a time.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import signal
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError as FutureCancelledError
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

from distributed import Client, Future, KilledWorker, LocalCluster, Nanny, Scheduler
from distributed.comm import CommClosedError

from service.jobs import processes
from service.jobs.records import Claim, JobStatus, Outcome
from service.jobs.work import TOPIC, solve
from service.problems import TimeLimitError, describe

__all__ = ["Engine", "EngineLostError", "WorkerLostError"]

VERSION = version("mutune")
_NICE = 5  # priority of workers: below that of whoever waits for an answer
_POLL = 0.5  # seconds between looks at the cluster: how soon a new worker gets work
_GRACE = 2.0  # seconds that a stopped task gets to answer; its callback runs every 0.2 s
_OVERTIME = 5.0  # seconds beyond its time limit after which a task counts as stuck

_OVERDUE = json.dumps(
    describe(TimeLimitError("The tuning did not end within its time limit; it was stopped."))
)

logger = logging.getLogger(__name__)


class WorkerLostError(Exception):
    """The worker died while it had the task."""


class EngineLostError(Exception):
    """The scheduler or the worker left; the task may or may not have run."""


@dataclass
class _Run:
    """A task on its way: who hears of its progress, and whether it has begun and ended."""

    on_progress: Callable[[float, float | None], None]
    future: Future | None = None
    started: bool = False
    ended: asyncio.Event = field(default_factory=asyncio.Event)


class Engine:
    """Runs tunings on Dask workers.

    Each task is sent to a worker of the engine's choice that has no other one, so whoever kills
    a worker is known, and takes nobody along.

    Parameters
    ----------
    scheduler : str or None
        Address of a running scheduler; None starts worker processes on this machine.
    workers : int
        Number of those.
    on_idle : callable
        Called when a worker has become idle.

    """

    def __init__(self, scheduler: str | None, workers: int, on_idle: Callable[[], None]) -> None:
        self._address = scheduler
        self._workers = workers
        self._on_idle = on_idle
        self._cluster: LocalCluster | None = None
        self._client: Client | None = None
        self._supervision: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()
        self._admitted: set[str] = set()
        self._refused: set[str] = set()
        self._leaving: set[str] = set()
        self._busy: dict[str, _Run] = {}

    @property
    def workers(self) -> int:
        """Number of workers that take tasks."""
        return len(self._admitted)

    @property
    def idle(self) -> int:
        """Number of workers that wait for a task."""
        return len(self._admitted - self._busy.keys())

    @property
    def refused(self) -> frozenset[str]:
        """Addresses of workers with another version of mutune."""
        return frozenset(self._refused)

    async def start(self) -> None:
        """Start the workers, or begin to look for the scheduler."""
        self._supervision = asyncio.create_task(self._supervise())

    async def close(self) -> None:
        """Let go of the scheduler and stop own workers."""
        # Not cancelled: a cluster stopped in the middle of its start leaves processes behind.
        self._closing.set()
        if self._supervision is not None:
            await self._supervision
        await self._disconnect()
        if self._cluster is not None:
            await self._cluster.close()

    async def run(
        self, claim: Claim, on_progress: Callable[[float, float | None], None]
    ) -> Outcome:
        """Run one tuning to its end on an idle worker.

        Cancelling this coroutine stops the tuning: it returns from that within `_GRACE` seconds,
        and a worker that does not answer by then is restarted.

        Raises
        ------
        WorkerLostError, EngineLostError
            See there.

        """
        idle = self._admitted - self._busy.keys()
        if self._client is None or not idle:
            raise EngineLostError
        worker = min(idle)
        run = self._busy[worker] = _Run(on_progress)
        try:
            return await self._run_on(self._client, worker, run, claim)
        except KilledWorker as error:
            self._admitted.discard(worker)
            raise WorkerLostError(str(error)) from error
        except (FutureCancelledError, CommClosedError, OSError) as error:
            raise EngineLostError(str(error)) from error
        finally:
            del self._busy[worker]
            self._on_idle()

    async def _run_on(self, client: Client, worker: str, run: _Run, claim: Claim) -> Outcome:
        # A key of its own for each attempt: Dask takes equal keys for equal results.
        key = f"{claim.id}-{uuid.uuid4().hex}"
        run.future = client.submit(
            solve, worker, key, claim.request, key=key, pure=False, workers=[worker]
        )
        try:
            async with asyncio.timeout(claim.time_limit + _OVERTIME):
                outcome: Outcome = await run.future
        except TimeoutError:
            await self._stop(client, worker, run)
            return Outcome(JobStatus.TIMED_OUT, error=_OVERDUE)
        except asyncio.CancelledError:
            await self._stop(client, worker, run)
            raise
        return outcome

    async def _stop(self, client: Client, worker: str, run: _Run) -> None:
        """Release the task, which its callback obeys; restart a worker that does not."""
        with contextlib.suppress(CommClosedError, OSError):
            if run.future is not None:
                await run.future.cancel()
        try:
            async with asyncio.timeout(_GRACE):
                await run.ended.wait()
        except TimeoutError:
            if run.started:
                logger.warning("worker %s does not answer; it is restarted", worker)
                self._admitted.discard(worker)
                with contextlib.suppress(CommClosedError, OSError, ValueError):
                    await client.run(_restart, workers=[worker], nanny=True, wait=False)

    def _hear(self, event: tuple[float, dict[str, Any]]) -> None:
        _, message = event
        run = self._busy.get(message["worker"])
        if run is None or run.future is None or run.future.key != message["key"]:
            return
        match message["what"]:
            case "started":
                run.started = True
            case "progress":
                run.on_progress(message["fraction"], message["best"])
            case "ended":
                run.ended.set()

    async def _supervise(self) -> None:
        """Keep connected and keep the list of admitted workers up to date."""
        while not self._closing.is_set():
            try:
                if self._client is None:
                    self._client = await self._connect()
                await self._look(self._client)
            except (CommClosedError, OSError, RuntimeError) as error:
                logger.warning("no connection to the scheduler: %s", error)
                await self._disconnect()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_POLL):
                    await self._closing.wait()

    async def _connect(self) -> Client:
        if self._address is None and self._cluster is None:
            self._cluster = await _local_cluster(self._workers)
        target = self._cluster or self._address
        client: Client = await Client(target, asynchronous=True, set_as_default=False, timeout=5)
        # A task that kills its worker comes back to us at once; the job table counts.
        await client.run_on_scheduler(_report_first_loss)
        client.subscribe_topic(TOPIC, self._hear)
        return client

    async def _disconnect(self) -> None:
        client, self._client = self._client, None
        self._admitted.clear()
        if client is not None:
            with contextlib.suppress(CommClosedError, OSError, TimeoutError):
                await client.close(timeout=2)

    async def _look(self, client: Client) -> None:
        """See which workers there are; admit new ones, give up tasks of those that left."""
        if client.status != "running":
            message = f"the client is {client.status}"
            raise OSError(message)
        identity = await client.scheduler.identity(n_workers=-1)
        present = set(identity["workers"])
        self._admitted &= present
        self._refused &= present
        # A worker that was killed has its task reported as such, which may arrive after this
        # look; one that is still missing at the next look left on good terms.
        missing = self._busy.keys() - present
        for worker in missing & self._leaving:
            future = self._busy[worker].future
            if future is not None:
                await future.cancel()
        self._leaving = missing
        unknown = sorted(present - self._admitted - self._refused)
        if unknown:
            versions = await client.run(_introduce, workers=unknown, on_error="ignore")
            self._judge(versions)

    def _judge(self, versions: dict[str, str]) -> None:
        for worker, found in versions.items():
            if found == VERSION:
                self._admitted.add(worker)
            else:
                self._refused.add(worker)
                logger.error(
                    "worker %s runs mutune %s, this is %s: it gets no work", worker, found, VERSION
                )
        self._on_idle()


async def _local_cluster(workers: int) -> LocalCluster:
    """Return running processes of one thread each."""
    processes.prepare()
    cluster: LocalCluster = await LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        asynchronous=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
    )
    return cluster


def _report_first_loss(dask_scheduler: Scheduler) -> None:
    dask_scheduler.allowed_failures = 0


def _introduce() -> str:
    """Return the version of mutune on a worker, which from now on knows its place."""
    os.setpriority(os.PRIO_PROCESS, 0, _NICE)
    # A terminal sends it to all processes; the parent stops its workers in good order.
    with contextlib.suppress(ValueError):  # a worker outside its process's main thread
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return version("mutune")


async def _restart(dask_worker: Nanny) -> None:
    """Kill a worker process, from its nanny, and start another."""
    await dask_worker.kill(timeout=1, reason="it does not answer")
    await dask_worker.instantiate()
