"""``mutune worker`` and ``mutune scheduler``: the computing side on machines of its own."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Coroutine, Iterable
from contextlib import suppress

from distributed import Nanny, Security

from service.cli.outcomes import ExitCode, is_loopback, reported, say
from service.configuration import Configuration
from service.jobs import encryption, processes
from service.jobs.silent import SilentScheduler, SilentWorker

__all__ = ["schedule", "work"]

_RETRY = 2.0  # seconds between tries to reach the scheduler
# Seconds for a new worker process to register. A nanny whose scheduler dies in that moment waits
# for its process for ever, and its process for the scheduler.
_STARTING = 60.0


@reported
def work(scheduler: str | None, host: str | None) -> ExitCode:
    """Compute for a Dask scheduler until Ctrl-C or SIGTERM.

    Parameters
    ----------
    scheduler : str or None
        Address of the scheduler.
    host : str or None
        Address to listen on; None: the one that leads to the scheduler.

    Returns
    -------
    ExitCode
        DONE once stopped; BAD_INPUT where no scheduler is named, or the address is open to others
        and nothing keeps them out.

    """
    if scheduler is None:
        say("error: name a scheduler by --scheduler or MUTUNE_SCHEDULER")
        return ExitCode.BAD_INPUT
    configuration = Configuration()
    security = encryption.for_cluster(configuration)
    if security is not None and not scheduler.startswith("tls://"):
        say(f"error: MUTUNE_TLS_CERT_FILE is set: the scheduler must be tls://..., not {scheduler}")
        return ExitCode.BAD_INPUT
    if security is None and scheduler.startswith("tls://"):
        say("error: set MUTUNE_TLS_CA_FILE, MUTUNE_TLS_CERT_FILE and MUTUNE_TLS_KEY_FILE")
        return ExitCode.BAD_INPUT
    processes.prepare()
    asyncio.run(
        _until_stopped(_worker(scheduler, host, security) for _ in range(configuration.workers))
    )
    return ExitCode.DONE


@reported
def schedule(host: str, port: int, *, insecure: bool) -> ExitCode:
    """Schedule for workers and services until Ctrl-C or SIGTERM; open one port and no other.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port to listen on.
    insecure : bool
        Listen beyond this machine though there are no certificates.

    Returns
    -------
    ExitCode
        DONE once stopped; BAD_INPUT where the address needs certificates and there are none;
        CANNOT_START where the port is taken.

    """
    security = encryption.for_cluster(Configuration())
    if security is None and not insecure and not is_loopback(host):
        say(
            f"error: whoever reaches {host} could run code here. Set MUTUNE_TLS_CA_FILE, "
            "MUTUNE_TLS_CERT_FILE and MUTUNE_TLS_KEY_FILE, or pass --insecure on a network of "
            "its own."
        )
        return ExitCode.BAD_INPUT
    try:
        asyncio.run(_until_stopped([_scheduler(host, port, security)]))
    except OSError as error:
        say(f"error: {host}:{port}: {error.strerror or error}")
        return ExitCode.CANNOT_START
    return ExitCode.DONE


async def _until_stopped(works: Iterable[Coroutine[None, None, None]]) -> None:
    """Do all `works` until a signal or an exception ends them."""
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, stopped.set)
    stopping = asyncio.create_task(stopped.wait())
    tasks = [asyncio.create_task(work) for work in works]
    done, _ = await asyncio.wait([stopping, *tasks], return_when=asyncio.FIRST_COMPLETED)
    for task in (stopping, *tasks):
        task.cancel()
    await asyncio.gather(stopping, *tasks, return_exceptions=True)
    for task in done - {stopping}:
        task.result()


async def _scheduler(host: str, port: int, security: Security | None) -> None:
    async with SilentScheduler(
        host=host,
        port=port,
        protocol=encryption.protocol(security),
        security=security,
    ) as scheduler:
        say(f"scheduler at {scheduler.address}")
        await scheduler.finished()


async def _worker(address: str, host: str | None, security: Security | None) -> None:
    """Keep a worker process at the scheduler, and come back when the scheduler does."""
    while True:
        # One thread: tunings of one process would wait for each other.
        nanny = Nanny(
            address,
            nthreads=1,
            worker_class=SilentWorker,
            host=host,
            protocol=encryption.protocol(security),
            security=security,
        )
        try:
            async with asyncio.timeout(_STARTING):
                await nanny
            await nanny.finished()
        except TimeoutError:
            say(f"{address}: the worker has not come up in {_STARTING:g} s; trying again")
        except (OSError, RuntimeError) as error:
            say(f"{address}: {error}")
        finally:
            with suppress(OSError, TimeoutError):
                await nanny.close(timeout=_RETRY)
        await asyncio.sleep(_RETRY)
