"""Notices to URLs of callers that a tuning or a batch has ended.

Only to URLs that the administrator has allowed, without following redirects, and signed as Standard
Webhooks (standardwebhooks.com) has it: the receiver knows that they are from here, and unchanged.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import json
import logging
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from service.jobs.callbacks import Callbacks, Due
from service.jobs.transactions import StoreUnavailableError

if TYPE_CHECKING:
    import httpx

__all__ = ["is_allowed", "notify", "signature"]

_EVERY = 1.0  # seconds between looks, at least
_SHARE = 20.0  # a look may take this part of the time between looks: many may wait
_AT_ONCE = 20
_PATIENCE = 10.0  # seconds for an answer
_GONE = 410

logger = logging.getLogger(__name__)


def is_allowed(url: str, prefixes: tuple[str, ...]) -> bool:
    """Whether a URL lies below one of the allowed ones: same scheme, host and port, path below."""
    try:
        wanted = urlsplit(url)
        port = wanted.port
    except ValueError:
        return False
    if wanted.username is not None or wanted.password is not None or wanted.fragment:
        return False
    if any(character <= " " or character in "\\\x7f" for character in url):
        return False
    parts = wanted.path.lower().replace("%2e", ".").split("/")
    if ".." in parts or "." in parts:
        return False
    for prefix in map(urlsplit, prefixes):
        same = (wanted.scheme, wanted.hostname, port) == (
            prefix.scheme,
            prefix.hostname,
            prefix.port,
        )
        base = prefix.path.rstrip("/")
        if same and (wanted.path == base or wanted.path.startswith(f"{base}/")):
            return True
    return False


def signature(secret: bytes, notice: str, timestamp: int, body: bytes) -> str:
    """Return the value of `webhook-signature`."""
    signed = f"{notice}.{timestamp}.".encode() + body
    digest = hmac.new(secret, signed, hashlib.sha256).digest()
    return f"v1,{base64.b64encode(digest).decode()}"


async def notify(callbacks: Callbacks, key_file: Path) -> None:
    """Tell, for ever, whoever is to be told."""
    import httpx  # noqa: PLC0415 - where there are callbacks at all

    async with httpx.AsyncClient(
        timeout=_PATIENCE, follow_redirects=False, trust_env=False
    ) as client:

        async def tell(due: Due) -> None:
            sent = await _post(client, due, key_file)
            if not sent and due.is_last:
                logger.error("%s %s: its callback is given up", due.kind, due.id)
            if sent or due.is_last:
                await asyncio.to_thread(callbacks.end, due.sequence)

        while True:
            begun = time.monotonic()
            try:
                found = await asyncio.to_thread(callbacks.take, time.time(), _AT_ONCE)
                took = time.monotonic() - begun
                await asyncio.gather(*map(tell, found))
            except StoreUnavailableError as error:
                logger.warning("the database does not answer: %s", error)
                found, took = [], 0.0
            if len(found) < _AT_ONCE:
                await asyncio.sleep(max(_EVERY, _SHARE * took))


async def _post(client: httpx.AsyncClient, due: Due, key_file: Path) -> bool:
    """Send one notice; whether it has arrived, or is not wanted any more."""
    import httpx  # noqa: PLC0415 - as above

    now = int(time.time())
    body = json.dumps(
        {
            "type": f"{due.kind}.ended",
            "timestamp": datetime.fromtimestamp(now, UTC).isoformat(),
            "data": {"id": due.id, "status": due.status, "link": f"/v1/{due.resource}/{due.id}"},
        }
    ).encode()
    notice = f"{due.kind}_{due.id}"
    try:
        secret = (await asyncio.to_thread(key_file.read_bytes)).strip()
        async with client.stream(
            "POST",
            due.url,
            content=body,
            headers={
                "Content-Type": "application/json",
                "webhook-id": notice,
                "webhook-timestamp": str(now),
                "webhook-signature": signature(secret, notice, now, body),
            },
        ) as response:
            status = response.status_code
    except (httpx.HTTPError, OSError) as error:
        logger.warning("callback of %s %s: %s", due.kind, due.id, type(error).__name__)
        return False
    if not 200 <= status < 300 and status != _GONE:
        logger.warning("callback of %s %s: status %d", due.kind, due.id, status)
        return False
    return True
