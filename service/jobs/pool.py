"""Computations whose result comes with the response: in processes, within time and memory.

The processes are apart from the workers that tune, so a computation never waits behind a batch,
and one that does not come back is killed without loss to anyone else.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, ParamSpec
from weakref import WeakValueDictionary

import numpy as np
import psutil

from service.jobs import processes
from service.problems import (
    AnalysisMemoryError,
    AnalysisTimeoutError,
    NumbersError,
    UnavailableError,
)

__all__ = ["Pool", "to_json"]

logger = logging.getLogger(__name__)

_P = ParamSpec("_P")
_Work = tuple[Callable[..., bytes], Callable[..., dict[str, Any]], tuple[Any, ...], dict[str, Any]]

_QUICK = 1.0  # seconds: most analyses take less than a tenth of that
# Seconds between looks at the memory of a process, which can take some 2 GB in one: a look costs
# 20 microseconds.
_LOOK = 0.02


class Pool:
    """A few processes, each with one computation at a time.

    There are two lanes. Every computation begins in the quick one. What has not ended there after
    `_QUICK` seconds of its process goes on in the patient one, or starts again there when it has
    its turn: those who ask for little do not wait for those who ask for much.

    Parameters
    ----------
    size : int
        Number of processes of each lane.
    time_limit : float
        Seconds, from the moment when a computation begins to wait for a process.
    memory_limit : int
        Resident memory that a process may take, bytes.

    """

    def __init__(self, size: int, *, time_limit: float, memory_limit: int) -> None:
        self._size = size
        self._time_limit = time_limit
        self._memory_limit = memory_limit
        self._quick = asyncio.Semaphore(size)
        self._patient = asyncio.Semaphore(size)
        self._idle: list[_Process] = []
        # A caller fills the quick lane, but not the queue before it.
        self._shares: WeakValueDictionary[str, asyncio.Semaphore] = WeakValueDictionary()

    async def run(
        self,
        caller: str,
        compute: Callable[_P, dict[str, Any]],
        *args: _P.args,
        **kwargs: _P.kwargs,
    ) -> bytes:
        """Return the JSON text of what `compute`, a function of a module, returns.

        Cancelling this coroutine ends the computation.

        Parameters
        ----------
        caller : str
            Who asks; callers take turns.

        Raises
        ------
        AnalysisTimeoutError, AnalysisMemoryError
            It took longer than the time limit, or needs more memory than its process may take.
        UnavailableError
            Its process died.

        """
        try:
            async with asyncio.timeout(self._time_limit):
                return await self._compute(caller, (to_json, compute, args, kwargs))
        except TimeoutError:
            message = f"The analysis took more than {self._time_limit:g} s."
            raise AnalysisTimeoutError(message) from None
        except _MemoryExceededError:
            message = (
                f"The analysis needs more than {self._memory_limit / 1e6:g} MB of memory, the "
                "limit of this service (MUTUNE_ANALYSIS_MEMORY)."
            )
            raise AnalysisMemoryError(message) from None
        except BrokenProcessPool:
            message = "The process of the analysis died."
            raise UnavailableError(message, {"Retry-After": "1"}) from None

    async def _compute(self, caller: str, work: _Work) -> bytes:
        share = self._shares.setdefault(caller, asyncio.Semaphore(self._size))
        process: _Process | None = None
        running: asyncio.Task[bytes] | None = None
        try:
            async with share, self._quick:
                process = self._idle.pop() if self._idle else _Process(self._memory_limit)
                await process.start()  # how long that takes is no fault of who asks
                running = asyncio.create_task(process.run(*work))
                done, _ = await asyncio.wait({running}, timeout=_QUICK)
                if done:
                    return running.result()
                goes_on = not self._patient.locked()
                if goes_on:
                    await self._patient.acquire()  # at once: it is not locked
                else:
                    await _ended(running)
                    running = None
            if not goes_on:
                await self._patient.acquire()
            try:
                return await (running or process.run(*work))
            finally:
                self._patient.release()
        finally:
            await _ended(running)
            if process is not None:
                self._idle.append(process)

    async def close(self) -> None:
        """Stop the processes."""
        while self._idle:
            self._idle.pop().kill()


async def _ended(running: asyncio.Task[bytes] | None) -> None:
    """End a computation that nobody waits for."""
    if running is not None:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


class _MemoryExceededError(Exception):
    """The process took more memory than it may."""


class _Process:
    """One process, started when first needed and again after it was killed."""

    def __init__(self, memory_limit: int) -> None:
        self._memory_limit = memory_limit
        self._executor: Executor | None = None
        self._pid: int | None = None

    async def start(self) -> None:
        """Have the process there."""
        if self._executor is not None:
            return
        self._executor = ProcessPoolExecutor(1, processes.prepare(), initializer=_leave_signals)
        try:
            loop = asyncio.get_running_loop()
            self._pid = await loop.run_in_executor(self._executor, os.getpid)
        except (BrokenProcessPool, asyncio.CancelledError):
            self.kill()
            raise

    async def run(self, function: Callable[..., bytes], *args: object) -> bytes:
        loop = asyncio.get_running_loop()
        watching: asyncio.Task[None] | None = None
        try:
            await self.start()
            watching = asyncio.create_task(self._watch())
            return await loop.run_in_executor(self._executor, function, *args)
        except BrokenProcessPool:
            self.kill()
            if watching is not None and watching.done():
                raise _MemoryExceededError from None
            raise
        except asyncio.CancelledError:
            self.kill()  # timed out, or nobody waits for the result any more
            raise
        finally:
            if watching is not None:
                watching.cancel()

    async def _watch(self) -> None:
        """Kill the process, and return, once it takes more memory than it may."""
        process = psutil.Process(self._pid)
        with suppress(psutil.NoSuchProcess):
            while process.memory_info().rss <= self._memory_limit:  # noqa: ASYNC110 - nobody tells
                await asyncio.sleep(_LOOK)
            logger.warning("an analysis takes more than %d bytes; it is ended", self._memory_limit)
            process.kill()
            return
        await asyncio.Future()  # it has died by itself: the executor tells

    def kill(self) -> None:
        if self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
        if self._pid is not None:
            with suppress(ProcessLookupError):
                os.kill(self._pid, signal.SIGKILL)
        self._executor = self._pid = None


def _leave_signals() -> None:
    """Ctrl-C in a terminal reaches every process; the parent is the one to obey it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def to_json(
    compute: Callable[..., dict[str, Any]], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> bytes:
    """Return the JSON text of what `compute` returns.

    Raises
    ------
    NumbersError
        Numbers left the range of double precision on the way.

    """
    try:
        document = compute(*args, **kwargs)
    except (ArithmeticError, np.linalg.LinAlgError):
        logger.exception("numbers beyond double precision")
        raise NumbersError from None
    return json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
