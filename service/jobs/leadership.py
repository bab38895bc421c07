"""Of all processes on one database, one dispatches.

On PostgreSQL the leader holds an advisory lock, which the server releases the moment that the
leader's connection is gone. A SQLite file has one process anyway.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable

from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import DBAPIError

__all__ = ["lead"]

_LOCK = 0x6D7574756E6502
_POLL = 1.0  # seconds between tries to become leader, and between proofs of still being it

logger = logging.getLogger(__name__)


async def lead(connections: Engine, work: Callable[[], Awaitable[None]]) -> None:
    """Do `work`, for ever, whenever this process is the leader.

    Parameters
    ----------
    connections : Engine
        The database.
    work : callable
        Returns a coroutine, which is cancelled when the leadership is lost.

    """
    if connections.dialect.name != "postgresql":
        await work()
        return
    while True:
        try:
            await _term(connections, work)
        except DBAPIError as error:
            logger.warning("the database does not answer: %s", error)
        await asyncio.sleep(_POLL)


async def _term(connections: Engine, work: Callable[[], Awaitable[None]]) -> None:
    """Try to become leader; be it until the connection fails."""
    connection = await asyncio.to_thread(connections.connect)
    try:
        if not await asyncio.to_thread(_acquire, connection):
            return
        logger.info("this process dispatches")
        task = asyncio.ensure_future(work())
        try:
            while not task.done():
                await asyncio.to_thread(connection.execute, text("SELECT 1"))
                await asyncio.wait({task}, timeout=_POLL)
            task.result()
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
    finally:
        # Not back into the pool: only the end of the session gives up the lock for certain.
        await asyncio.to_thread(_discard, connection)


def _acquire(connection: Connection) -> bool:
    connection.execution_options(isolation_level="AUTOCOMMIT")
    taken = connection.execute(text("SELECT pg_try_advisory_lock(:lock)"), {"lock": _LOCK})
    return bool(taken.scalar_one())


def _discard(connection: Connection) -> None:
    connection.invalidate()
    connection.close()
