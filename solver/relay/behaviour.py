"""What an oscillation does over time: limit cycle, change of behaviour, drift to rest.

Only the intervals between switchings are looked at, so a cycle may switch several times in each
half period, as that of Johansson (1993), fig. 8, does in the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.simulation.trajectory import Trajectory

__all__ = ["Behaviour", "Regime", "behaviour", "cycle_length", "regimes"]

_LONGEST_CYCLE = 12  # switchings in a period
_REPEATS = 3  # periods that must agree before they are a cycle
_SAME = 1e-3  # of the period: intervals that differ by less are equal
_ALIKE = 0.15  # of the period: intervals that differ by more are another behaviour
_QUIET = 4.0  # longest recent intervals without a switching: the relay has stopped
_RESTS = 0.01  # of the whole range of an output: variation that counts as rest


class Behaviour(StrEnum):
    """How the experiment ended.

    LIMIT_CYCLE: the last three periods agree. CONSTANT: the relay stopped switching and the
    outputs rest: the other loops hold the output off the switching level; take (a) more
    conservative settings in them, (b) another loop for the relay. STOPPED: the relay stopped
    switching, but the outputs still move: simulate longer. NO_SWITCHING: it never switched: (a)
    less hysteresis or more amplitude, (b) the sign of the amplitude must be that of the process
    gain, (c) simulate longer. IRREGULAR: no period is seen: simulate longer. DIVERGED: an output
    left its bound: the loops under control are unstable. STEP_LIMIT: too many steps: give the
    relay more hysteresis, or simulate less long.
    """

    LIMIT_CYCLE = "limit_cycle"
    CONSTANT = "constant"
    STOPPED = "stopped"
    NO_SWITCHING = "no_switching"
    IRREGULAR = "irregular"
    DIVERGED = "diverged"
    STEP_LIMIT = "step_limit"


@dataclass(frozen=True)
class Regime:
    """A stretch of similar periods.

    Attributes
    ----------
    start, end : float
        Times of its first and last switching.
    period : float
        Its last period.
    switchings : int
        Switchings in a period: 2, or more where the relay is hit several times in passing.

    """

    start: float
    end: float
    period: float
    switchings: int


def cycle_length(times: NDArray[np.float64], resolution: float) -> int | None:
    """Return the number of switchings in the period of the limit cycle at the end, or None.

    Parameters
    ----------
    times : (k,) ndarray
        Switching times.
    resolution : float
        Sampling period of the relay, 0 where it always looks.

    """
    intervals = np.diff(times)
    for count in range(2, _LONGEST_CYCLE + 1, 2):
        if intervals.size < _REPEATS * count:
            return None
        last = intervals[-_REPEATS * count :].reshape(_REPEATS, count)
        allowed = _SAME * last[-1].sum() + 1.01 * resolution
        if np.ptp(last, axis=0).max() <= allowed:
            return count
    return None


def regimes(times: NDArray[np.float64]) -> tuple[Regime, ...]:
    """Return the stretches of at least three similar periods, in time."""
    intervals = np.diff(times)
    found: list[Regime] = []
    first = 0
    while first < intervals.size:
        runs = [(_run(intervals, first, count), count) for count in range(2, _LONGEST_CYCLE + 1, 2)]
        length, count = max(runs, key=lambda run: (run[0] >= _REPEATS * run[1], run[0], -run[1]))
        if length < _REPEATS * count:
            first += 1
            continue
        stretch = intervals[first : first + length]
        found.append(
            Regime(
                start=float(times[first]),
                end=float(times[first + length]),
                period=float(stretch[-count:].sum()),
                switchings=count,
            )
        )
        first += length
    return tuple(found)


def _run(intervals: NDArray[np.float64], first: int, count: int) -> int:
    """Count the intervals from `first` on that resemble those `count` before them."""
    given = intervals[first:]
    if given.size <= count:
        return 0
    change = np.abs(given[count:] - given[:-count])
    period = np.convolve(given, np.ones(count), mode="valid")[: change.size]
    different = np.flatnonzero(change > _ALIKE * period / count)
    return int(different[0]) + count if different.size else int(given.size)


def behaviour(
    times: NDArray[np.float64],
    trajectory: Trajectory,
    outputs: list[int],
    resolution: float,
) -> Behaviour:
    """Return how a completed experiment ended.

    Parameters
    ----------
    times : (k,) ndarray
        Switching times.
    trajectory : Trajectory
        The signals.
    outputs : list of int
        The plant outputs among them.
    resolution : float
        Sampling period of the relay, 0 where it always looks.

    """
    if times.size == 0:
        return Behaviour.NO_SWITCHING
    recent = np.diff(times, prepend=0.0)[-_LONGEST_CYCLE:]
    quiet = trajectory.end - float(times[-1])
    if quiet > _QUIET * float(recent.max()):
        settled = max(
            _ptp(trajectory, signal, trajectory.end - quiet / 4, trajectory.end)
            / (_ptp(trajectory, signal, 0.0, trajectory.end) or 1.0)
            for signal in outputs
        )
        return Behaviour.CONSTANT if settled <= _RESTS else Behaviour.STOPPED
    if cycle_length(times, resolution) is not None:
        return Behaviour.LIMIT_CYCLE
    return Behaviour.IRREGULAR


def _ptp(trajectory: Trajectory, signal: int, start: float, end: float) -> float:
    return float(np.ptp(trajectory.turning_points(signal).within(start, end).value))
