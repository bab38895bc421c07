"""``mutune worker``: computing processes for a Dask scheduler, until they are stopped."""

from __future__ import annotations

import asyncio
import signal

from distributed import Nanny

from service.cli.outcomes import ExitCode, reported, say
from service.configuration import Configuration
from service.jobs import processes

__all__ = ["work"]

_RETRY = 2.0  # seconds between tries to reach the scheduler


@reported
def work(scheduler: str | None) -> ExitCode:
    """Compute for a Dask scheduler until Ctrl-C or SIGTERM.

    Parameters
    ----------
    scheduler : str or None
        Address of the scheduler.

    Returns
    -------
    ExitCode
        DONE once stopped; BAD_INPUT where no scheduler is named.

    """
    if scheduler is None:
        say("error: name a scheduler by --scheduler or MUTUNE_SCHEDULER")
        return ExitCode.BAD_INPUT
    asyncio.run(_work(scheduler, Configuration().workers))
    return ExitCode.DONE


async def _work(address: str, workers: int) -> None:
    processes.prepare()
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, stopped.set)
    tasks = [asyncio.create_task(_worker(address)) for _ in range(workers)]
    await stopped.wait()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _worker(address: str) -> None:
    """Keep a worker process at the scheduler, and come back when the scheduler does."""
    while True:
        try:
            # One thread: tunings of one process would wait for each other.
            async with Nanny(address, nthreads=1, dashboard=False) as nanny:
                await nanny.finished()
        except OSError as error:
            say(f"{address}: {error}")
        await asyncio.sleep(_RETRY)
