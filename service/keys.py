"""API keys: random tokens, of which the service keeps a hash, a name and what they may do.

A token carries 256 random bits, so a plain SHA-256 of it cannot be searched for; there is
nothing to gain from a slow hash, which would only cost time on every request.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path

__all__ = ["Key", "KeyFile", "KeyFileError", "Scope"]

_PREFIX = "mutune"


class Scope(StrEnum):
    """What a key may do: READ looks, WRITE starts, cancels and analyses."""

    READ = "read"
    WRITE = "write"


class KeyFileError(Exception):
    """The file of keys cannot be read."""


@dataclass(frozen=True)
class Key:
    """An API key without its secret; times are seconds since 1970.

    Parameters
    ----------
    id : str
        What owns the jobs; it stays when the secret is changed.
    name : str
        Whose key it is.
    scopes : tuple of Scope
        What it may do.
    digest : str
        SHA-256 of the secret.
    created_at : float
        When the secret was made.
    expires_at : float or None
        When the key ends; None: never.
    previous_digest, previous_until
        The secret before this one, and until when it is good too.

    """

    id: str
    name: str
    scopes: tuple[Scope, ...]
    digest: str
    created_at: float
    expires_at: float | None = None
    previous_digest: str | None = None
    previous_until: float = 0.0

    def has_expired(self, now: float) -> bool:
        """Whether the key has ended."""
        return self.expires_at is not None and now >= self.expires_at


class KeyFile:
    """The keys in a file, which is read again whenever it changes.

    Parameters
    ----------
    path : Path
        JSON lines, one a key; an absent file holds none.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stamp: tuple[int, int] | None = None
        self._keys: dict[str, Key] = {}

    def all(self) -> list[Key]:
        """Return all keys.

        Raises
        ------
        KeyFileError
            A line is not a key.

        """
        self._refresh()
        return list(self._keys.values())

    def create(self, name: str, scopes: Iterable[Scope], *, lifetime: float | None = None) -> str:
        """Add a key, for `lifetime` seconds, and return its token, which is shown this once."""
        key_id, secret, now = secrets.token_hex(8), secrets.token_urlsafe(32), time.time()
        expires_at = None if lifetime is None else now + lifetime
        key = Key(key_id, name, tuple(scopes), _digest(secret), now, expires_at)
        self._write([*self.all(), key])
        return f"{_PREFIX}_{key_id}_{secret}"

    def rotate(self, key_id: str, *, grace: float, lifetime: float | None = None) -> str | None:
        """Give a key a new secret, and return its new token; None where there is no such key.

        Its jobs stay its own.

        Parameters
        ----------
        key_id : str
            Which.
        grace : float
            Seconds for which the old token is good too.
        lifetime : float or None
            Seconds until the key ends; None: it ends when it did.

        """
        keys = {key.id: key for key in self.all()}
        key = keys.get(key_id)
        if key is None:
            return None
        secret, now = secrets.token_urlsafe(32), time.time()
        keys[key_id] = replace(
            key,
            digest=_digest(secret),
            created_at=now,
            expires_at=key.expires_at if lifetime is None else now + lifetime,
            previous_digest=key.digest,
            previous_until=now + grace,
        )
        self._write(keys.values())
        return f"{_PREFIX}_{key_id}_{secret}"

    def revoke(self, key_id: str) -> bool:
        """Remove a key; return whether there was one."""
        keys = self.all()
        left = [key for key in keys if key.id != key_id]
        if len(left) < len(keys):
            self._write(left)
        return len(left) < len(keys)

    def verify(self, token: str) -> Key | None:
        """Return the key of a token, or None where there is none or it has expired."""
        self._refresh()
        prefix, _, rest = token.partition("_")
        key_id, _, secret = rest.partition("_")
        key = self._keys.get(key_id)
        # An unknown id costs the same comparison as a known one.
        digest = key.digest if key is not None else _digest("")
        matches = hmac.compare_digest(digest, _digest(secret))
        now = time.time()
        if key is not None and key.previous_digest is not None and now < key.previous_until:
            matches |= hmac.compare_digest(key.previous_digest, _digest(secret))
        if key is None or not matches or prefix != _PREFIX or key.has_expired(now):
            return None
        return key

    def _refresh(self) -> None:
        try:
            status = self._path.stat()
        except FileNotFoundError:
            self._keys, self._stamp = {}, None
            return
        stamp = (status.st_mtime_ns, status.st_ino)
        if stamp == self._stamp:
            return
        try:
            lines = self._path.read_text(encoding="utf-8").splitlines()
            keys = [_key(line) for line in lines if line.strip()]
        except (OSError, ValueError, KeyError, TypeError) as error:
            message = f"{self._path} is not a file of API keys"
            raise KeyFileError(message) from error
        self._keys, self._stamp = {key.id: key for key in keys}, stamp

    def _write(self, keys: Iterable[Key]) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # Written beside and moved into place: a reader sees the old file or the new one.
        handle, name = tempfile.mkstemp(dir=self._path.parent)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.writelines(json.dumps(asdict(key)) + "\n" for key in keys)
        Path(name).replace(self._path)


def _key(line: str) -> Key:
    entry = json.loads(line)
    scopes = tuple(Scope(scope) for scope in entry["scopes"])
    return Key(
        entry["id"],
        entry["name"],
        scopes,
        entry["digest"],
        entry["created_at"],
        entry.get("expires_at"),
        entry.get("previous_digest"),
        entry.get("previous_until", 0.0),
    )


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
