"""Who calls, what they may do, and how often."""

from __future__ import annotations

import math
import time
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from service.keys import KeyFile, KeyFileError, Scope
from service.problems import ForbiddenError, RateError, UnauthorizedError, UnavailableError

__all__ = ["RateLimiter", "Token", "authenticate", "owner"]

_READING = frozenset({"GET", "HEAD", "OPTIONS"})
_bearer = HTTPBearer(
    auto_error=False,
    scheme_name="ApiKey",
    description="An API key, where the service was started with keys (`mutune keys create`).",
)

Token = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]


class RateLimiter:
    """A bucket of requests for each caller, refilled at a steady rate.

    Parameters
    ----------
    per_minute : int
        Rate; a caller may also spend a whole minute's requests at once.

    """

    def __init__(self, per_minute: int) -> None:
        self._size = float(per_minute)
        self._rate = per_minute / 60
        self._buckets: dict[str, tuple[float, float]] = {}
        self.policy = f'"key";q={per_minute};w=60'

    def limit(self, caller: str) -> str:
        """Say how many requests are left, and in how many seconds all are there again.

        As the header `RateLimit` of draft-ietf-httpapi-ratelimit-headers-10 has it.
        """
        left, _ = self._buckets.get(caller, (self._size, 0.0))
        return f'"key";r={int(left)};t={math.ceil((self._size - left) / self._rate)}'

    def spend(self, caller: str) -> float:
        """Take a request; return 0, or the seconds until there is one again."""
        now = time.monotonic()
        left, then = self._buckets.get(caller, (self._size, now))
        left = min(self._size, left + (now - then) * self._rate)
        if left < 1:
            self._buckets[caller] = (left, now)
            return (1 - left) / self._rate
        self._buckets[caller] = (left - 1, now)
        return 0.0


def authenticate(request: Request, token: Token) -> None:
    """Check the key of a request; its id is then the owner of what the request creates.

    Without a file of keys everybody is the same caller; such a service listens on the loopback
    address only.

    Raises
    ------
    UnauthorizedError, ForbiddenError, RateError
        No valid key, a key without the scope, or too many requests.

    """
    request.state.owner = ""
    keys: KeyFile | None = request.app.state.keys
    if keys is None:
        return
    try:
        key = keys.verify(token.credentials) if token is not None else None
    except KeyFileError as error:
        raise UnavailableError(str(error), {"Retry-After": "10"}) from None
    if key is None:
        message = "Send a valid API key: Authorization: Bearer KEY."
        raise UnauthorizedError(message, {"WWW-Authenticate": "Bearer"})
    limiter: RateLimiter = request.app.state.limiter
    request.state.owner = key.id
    wait = limiter.spend(key.id)
    request.state.rate = limiter.policy, limiter.limit(key.id)
    if wait:
        message = "This key has made too many requests."
        raise RateError(message, {"Retry-After": str(math.ceil(wait))})
    needed = Scope.READ if request.method in _READING else Scope.WRITE
    if needed not in key.scopes:
        message = f"This key lacks the scope {needed}."
        raise ForbiddenError(message)


def owner(request: Request) -> str:
    """Return the owner that `authenticate` found."""
    result: str = request.state.owner
    return result
