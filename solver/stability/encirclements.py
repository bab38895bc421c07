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
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from solver.model.frequencies import grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LoopBatch", "LoopGain", "count_unstable"]

LoopGain: TypeAlias = "Callable[[NDArray[np.float64]], NDArray[np.complex128]]"

LARGEST_TURN = 0.6  # rad between neighbouring points, a tenth of a full turn
MAX_POINTS = 40_000
MAX_ENTRIES = 4_000_000  # of the matrices of all loops that are held at once: 64 MB
POINTS_PER_DECADE = 30
SMALL = 0.1  # at the high end: what is left of a loop's gain beyond its direct part,
LEVEL = 1e-3  # or its relative change over a decade where dead time feeds through


@dataclass(frozen=True)
class LoopBatch:
    """Loops of equal size, one row each.

    Attributes
    ----------
    loop_gain : callable
        L(j omega), (k, loops, m, m) complex, of frequencies (k,).
    bends : (b,) float
        Ascending corner frequencies of all the loops, rad per time unit.
    resonances : (r,) float
        Frequencies that resolve lightly damped dynamics.
    direct : (loops, m, m) float
        What each L passes on at once: its limit at infinity, but for what passes on after a dead
        time.
    integrators : (loops,) int, or int
        At least so many poles has det(I + L) at s = 0, those of the integrating controllers. A
        very weak direction shows its own far below all corners only, and there its closed-loop
        pole is; what never shows stays there, a closed-loop pole at s = 0.
    factors : callable or None
        Factors of det(I + L), (k, loops, f), where it has some: the argument of each is followed,
        since that of a product of many may turn once round from point to point unseen.

    """

    loop_gain: LoopGain
    bends: NDArray[np.float64]
    resonances: NDArray[np.float64]
    direct: NDArray[np.float64]
    integrators: NDArray[np.int64] | int = 0
    factors: LoopGain | None = None

    def determinant(self, omega: NDArray[np.float64]) -> _Determinant:
        """det(I + L) at `omega` (k,), (k, loops, f), by its factors."""
        if self.factors is not None:
            values = self.factors(omega)
            size = np.abs(values)
            with np.errstate(divide="ignore", invalid="ignore"):
                return _Determinant(values / size, np.log(size))
        at_once = max(1, MAX_ENTRIES // self.loop_gain(omega[:1]).size)
        parts = [
            _determinant(self.loop_gain(omega[first : first + at_once]))
            for first in range(0, omega.size, at_once)
        ]
        return _Determinant(*(np.concatenate(each) for each in zip(*parts, strict=True)))


class _Determinant(NamedTuple):
    """det(I + L), each factor a direction times e^log_size: of many it does not fit a double."""

    direction: NDArray[np.complex128]
    log_size: NDArray[np.float64]


def count_unstable(batch: LoopBatch) -> NDArray[np.int64]:
    """Count the closed-loop poles with a real part >= 0 of each loop, (loops,).

    A pole on the axis counts as unstable. The gain of a loop with dead time must be below one at
    infinity.

    Raises
    ------
    ArithmeticError
        A loop gain that is no number: none can be counted.

    """
    low, order, start = _low_end(batch)
    high, rest = _high_end(batch)
    extra = [batch.resonances, batch.bends]
    turned, lost = _turns(batch, grid(low, high, POINTS_PER_DECADE, extra))
    # From 0+ to the first point, and from the last one to infinity, by the known limits: there
    # det(I + L) = det(I + D) det(I + rest) with det(I + D) real, and I + t rest is regular for t
    # in 0..1, so that each of its eigenvalues turns back to one.
    turned += np.angle(np.where(start.real > 0, start, -start))
    turned -= np.angle(1 + np.linalg.eigvals(rest)).sum(axis=-1)
    hidden = np.maximum(batch.integrators - order, 0)
    half_turns = np.round(order / 2 - turned / math.pi + hidden)
    if not np.isfinite(half_turns).all():
        message = "the loop gain is not a number somewhere on the frequency axis"
        raise ArithmeticError(message)
    count = half_turns.astype(int)
    return np.where(lost, np.maximum(count, 1), count)


def _low_end(
    batch: LoopBatch,
) -> tuple[float, NDArray[np.float64], NDArray[np.complex128]]:
    """Return a frequency below which det ~ K s^-order, order, and the direction of K, (loops,)."""
    omega = 1e-3 * float(batch.bends[0])
    for _ in range(30):
        directions, log_sizes = batch.determinant(np.array([omega, omega / 2]))
        direction, log_size = directions.prod(axis=-1), log_sizes.sum(axis=-1)
        slope = (log_size[1] - log_size[0]) / math.log(2)
        order = np.round(slope)
        rest = direction[0] * 1j**order
        at_limit = np.abs(rest.imag) < 0.05 * np.abs(rest.real)
        if np.all((np.abs(slope - order) < 0.01) & at_limit & (order >= batch.integrators)):
            break
        omega /= 10
    return omega, order, rest


def _high_end(batch: LoopBatch) -> tuple[float, NDArray[np.complex128]]:
    """Return a frequency above which the loops are near their limits, and how far they are there.

    The second is (I + D)^-1 (L - D), D the direct part of L: small, or below one in its spectral
    radius where something passes on after a dead time.
    """
    omega = 1e3 * float(batch.bends[-1])
    through = np.eye(batch.direct.shape[-1]) + batch.direct
    before = math.inf
    for _ in range(30):
        L = batch.loop_gain(np.array([omega]))[0]
        rest = np.linalg.solve(through, L - batch.direct)
        # No eigenvalue exceeds the sum of a row.
        size = float(np.abs(rest).sum(axis=-1).max())
        if size < SMALL or abs(size - before) < LEVEL * size:
            break
        omega, before = 10 * omega, size
    return omega, rest


def _determinant(L: NDArray[np.complex128]) -> _Determinant:
    """det(I + L) of each L (..., m, m)."""
    sign, log_size = np.linalg.slogdet(np.eye(L.shape[-1]) + L)
    return _Determinant(sign[..., None], log_size[..., None])


def _turns(
    batch: LoopBatch, omega: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Total turn of each argument over `omega`, refined, and where it passes through 0."""
    values, log_size = batch.determinant(omega)
    lost: NDArray[np.bool_] = np.zeros(values.shape[1:], dtype=bool)
    # A determinant of many loops rises faster than each of them: a factor e for every four.
    size = 1 if batch.factors is not None else batch.loop_gain(omega[:1]).shape[-1]
    steep = max(1.0, 0.25 * size)
    while True:
        turn = np.angle(values[1:] * values[:-1].conj())
        coarse = (np.abs(turn) > LARGEST_TURN) | (np.abs(np.diff(log_size, axis=0)) > steep)
        coarse = coarse & ~lost
        middle = np.sqrt(omega[1:] * omega[:-1])
        # No room between two points, or for more of them: a zero on the axis.
        crowded = (middle <= omega[:-1]) | (middle >= omega[1:])
        lost |= coarse[crowded].any(axis=0)
        split = (coarse & ~lost).any(axis=(1, 2))
        if omega.size + np.count_nonzero(split) > MAX_POINTS:
            lost |= coarse.any(axis=0)
            split = np.zeros_like(split)
        if not split.any():
            return turn.sum(axis=(0, 2)), np.asarray(lost.any(axis=1))
        where = np.flatnonzero(split) + 1
        directions, sizes = batch.determinant(middle[split])
        values = np.insert(values, where, directions, axis=0)
        log_size = np.insert(log_size, where, sizes, axis=0)
        omega = np.insert(omega, where, middle[split])
