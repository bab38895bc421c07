"""Times at which a delay system's signals are not smooth: jumps, and what dead time makes of them.

A jump in a signal returns one dead time later in the delayed signal. Where the delayed signal
acts through states it comes back one derivative smoother each time, where it acts directly it
comes back as a jump for ever (Bellen and Zennaro, Numerical Methods for Delay Differential
Equations, 2003, chapter 2).
"""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from solver.simulation.delay_system import DelaySystem

__all__ = ["Breakpoints"]

# A jump in a higher derivative is below the tolerance of a step, or shortens the step.
_SMOOTH = 6
_FAMILY = 2000  # times that one jump may breed before it counts as smooth earlier


class Breakpoints:
    """Queue of the times at which a step must end.

    Parameters
    ----------
    system : DelaySystem
        The system, no signal at its limit.
    tolerance : float
        Times nearer than this are one.

    """

    def __init__(self, system: DelaySystem, tolerance: float) -> None:
        self._dead_times = system.dead_times
        self._direct = system.D_delayed[system.delay_sources] != 0
        self._tolerance = tolerance
        self._queue: list[tuple[float, int, int]] = []
        self._known: dict[tuple[int, int], int] = {}
        distinct = np.unique(self._dead_times).size
        self._smooth = max(
            (order for order in range(1, _SMOOTH + 1) if math.comb(distinct + order, order)
             <= _FAMILY),
            default=1,
        )  # fmt: skip

    def jump(self, time: float, order: int = 0) -> None:
        """Announce a jump in derivative `order` of the signals at `time`."""
        for channel, dead_time in enumerate(self._dead_times):
            self._push(time + float(dead_time), channel, order)

    def after(self, time: float) -> float:
        """Return the first breakpoint after `time`; infinity where there is none."""
        while self._queue and self._queue[0][0] <= time + self._tolerance:
            moment, channel, order = heapq.heappop(self._queue)
            for target, dead_time in enumerate(self._dead_times):
                smoother = order if self._direct[target, channel] else order + 1
                self._push(moment + float(dead_time), target, smoother)
        return self._queue[0][0] if self._queue else math.inf

    def _push(self, time: float, channel: int, order: int) -> None:
        if order > self._smooth:
            return
        key = (channel, round(time / self._tolerance))
        if self._known.get(key, order + 1) > order:
            self._known[key] = order
            heapq.heappush(self._queue, (time, channel, order))
