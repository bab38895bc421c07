"""The relay as a switching: when its input passes a level, its output jumps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.simulation.chebyshev import evaluation_matrix, first_root
from solver.simulation.switching import Crossing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.relay.experiment import Relay

__all__ = ["RelaySwitching"]

_SAMPLES_AFTER = 10_000  # looked at after the output has passed the level within a step
_ROUNDING = 1e-9  # of the largest output so far: smaller excursions are rounding


class RelaySwitching:
    """A relay between an output and an external signal.

    Parameters
    ----------
    relay : Relay
        The relay.
    output : int
        The signal it looks at.
    external : int
        The external signal it drives.

    Attributes
    ----------
    times : list of float
        Switching times; the output falls to -d at the first one, rises at the second, ...

    """

    def __init__(self, relay: Relay, output: int, external: int) -> None:
        self.times: list[float] = []
        self._relay = relay
        self._output = output
        self._external = external
        self._sign = 1
        self._largest = 0.0

    def mode(self) -> tuple[int, ...]:
        """Return the state of the limited signals: there are none."""
        return ()

    def start(self, external: NDArray[np.float64]) -> None:
        """Start with the relay at +d."""
        external[self._external] = self._relay.amplitude

    def crossing(self, time: float, length: float, values: NDArray[np.float64]) -> Crossing | None:
        """Return the first time at which the relay must switch, or None."""
        output = values[:, self._output]
        self._largest = max(self._largest, float(np.abs(output).max()))
        # Positive once e = -y asks for the other side.
        beyond = self._sign * output - self._relay.hysteresis
        if self._relay.sampling_period is not None:
            return self._sampled(time, length, beyond, self._relay.sampling_period)
        place = first_root(beyond, _ROUNDING * self._largest)
        if place is None:
            return None
        return Crossing(place, 0, self._output, self._sign * self._relay.hysteresis)

    def switch(self, crossing: Crossing, time: float, external: NDArray[np.float64]) -> int:
        """Reverse the relay's output."""
        del crossing
        self.times.append(time)
        self._sign = -self._sign
        external[self._external] = self._sign * self._relay.amplitude
        return 0

    def _sampled(
        self, time: float, length: float, beyond: NDArray[np.float64], period: float
    ) -> Crossing | None:
        """Look at the samples after the beginning of the step, up to its end."""
        place = first_root(beyond, 0.0)
        if place is None:
            return None
        # The sample at the beginning of the step belongs to the step before.
        begun = math.floor(time / period * (1 + 1e-12) + 1e-9) + 1
        first = max(begun, math.ceil((time + place * length) / period * (1 - 1e-12) - 1e-9))
        last = math.floor((time + length) / period * (1 + 1e-12) + 1e-9)
        last = min(last, first + _SAMPLES_AFTER)
        if last < first:
            return None
        places = (np.arange(first, last + 1) * period - time) / length
        late = np.flatnonzero(evaluation_matrix(places) @ beyond > 0)
        return Crossing(min(float(places[late[0]]), 1.0), 0) if late.size else None
