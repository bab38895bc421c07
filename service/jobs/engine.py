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
from dataclasses import dataclass, field, replace
from typing import Any

from distributed import Actor, Client, Future, KilledWorker, LocalCluster, Nanny, Security
from distributed.comm import CommClosedError

from service.jobs import encryption, processes
from service.jobs.records import JobStatus, Outcome
from service.jobs.work import TOPIC, SolvingActor
from service.problems import TimeLimitError, describe
from solver import __version__

__all__ = ["Engine", "EngineLostError", "WorkerLostError"]

VERSION = __version__
_NICE = 10  # priority of workers: below that of whoever waits for an answer
_POLL = 0.5  # seconds between looks at the cluster: how soon a new worker gets work
_GRACE = 2.0  # seconds that a stopped task gets to answer; its callback runs every 0.2 s
_ENDING = 10.0  # seconds to make the best so far exact, at most 2 of search, and report it
_PLACING = 10.0  # seconds for a worker to take its actor
_OVERTIME = 5.0  # seconds beyond its time limit after which a task counts as stuck

_OVERDUE = json.dumps(
    describe(TimeLimitError("The job did not end within its time limit; it was stopped."))
)

logger = logging.getLogger(__name__)


class WorkerLostError(Exception):
    """The worker died while it had the task."""


class EngineLostError(Exception):
    """The scheduler or the worker left; the task may or may not have run."""


@dataclass(frozen=True)
class _Placed:
    """The actor on a worker; Dask keeps it as long as there is the future."""

    future: Future
    actor: Actor


@dataclass
class _Call:
    """A call on its way: what is asked, who hears of its progress, what ends it, and itself."""

    resource: str
    request: str
    on_progress: Callable[[float, float | None], None]
    enough: asyncio.Event
    name: str = field(default_factory=lambda: uuid.uuid4().hex)
    solving: asyncio.Future[Outcome] | None = None
    kept: Outcome | None = None  # stands where the call has to be stopped


class Engine:
    """Runs jobs on Dask workers.

    Each worker that it admits gets a `SolvingActor`, which the engine calls with one job at a
    time: whoever kills a worker is known, and takes nobody along.

    Parameters
    ----------
    scheduler : str or None
        Address of a running scheduler; None starts worker processes on this machine.
    workers : int
        Number of those.
    on_idle : callable
        Called when a worker has become idle.
    security : Security or None
        Certificate to show to `scheduler` and its workers; None: they speak openly. Processes of
        this machine always have a certificate of their own.

    """

    def __init__(
        self,
        scheduler: str | None,
        workers: int,
        on_idle: Callable[[], None],
        security: Security | None,
    ) -> None:
        self._address = scheduler
        self._security = security
        self._workers = workers
        self._on_idle = on_idle
        self._cluster: LocalCluster | None = None
        self._client: Client | None = None
        self._supervision: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()
        self._solvers: dict[str, _Placed] = {}
        self._refused: set[str] = set()
        self._leaving: set[str] = set()
        self._busy: dict[str, _Call] = {}

    @property
    def workers(self) -> int:
        """Number of workers that take tasks."""
        return len(self._solvers)

    @property
    def idle(self) -> int:
        """Number of workers that wait for a task."""
        return len(self._solvers.keys() - self._busy.keys())

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
        self,
        resource: str,
        request: str,
        time_limit: float,
        on_progress: Callable[[float, float | None], None],
        enough: asyncio.Event | None = None,
    ) -> Outcome:
        """Run one job to its end on an idle worker.

        Once `enough` is set it ends with the best so far; as CANCELLED, without a result where
        nothing was found or where that takes too long.

        Cancelling this coroutine stops the job: it returns from that within `_GRACE` seconds,
        and a worker that does not answer by then is restarted.

        Raises
        ------
        WorkerLostError, EngineLostError
            See there.

        """
        idle = self._solvers.keys() - self._busy.keys()
        if self._client is None or not idle:
            raise EngineLostError
        worker = min(idle)
        call = self._busy[worker] = _Call(resource, request, on_progress, enough or asyncio.Event())
        try:
            return await self._run_on(self._client, worker, call, time_limit)
        finally:
            del self._busy[worker]
            self._on_idle()

    async def _run_on(self, client: Client, worker: str, call: _Call, time_limit: float) -> Outcome:
        actor = self._solvers[worker].actor
        call.solving = asyncio.ensure_future(_solve(actor, call))
        enough = asyncio.ensure_future(call.enough.wait())
        try:
            limit = time_limit + _OVERTIME
            first = asyncio.FIRST_COMPLETED
            await asyncio.wait({call.solving, enough}, timeout=limit, return_when=first)
            if enough.done() and not call.solving.done():
                await actor.finish(call.name)
                await asyncio.wait({call.solving}, timeout=_ENDING)
            if not call.solving.done():
                await self._stop(client, worker, call)
                status = JobStatus.CANCELLED if enough.done() else JobStatus.TIMED_OUT
                if call.kept is not None:
                    return replace(call.kept, status=status)
                return Outcome(status, error=None if enough.done() else _OVERDUE)
            return call.solving.result()
        except asyncio.CancelledError:
            if call.solving.cancelled():  # by us, when the worker was gone
                raise EngineLostError from None
            await self._stop(client, worker, call)
            raise
        except (OSError, CommClosedError) as error:
            self._solvers.pop(worker, None)
            if client.status != "running" or self._client is not client:
                raise EngineLostError(str(error)) from error
            raise WorkerLostError(str(error)) from error
        except RuntimeError as error:  # the actor was gone before it could be called
            self._solvers.pop(worker, None)
            raise EngineLostError(str(error)) from error
        finally:
            enough.cancel()

    async def _stop(self, client: Client, worker: str, call: _Call) -> None:
        """Tell the actor, whose callback obeys; restart a worker that does not."""
        solving = call.solving
        if solving is None:
            return
        solver = self._solvers.get(worker)
        with contextlib.suppress(CommClosedError, OSError, RuntimeError, TimeoutError):
            async with asyncio.timeout(_GRACE):
                if solver is not None:
                    await solver.actor.stop(call.name)
                await asyncio.wait({solving})
        if not solving.done():
            logger.warning("worker %s does not answer; it is restarted", worker)
            self._solvers.pop(worker, None)
            solving.cancel()
            with contextlib.suppress(CommClosedError, OSError, ValueError):
                await client.run(_restart, workers=[worker], nanny=True, wait=False)
        else:
            solving.exception()  # looked at: nobody else will

    def _on_event(self, event: tuple[float, dict[str, Any]]) -> None:
        _, message = event
        for call in self._busy.values():
            if call.name != message["call"]:
                continue
            if "result" in message:
                call.kept = Outcome(JobStatus.TIMED_OUT, message["result"], best=message["best"])
            else:
                call.on_progress(message["fraction"], message["best"])

    async def _supervise(self) -> None:
        """Keep connected and keep the list of admitted workers up to date."""
        while not self._closing.is_set():
            try:
                if self._client is None:
                    self._client = await self._connect()
                await self._update_workers(self._client)
            except (CommClosedError, OSError, RuntimeError) as error:
                logger.warning("no connection to the scheduler: %s", error)
                await self._disconnect()
            except Exception:  # or the service would stay without workers, and say nothing
                logger.exception("the engine failed; it tries again")
                await self._disconnect()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_POLL):
                    await self._closing.wait()

    async def _connect(self) -> Client:
        if self._address is None and self._cluster is None:
            self._cluster = await _local_cluster(self._workers)
        target = self._cluster or self._address
        client: Client = await Client(
            target,
            asynchronous=True,
            set_as_default=False,
            direct_to_workers=True,
            timeout=5,
            security=self._security if self._cluster is None else self._cluster.security,
        )
        client.subscribe_topic(TOPIC, self._on_event)
        return client

    async def _disconnect(self) -> None:
        client, self._client = self._client, None
        self._solvers.clear()
        if client is not None:
            with contextlib.suppress(CommClosedError, OSError, TimeoutError):
                await client.close(timeout=2)

    async def _update_workers(self, client: Client) -> None:
        """See which workers there are; admit new ones, give up tasks of those that left."""
        if client.status != "running":
            message = f"the client is {client.status}"
            raise OSError(message)
        identity = await client.scheduler.identity(n_workers=-1)
        present = set(identity["workers"])
        for worker in self._solvers.keys() - present:
            del self._solvers[worker]
        self._refused &= present
        # The connection to a worker that was killed breaks, which may be noticed after this look;
        # one that is still missing at the next look is out of reach.
        missing = self._busy.keys() - present
        for worker in missing & self._leaving:
            solving = self._busy[worker].solving
            if solving is not None:
                solving.cancel()
        self._leaving = missing
        unknown = sorted(present - self._solvers.keys() - self._refused)
        if unknown:
            versions = await client.run(_report_version, workers=unknown, on_error="ignore")
            await self._admit(client, versions)

    async def _admit(self, client: Client, versions: dict[str, str]) -> None:
        fitting = [worker for worker, found in versions.items() if found == VERSION]
        solvers = await asyncio.gather(*(_place(client, worker) for worker in fitting))
        self._solvers |= {
            worker: solver
            for worker, solver in zip(fitting, solvers, strict=True)
            if solver is not None
        }
        for worker in versions.keys() - set(fitting):
            self._refused.add(worker)
            logger.error(
                "worker %s runs mutune %s, this is %s: it gets no work",
                worker,
                versions[worker],
                VERSION,
            )
        self._on_idle()


async def _place(client: Client, worker: str) -> _Placed | None:
    """Put a solver on a worker; None where it does not take one, and a later look tries again."""
    key = f"solver-{uuid.uuid4().hex}"
    future = client.submit(SolvingActor, key, key=key, pure=False, workers=[worker], actor=True)
    try:
        async with asyncio.timeout(_PLACING):
            with client.as_current():  # an actor speaks through the client that is current
                return _Placed(future, await future)
    except (KilledWorker, FutureCancelledError, TimeoutError):
        return None


async def _solve(actor: Actor, call: _Call) -> Outcome:
    outcome: Outcome = await actor.solve(call.name, call.resource, call.request)
    return outcome


async def _local_cluster(workers: int) -> LocalCluster:
    """Return running processes of one thread each."""
    processes.prepare()
    security = await asyncio.to_thread(encryption.for_this_machine)  # a tenth of a second
    cluster = LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        asynchronous=True,
        host="127.0.0.1",
        protocol=encryption.protocol(security),
        security=security,
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
    )
    try:
        await cluster
    except BaseException:  # what has started by then ends here
        await cluster.close()
        raise
    return cluster


def _report_version() -> str:
    """Return the version of mutune on a worker, which from now on knows its place."""
    os.setpriority(os.PRIO_PROCESS, 0, _NICE)
    # A terminal sends it to all processes; the parent stops its workers in good order.
    with contextlib.suppress(ValueError):  # a worker outside its process's main thread
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return __version__


async def _restart(dask_worker: Nanny) -> None:
    """Kill a worker process, from its nanny, and start another."""
    await dask_worker.kill(timeout=1, reason="it does not answer")
    await dask_worker.instantiate()
