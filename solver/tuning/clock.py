"""Progress and time limit of a running tuning."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from solver.tuning.compiling import Compiling
from solver.tuning.record import Progress

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Clock", "OutOfTimeError"]

PROGRESS_INTERVAL = 0.1  # seconds


class OutOfTimeError(Exception):
    """The time limit has passed, or the progress function wants no more."""


class Clock:
    """Calls the user's progress function now and then, and watches the time limit.

    Parameters
    ----------
    limit : float or None
        Seconds; those of compiling, at the first use after an installation, do not count.
    progress : callable or None
        Takes a `Progress`; what it raises passes through. If it returns True, the tuning ends as
        if the limit had passed.
    as_objective : callable
        From a search's value s to the objective.

    """

    def __init__(
        self,
        limit: float | None,
        progress: Callable[[Progress], bool | None] | None,
        as_objective: Callable[[float], float],
    ) -> None:
        self.started = time.monotonic()
        self.compiling = Compiling()
        self.stopped = False
        self.limit = limit
        self.progress = progress
        self.as_objective = as_objective
        self.best = math.inf
        self.done = 0
        self.total = 0
        self._last = -math.inf
        self._fraction = 0.0
        self._offered: Callable[[], float] | None = None
        self._working_out = False

    @property
    def elapsed(self) -> float:
        """Seconds since the start, without those of compiling."""
        return time.monotonic() - self.started - self.compiling.seconds

    def grant(self, seconds: float) -> None:
        """Run on for so long, and silently, after the end: to make good what there is."""
        self.progress = None
        self.stopped = False
        self.limit = self.elapsed + seconds

    def end(self) -> None:
        """Let every tick from now on raise `OutOfTimeError`."""
        self.stopped = True

    def offer(self, value: Callable[[], float]) -> None:
        """Have a value s at hand that is worked out when it is to be told; infinite: there is none.

        It takes the place of what was offered before.
        """
        self._offered = value

    def tick(self, value: float = math.inf) -> None:
        """Take note of a value s; raises `OutOfTimeError` when the limit has passed."""
        now = self.elapsed
        self._note(value)
        if self.stopped or (self.limit is not None and now > self.limit):
            raise OutOfTimeError
        if self._working_out:  # what is offered ticks too, and is to be told before all else
            return
        if self.progress is not None and now - self._last > PROGRESS_INTERVAL:
            self._last = now
            self._note_offered()
            best = self.best if math.isfinite(self.best) else None
            # More searches may come up on the way; progress never falls.
            self._fraction = max(self._fraction, min(self.done / max(self.total, 1), 1.0))
            total = max(self.total, self.done, 1)
            if self.progress(Progress(self._fraction, best, self.done, total)):
                self.stopped = True
                raise OutOfTimeError

    def _note_offered(self) -> None:
        offered, self._offered = self._offered, None
        if offered is None:
            return
        self._working_out = True
        try:
            self._note(offered())
        finally:
            self._working_out = False

    def _note(self, value: float) -> None:
        if math.isfinite(value):
            self.best = min(self.best, self.as_objective(value))
