"""Computations whose result comes with the response: each in a process, with a time limit.

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

import numpy as np

from service.jobs import processes
from service.problems import AnalysisTimeoutError, NumbersError, UnavailableError

__all__ = ["Pool", "to_json"]

logger = logging.getLogger(__name__)

_P = ParamSpec("_P")


class Pool:
    """A few processes, each with one computation at a time.

    Parameters
    ----------
    size : int
        Number of processes.
    time_limit : float
        Seconds, from the moment when a computation begins to wait for a process.

    """

    def __init__(self, size: int, time_limit: float) -> None:
        self._time_limit = time_limit
        self._idle: asyncio.Queue[_Process] = asyncio.Queue()
        for _ in range(size):
            self._idle.put_nowait(_Process())

    async def run(
        self, compute: Callable[_P, dict[str, Any]], *args: _P.args, **kwargs: _P.kwargs
    ) -> bytes:
        """Return the JSON text of what `compute`, a function of a module, returns.

        Raises
        ------
        AnalysisTimeoutError
            It took longer than the time limit.
        UnavailableError
            Its process died.

        """
        process: _Process | None = None
        try:
            async with asyncio.timeout(self._time_limit):
                process = await self._idle.get()
                return await process.run(to_json, compute, args, kwargs)
        except TimeoutError:
            message = f"The analysis took more than {self._time_limit:g} s."
            raise AnalysisTimeoutError(message) from None
        except BrokenProcessPool:
            message = "The process of the analysis died."
            raise UnavailableError(message, {"Retry-After": "1"}) from None
        finally:
            if process is not None:
                self._idle.put_nowait(process)

    async def close(self) -> None:
        """Stop the processes."""
        while not self._idle.empty():
            self._idle.get_nowait().kill()


class _Process:
    """One process, started when first needed and again after it was killed."""

    def __init__(self) -> None:
        self._executor: Executor | None = None
        self._pid: int | None = None

    async def run(self, function: Callable[..., bytes], *args: object) -> bytes:
        loop = asyncio.get_running_loop()
        try:
            if self._executor is None:
                self._executor = ProcessPoolExecutor(
                    1, processes.prepare(), initializer=_leave_signals
                )
                self._pid = await loop.run_in_executor(self._executor, os.getpid)
            return await loop.run_in_executor(self._executor, function, *args)
        except (asyncio.CancelledError, BrokenProcessPool):
            self.kill()  # timed out, or nobody waits for the result any more
            raise

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
