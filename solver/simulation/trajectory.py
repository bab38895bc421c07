"""Piecewise polynomial signals over time: what a simulation computed, exact between samples."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.simulation.chebyshev import (
    DEGREE,
    DIFFERENTIATION,
    NODES,
    evaluation_matrix,
    roots,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Trajectory", "TurningPoints"]

# Share of a step by which a time may miss a boundary through rounding.
_ROUNDING = 1e-9


class Trajectory:
    """Signals from time zero on, one polynomial a signal and step; jumps lie between steps.

    Parameters
    ----------
    resolution : float
        Times nearer than this are one.

    """

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self._starts: list[float] = []
        self._lengths: list[float] = []
        self._values: list[NDArray[np.float64]] = []

    def append(self, start: float, length: float, values: NDArray[np.float64]) -> None:
        """Add a step with its node values, (DEGREE + 1, signals)."""
        self._starts.append(start)
        self._lengths.append(length)
        self._values.append(values)

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._starts)

    @property
    def end(self) -> float:
        """Time up to which the signals are known."""
        return self._starts[-1] + self._lengths[-1] if self._starts else 0.0

    @cached_property
    def starts(self) -> NDArray[np.float64]:
        """Beginning of each step, (steps,); read it when the trajectory is complete."""
        return np.array(self._starts)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """Length of each step, (steps,); read it when the trajectory is complete."""
        return np.array(self._lengths)

    def nodes(self, signal: int) -> NDArray[np.float64]:
        """Values of a signal at the nodes of every step, (steps, DEGREE + 1)."""
        return np.array([values[:, signal] for values in self._values])

    def sample(self, signal: int, times: ArrayLike) -> NDArray[np.float64]:
        """Values of a signal at `times` (k,), ascending; at a jump the value after it."""
        moments = np.asarray(times, dtype=float)
        steps = np.clip(np.searchsorted(self.starts, moments, side="right") - 1, 0, None)
        places = np.clip((moments - self.starts[steps]) / self.lengths[steps], 0.0, 1.0)
        weights = evaluation_matrix(places)
        chosen = np.array([self._values[step][:, signal] for step in steps])
        value: NDArray[np.float64] = np.einsum("kd,kd->k", weights, chosen)
        return value

    def history(
        self, signals: NDArray[np.int_], start: float, length: float
    ) -> NDArray[np.float64]:
        """Values at the nodes of an earlier interval without jumps inside, (DEGREE + 1, signals).

        Zero before time zero.
        """
        # Rounding of a time may be more than the share of a short step, but never half of it.
        slack = min(max(_ROUNDING * length, 2 * self._resolution), length / 4)
        if start + length <= slack:
            return np.zeros((DEGREE + 1, signals.size))
        # The ends belong to the steps inside the interval, whatever rounding made of them.
        first = max(bisect_right(self._starts, start + slack) - 1, 0)
        last = max(bisect_left(self._starts, start + length - slack) - 1, first)
        if first == last:
            offset = (start - self._starts[first]) / self._lengths[first]
            share = length / self._lengths[first]
            return _part(f"{offset:.12f} {share:.12f}") @ self._values[first][:, signals]
        times = start + length * NODES
        steps = np.clip(np.searchsorted(self._starts, times, side="right") - 1, first, last)
        value = np.empty((DEGREE + 1, signals.size))
        for step in range(first, last + 1):
            own = steps == step
            places = (times[own] - self._starts[step]) / self._lengths[step]
            value[own] = evaluation_matrix(places) @ self._values[step][:, signals]
        return value

    def between(self, start: float, end: float) -> slice:
        """Return the steps from `start` to `end`, of which no step holds one inside.

        At a jump the value before it belongs to the step before, the value after it to the next.
        """
        middles = self.starts + self.lengths / 2
        return slice(*(int(at) for at in np.searchsorted(middles, [start, end])))

    def turning_points(self, signal: int) -> TurningPoints:
        """Both ends of every step and the extrema of a signal inside."""
        nodes = self.nodes(signal)
        slopes = nodes @ DIFFERENTIATION.T
        turning = (slopes.min(axis=1) < 0) & (slopes.max(axis=1) > 0)
        turning &= np.ptp(nodes, axis=1) > 1e-12 * np.abs(nodes).max(initial=0.0)
        places = [
            np.concatenate([[0.0], roots(slope) if turns else np.empty(0), [1.0]])
            for slope, turns in zip(slopes, turning, strict=True)
        ]
        step = np.repeat(np.arange(len(self)), [place.size for place in places])
        place = np.concatenate(places)
        value = np.einsum("kd,kd->k", evaluation_matrix(place), nodes[step])
        return TurningPoints(
            nodes, step, place, self.starts[step] + self.lengths[step] * place, value
        )


@lru_cache(maxsize=1024)
def _part(key: str) -> NDArray[np.float64]:
    """Return the matrix from the nodes of a step to those of a part of it.

    Offset and length of the part, in lengths of the step, come as twelve decimals: the parts that
    a dead time asks for again and again differ by rounding only.
    """
    offset, share = map(float, key.split())
    return evaluation_matrix(offset + share * NODES)


@dataclass(frozen=True, eq=False)
class TurningPoints:
    """Points of a signal between which it is monotone, jumps and wiggles of 1e-12 apart.

    Attributes
    ----------
    nodes : (steps, DEGREE + 1) ndarray
        Node values of the signal.
    step, place : (k,) ndarray
        Step of each point, and where in it, 0..1.
    time, value : (k,) ndarray
        The same in time, and the signal there.

    """

    nodes: NDArray[np.float64]
    step: NDArray[np.int_]
    place: NDArray[np.float64]
    time: NDArray[np.float64]
    value: NDArray[np.float64]

    def within(self, start: float, end: float) -> TurningPoints:
        """Return the points from `start` to `end`, those before a jump at `start` included."""
        return self._where((self.time >= start) & (self.time <= end))

    def of_steps(self, steps: slice) -> TurningPoints:
        """Return the points of some steps."""
        return self._where((self.step >= steps.start) & (self.step < steps.stop))

    def _where(self, inside: NDArray[np.bool_]) -> TurningPoints:
        return TurningPoints(
            self.nodes, self.step[inside], self.place[inside], self.time[inside], self.value[inside]
        )

    def passage(self, index: int, level: float) -> float:
        """Return when the signal passes `level` on its way to point `index` from the one before.

        At a jump that is the time of the jump.
        """
        before = index - 1
        if before < 0 or self.step[before] != self.step[index]:
            return float(self.time[index])
        beyond = self.value[[before, index]] - level
        if beyond[0] * beyond[1] >= 0:
            return float(self.time[index])
        values = self.nodes[self.step[index]] - level
        place = scipy.optimize.brentq(
            lambda place: float((evaluation_matrix(place) @ values)[0]),
            self.place[before],
            self.place[index],
        )
        share = (place - self.place[before]) / (self.place[index] - self.place[before])
        return float(self.time[before] + share * (self.time[index] - self.time[before]))
