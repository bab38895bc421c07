"""Times at which a delay system's signals are not smooth: jumps, and what dead time makes of them.

A jump in a signal returns one dead time later in the delayed signal. Where the delayed signal
acts through states it comes back one derivative smoother each time, where it acts directly it
comes back as a jump for ever, each time
smaller by the gain of the path (Bellen and Zennaro, Numerical Methods for Delay Differential
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

# Jumps in higher derivatives are few and small: they shorten a step where they matter. Measured on
# Wood and Berry's column with four incommensurate dead times: 3 needs half the steps of 6.
_SMOOTH = 3
_NOTHING = 1e-12  # share of a jump that is below the tolerance of a step
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
        self._direct = np.abs(system.D_delayed[system.delay_sources])
        self._tolerance = tolerance
        self._queue: list[tuple[float, int, int, float]] = []
        self._known: dict[tuple[int, int], tuple[int, float]] = {}
        distinct = np.unique(self._dead_times).size
        self._smooth = max(
            (order for order in range(1, _SMOOTH + 1) if math.comb(distinct + order, order)
             <= _FAMILY),
            default=1,
        )  # fmt: skip

    def jump(self, time: float, order: int = 0) -> None:
        """Announce a jump in derivative `order` of the signals at `time`."""
        for channel, dead_time in enumerate(self._dead_times):
            self._push(time + float(dead_time), channel, order, 1.0)

    def after(self, time: float) -> float:
        """Return the first breakpoint after `time`; infinity where there is none."""
        while self._queue and self._queue[0][0] <= time + self._tolerance:
            moment, channel, order, size = heapq.heappop(self._queue)
            for target, dead_time in enumerate(self._dead_times):
                gain = float(self._direct[target, channel])
                if size * gain > _NOTHING:
                    self._push(moment + float(dead_time), target, order, size * gain)
                else:
                    self._push(moment + float(dead_time), target, order + 1, size)
        return self._queue[0][0] if self._queue else math.inf

    def _push(self, time: float, channel: int, order: int, size: float) -> None:
        if order > self._smooth:
            return
        key = (channel, round(time / self._tolerance))
        if self._known.get(key, (order + 1, 0.0)) > (order, -size):
            self._known[key] = (order, -size)
            heapq.heappush(self._queue, (time, channel, order, size))
