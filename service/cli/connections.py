"""Connections of the server: one that does not come to the point is closed."""

from __future__ import annotations

import asyncio
from typing import ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

__all__ = ["PunctualProtocol"]

_TAKING_SECONDS = 30.0  # for a caller to take the 64 kB that wait for it
_HEAD_SECONDS = 10.0  # from the beginning of a connection, or the end of an answer, to a request


class PunctualProtocol(H11Protocol):
    """HTTP/1.1 with a time limit for the head of a request, which uvicorn does not have.

    Its own limit for idle connections ends with the first byte of a request, and for a caller that
    does not read it waits for ever, with what was to be sent.
    """

    # Connections without a request, that which has waited longest first. Where there are too many
    # connections it makes room: who holds thousands open keeps nobody out who has something to say.
    _waiting: ClassVar[dict[PunctualProtocol, None]] = {}

    _timer: asyncio.TimerHandle | None = None
    _taking: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request."""
        super().connection_made(transport)
        if self.limit_concurrency is not None and len(self.connections) >= self.limit_concurrency:
            oldest = next(iter(self._waiting), None)
            if oldest is not None:
                oldest.transport.abort()
                oldest.connections.discard(oldest)
                oldest._stop()  # noqa: SLF001 - of this class
        self._look()

    def data_received(self, data: bytes) -> None:
        """Take what has come, and wait on if that is no request yet."""
        super().data_received(data)
        self._look()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        super().connection_lost(exc)
        self._stop()
        self._taken()

    def pause_writing(self) -> None:
        """Give a caller who does not take its answer so long, and no longer."""
        super().pause_writing()
        self._taking = self.loop.call_later(_TAKING_SECONDS, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: the caller has taken the most of what was sent."""
        super().resume_writing()
        self._taken()

    def _taken(self) -> None:
        if self._taking is not None:
            self._taking.cancel()
            self._taking = None

    def _look(self) -> None:
        """Let the timer run while there is no request, from when it was first missing."""
        if self.cycle is not None and not self.cycle.response_complete:
            self._stop()
        elif self._timer is None:
            self._timer = self.loop.call_later(_HEAD_SECONDS, self._close)
            self._waiting[self] = None

    def _stop(self) -> None:
        self._waiting.pop(self, None)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _close(self) -> None:
        self._timer = None
        self._waiting.pop(self, None)
        if self.cycle is None or self.cycle.response_complete:
            self.transport.close()
