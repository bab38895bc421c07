"""Finished jobs are deleted after a time."""

from __future__ import annotations

import asyncio
import logging
import time

from service.jobs.queue import Queue
from service.jobs.transactions import StoreUnavailableError

__all__ = ["expire"]

_EVERY = 600.0  # seconds
_DAY = 86_400.0

logger = logging.getLogger(__name__)


async def expire(queue: Queue, days: float) -> None:
    """Delete, for ever, what ended more than `days` ago; any number of processes may do so."""
    while True:
        try:
            count = await asyncio.to_thread(queue.expire, time.time() - days * _DAY)
            if count:
                logger.info("%d jobs and batches have expired", count)
        except StoreUnavailableError as error:
            logger.warning("the database does not answer: %s", error)
        await asyncio.sleep(_EVERY)
