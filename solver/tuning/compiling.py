"""How long numba compiles: once after an installation, and no part of what a tuning takes.

Code that is read from the cache is not compiled, and not counted.
"""

from __future__ import annotations

import time
import weakref
from typing import TYPE_CHECKING

from numba.core import event

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Compiling"]


class _Stopwatch(event.Listener):  # type: ignore[misc]  # numba has no types
    """Adds up the time of compilations; one inside another is not counted twice."""

    def __init__(self, begins: Callable[[], None] | None) -> None:
        self.seconds = 0.0
        self._begins = begins
        self._depth = 0
        self._began = 0.0

    def on_start(self, event: event.Event) -> None:  # noqa: ARG002 - numba's own form
        if self._begins is not None:
            begins, self._begins = self._begins, None
            begins()
        if self._depth == 0:
            self._began = time.monotonic()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:  # noqa: ARG002 - numba's own form
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.monotonic() - self._began


class Compiling:
    """Listens to numba as long as it is held.

    Parameters
    ----------
    begins : callable or None
        Called once, when something begins to be compiled.

    """

    def __init__(self, begins: Callable[[], None] | None = None) -> None:
        self._stopwatch = _Stopwatch(begins)
        event.register("numba:compile", self._stopwatch)
        weakref.finalize(self, event.unregister, "numba:compile", self._stopwatch)

    @property
    def seconds(self) -> float:
        """Seconds of compiling since it was made."""
        return self._stopwatch.seconds
