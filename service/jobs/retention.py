"""Finished jobs are deleted after a time, by a clock that survives jumps of the machine's.

A clock that jumps forty days ahead, for an hour, must not delete what is forty days younger than it
seems. So a time far ahead of what has passed since the last look is believed only after the service
has run with it for a day; until then the clock of retention goes on from where it was.
"""

from __future__ import annotations

import asyncio
import logging
import time
from dataclasses import dataclass

from service.jobs.queue import Queue
from service.jobs.transactions import StoreUnavailableError

__all__ = ["Clock", "advance", "expire"]

_EVERY = 600.0  # seconds
_DAY = 86_400.0
_NEAR = 3600.0  # seconds that a clock may be ahead: set by hand, or the service was down so long

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Clock:
    """What time it is, for retention.

    Parameters
    ----------
    believed : float
        Seconds since 1970 that deleting goes by.
    doubted : float
        Seconds that the service has run with a clock that was ahead of it.

    """

    believed: float
    doubted: float = 0.0


def advance(clock: Clock, now: float, run: float) -> Clock:
    """Return the clock after the service has run for a time.

    Parameters
    ----------
    clock : Clock
        What it was at the last look, perhaps before a restart.
    now : float
        What the machine's clock says.
    run : float
        Seconds that this process has run since its last look, by a clock that does not jump.

    """
    expected = clock.believed + run
    if now <= expected + _NEAR:  # behind is believed at once: it deletes less
        return Clock(now)
    doubted = clock.doubted + run
    return Clock(now) if doubted >= _DAY else Clock(expected, doubted)


async def expire(queue: Queue, days: float) -> None:
    """Delete, for ever, what ended more than `days` ago; any number of processes may do so."""
    looked = time.monotonic()
    while True:
        run = time.monotonic() - looked
        looked += run
        try:
            count = await asyncio.to_thread(_expire, queue, days, run)
            if count:
                logger.info("%d jobs and batches have expired", count)
        except StoreUnavailableError as error:
            logger.warning("the database does not answer: %s", error)
        await asyncio.sleep(_EVERY)


def _expire(queue: Queue, days: float, run: float) -> int:
    now = time.time()
    before = Clock(*queue.clock(now))
    clock = advance(before, now, run)
    if clock.doubted and not before.doubted:
        logger.warning(
            "the clock is %.1f days ahead of what has passed: nothing is deleted for that before "
            "the service has run for a day",
            (now - clock.believed) / _DAY,
        )
    queue.set_clock(clock.believed, clock.doubted)
    return queue.expire(clock.believed - days * _DAY)
