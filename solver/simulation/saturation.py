"""Input limits as switchings between linear systems.

With back-calculation the motion is continuous across a limit, so there is no sliding: every
switching lasts, and the linear pieces together are exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.simulation.chebyshev import first_root
from solver.simulation.switching import Crossing

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from solver.simulation.wiring import LimitedSignal

__all__ = ["Saturation"]

# Share of the range by which a signal may pass its limit before it counts: far above the
# rounding of a signal that has just been put there, far below what anyone can see.
_SLACK = 1e-11


class Saturation:
    """Limits of signals, in the order of `Wiring.limited`.

    Parameters
    ----------
    limited : sequence of LimitedSignal
        Where the signals stand.
    low, high : sequence of float
        Their limits.

    """

    def __init__(
        self, limited: Sequence[LimitedSignal], low: Sequence[float], high: Sequence[float]
    ) -> None:
        self._limited = limited
        self._low, self._high = low, high
        self._mode = [0] * len(limited)

    def mode(self) -> tuple[int, ...]:
        """Return 0 (free), 1 (at the high limit) or -1 (at the low one) for each."""
        return tuple(self._mode)

    def start(self, external: NDArray[np.float64]) -> None:
        """Set the limits."""
        for clip, low, high in zip(self._limited, self._low, self._high, strict=True):
            external[[clip.low, clip.high]] = low, high

    def crossing(self, time: float, length: float, values: NDArray[np.float64]) -> Crossing | None:
        """Return the first passage of a limit, outwards or back, or None."""
        del time, length
        first: Crossing | None = None
        for index, clip in enumerate(self._limited):
            slack = _SLACK * (self._high[index] - self._low[index])
            for sign, level in ((1, self._high[index]), (-1, self._low[index])):
                if self._mode[index] == -sign:
                    continue
                # Positive once the present mode is wrong.
                outward = -1 if self._mode[index] == sign else 1
                beyond = outward * sign * (values[:, clip.raw] - level)
                place = first_root(beyond, slack)
                if place is not None and (first is None or place < first.place):
                    first = Crossing(place, index * 2 + (sign > 0), clip.raw, level)
        return first

    def switch(self, crossing: Crossing, time: float, external: NDArray[np.float64]) -> int:
        """Clip the signal or free it; its first derivative jumps."""
        del time, external
        index, upper = divmod(crossing.cause, 2)
        self._mode[index] = 0 if self._mode[index] else (1 if upper else -1)
        return 1
