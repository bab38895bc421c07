"""What happens to a system from outside or by its own signals: events, limits, relays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from solver.simulation.chebyshev import DEGREE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Crossing", "Event", "NoSwitching", "Switching"]


@dataclass(frozen=True)
class Event:
    """A jump by `change` of an external signal at `time` >= 0."""

    time: float
    external: int
    change: float


@dataclass(frozen=True)
class Crossing:
    """Something to be switched at `place` (0..1 of the step) by member `cause` of the switching.

    Where a signal reaches a level, `signal` and `level` let the integrator sharpen the place
    with the exact solution; both are None for a switching bound to the clock.
    """

    place: float
    cause: int
    signal: int | None = None
    level: float | None = None


class Switching(Protocol):
    """What switches on the signals: limits, relays."""

    def mode(self) -> tuple[int, ...]:
        """Return the state of the limited signals."""

    def start(self, external: NDArray[np.float64]) -> None:
        """Set the external signals that belong to the switching, at time zero."""

    def crossing(self, time: float, length: float, values: NDArray[np.float64]) -> Crossing | None:
        """Return the first switching in a step with these node values, or None."""

    def switch(self, crossing: Crossing, time: float, external: NDArray[np.float64]) -> int:
        """Carry it out; return the lowest derivative that jumps."""


class NoSwitching:
    """A linear system: nothing switches."""

    def mode(self) -> tuple[int, ...]:
        """Return the state of the limited signals: there are none."""
        return ()

    def start(self, external: NDArray[np.float64]) -> None:
        """Do nothing."""

    def crossing(self, time: float, length: float, values: NDArray[np.float64]) -> Crossing | None:
        """Return None."""
        del time, length, values
        return None

    def switch(self, crossing: Crossing, time: float, external: NDArray[np.float64]) -> int:
        """Never called."""
        del crossing, time, external
        return DEGREE
