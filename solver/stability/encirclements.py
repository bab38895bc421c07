"""Unstable closed-loop poles of many loops at once, by the argument of det(I + L).

For L without poles in the right half plane, those at s = 0 apart, the number of zeros of
det(I + L(s)) there follows from the turn of its argument along the imaginary axis. All loops of a
batch share a grid, which is bisected until none of them turns by more than `LARGEST_TURN` from
point to point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from solver.model.frequencies import grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Batch", "LoopGain", "count_unstable"]

LoopGain: TypeAlias = "Callable[[NDArray[np.float64]], NDArray[np.complex128]]"

LARGEST_TURN = 0.6  # rad between neighbouring points, a tenth of a full turn
MAX_POINTS = 40_000
POINTS_PER_DECADE = 30


@dataclass(frozen=True)
class Batch:
    """Loops of equal size, one row each.

    Attributes
    ----------
    loop_gain : callable
        L(j omega), (k, loops, m, m) complex, of frequencies (k,).
    bends : (b,) float
        Ascending corner frequencies of all the loops, rad per time unit.
    resonances : (r,) float
        Frequencies that resolve lightly damped dynamics.
    dead_time, biproper : bool
        Whether any of L has dead time, and whether any does not vanish at infinity.
    integrators : (loops,) int, or int
        At least so many poles has det(I + L) at s = 0, those of the integrating controllers. A
        very weak direction shows its own far below all corners only, and there its closed-loop
        pole is; what never shows stays there, a closed-loop pole at s = 0.

    """

    loop_gain: LoopGain
    bends: NDArray[np.float64]
    resonances: NDArray[np.float64]
    dead_time: bool
    biproper: bool
    integrators: NDArray[np.int64] | int = 0

    def determinant(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """det(I + L) at `omega` (k,), (k, loops)."""
        return _determinant(self.loop_gain(omega))


def count_unstable(batch: Batch) -> NDArray[np.int64]:
    """Count the closed-loop poles with a real part >= 0 of each loop, (loops,).

    A pole on the axis counts as unstable. The gain of a loop with dead time must be below one at
    infinity.
    """
    low, order, start = _low_end(batch)
    high, gain = _high_end(batch)
    extra = [batch.resonances, batch.bends]
    turned, lost = _turns(batch, grid(low, high, POINTS_PER_DECADE, extra))
    # From 0+ to the first point, and from the last one to infinity, by the known limits.
    turned += np.angle(np.where(start.real > 0, start, -start))
    turned -= _last_turn(batch, gain)
    hidden = np.maximum(batch.integrators - order, 0)
    count = np.round(order / 2 - turned / math.pi + hidden).astype(int)
    return np.where(lost, np.maximum(count, 1), count)


def _low_end(
    batch: Batch,
) -> tuple[float, NDArray[np.float64], NDArray[np.complex128]]:
    """Return a frequency below which det ~ K s^-order, and order and K, (loops,)."""
    omega = 1e-3 * float(batch.bends[0])
    for _ in range(30):
        here, below = batch.determinant(np.array([omega, omega / 2]))
        slope = np.log2(np.abs(below) / np.abs(here))
        order = np.round(slope)
        rest = here * (1j * omega) ** order
        at_limit = np.abs(rest.imag) < 0.05 * np.abs(rest.real)
        if np.all((np.abs(slope - order) < 0.01) & at_limit & (order >= batch.integrators)):
            break
        omega /= 10
    return omega, order, rest


def _high_end(batch: Batch) -> tuple[float, NDArray[np.complex128]]:
    """Return a frequency above which the loop gains stay small, or constant, and L there."""
    omega = 1e3 * float(batch.bends[-1])
    for _ in range(30):
        L = batch.loop_gain(np.array([omega]))[0]
        # No eigenvalue exceeds the sum of a row.
        if batch.biproper or np.abs(L).sum(axis=-1).max() < 0.1:
            break
        omega *= 10
    return omega, L


def _last_turn(batch: Batch, L: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the argument at the high end relative to its limit at infinity, (loops,)."""
    eigenvalues = np.linalg.eigvals(L)
    # I + t L is regular for t in 0..1 where L is small, so each eigenvalue turns back to 1.
    directly = np.angle(1 + eigenvalues).sum(axis=-1)
    value = _determinant(L)
    to_real_axis = np.angle(np.where(value.real > 0, value, -value))
    near = batch.dead_time | (np.abs(eigenvalues).max(axis=-1) < 0.5)
    return np.asarray(np.where(near, directly, to_real_axis))


def _determinant(L: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """det(I + L) of each L (..., m, m)."""
    return np.asarray(np.linalg.det(np.eye(L.shape[-1]) + L))


def _turns(
    batch: Batch, omega: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Total turn of each argument over `omega`, refined, and where it passes through 0."""
    values = batch.determinant(omega)
    lost: NDArray[np.bool_] = np.zeros(values.shape[1], dtype=bool)
    while True:
        ratio = values[1:] / values[:-1]
        turn = np.angle(ratio)
        coarse = (np.abs(turn) > LARGEST_TURN) | (np.abs(np.log(np.abs(ratio))) > 1)
        coarse = coarse & ~lost
        middle = np.sqrt(omega[1:] * omega[:-1])
        # No room between two points, or for more of them: a zero on the axis.
        crowded = (middle <= omega[:-1]) | (middle >= omega[1:])
        lost |= coarse[crowded].any(axis=0)
        split = (coarse & ~lost).any(axis=1)
        if omega.size + np.count_nonzero(split) > MAX_POINTS:
            lost |= coarse.any(axis=0)
            split = np.zeros_like(split)
        if not split.any():
            return turn.sum(axis=0), lost
        where = np.flatnonzero(split) + 1
        values = np.insert(values, where, batch.determinant(middle[split]), axis=0)
        omega = np.insert(omega, where, middle[split])
