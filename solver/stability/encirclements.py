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

__all__ = ["INFINITELY_MANY", "LoopBatch", "LoopGain", "count_unstable"]

LoopGain: TypeAlias = "Callable[[NDArray[np.float64]], NDArray[np.complex128]]"

INFINITELY_MANY = 10**9  # or more than can be counted
LARGEST_TURN = 0.6  # rad between neighbouring points, a tenth of a full turn
MAX_POINTS = 40_000
MAX_ENTRIES = 4_000_000  # of the matrices of all loops that are held at once: 64 MB
POINTS_PER_DECADE = 30
SMALL = 0.1  # at the high end: what is left of a loop's gain beyond its direct part,
LEVEL = 1e-3  # or its relative change over a decade where dead time feeds through
MOST_FOLLOWED = 200_000  # entries of matrices: some tenths of a second,
FEWEST_FOLLOWED = 10_000  # points that dead time may need in any case
LOOKS = 3  # at an interval over which dead time turns, whether it is calm,
CALM = 1 - 1e-6  # the spectral radius below which it is
PERRON_ROUNDS = 8  # of the power method: the bound is then near the root, and a bound in any case


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
    dead_time : float
        The longest one. It may turn det(I + L) once round, or many times, from point to point.

    """

    loop_gain: LoopGain
    bends: NDArray[np.float64]
    resonances: NDArray[np.float64]
    direct: NDArray[np.float64]
    integrators: NDArray[np.int64] | int = 0
    factors: LoopGain | None = None
    dead_time: float = 0.0

    def rest(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """(I + D)^-1 (L - D) at `omega` (k,), (k, loops, m, m), D the direct part of L."""
        through = np.eye(self.direct.shape[-1]) + self.direct
        rest = np.linalg.solve(through, self.loop_gain(omega) - self.direct)
        return np.asarray(rest, dtype=np.complex128)

    def determinant(self, omega: NDArray[np.float64]) -> _Determinant:
        """det(I + L) at `omega` (k,), (k, loops, f), by its factors."""
        if self.factors is not None:
            values = self.factors(omega)
            size = np.abs(values)
            with np.errstate(divide="ignore", invalid="ignore"):
                return _Determinant(values / size, np.log(size))
        at_once = max(1, MAX_ENTRIES // self.direct.size)
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
    infinity. `INFINITELY_MANY` stands for more than can be counted.

    Raises
    ------
    ArithmeticError
        A loop gain that is no number: none can be counted.

    """
    low, order, start = _low_end(batch)
    high = _high_end(batch)
    extra = [batch.resonances, batch.bends]
    omega, followed = _with_dead_time(batch, grid(low, high, POINTS_PER_DECADE, extra))
    rest = batch.rest(omega[-1:])[0]
    turned, lost, exhausted = _turns(batch, omega)
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
    count = np.where(lost, np.maximum(count, 1), count)
    unknown = lost & exhausted | ~np.array(followed)
    return np.where(unknown & (count > 0), INFINITELY_MANY, count)


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


def _high_end(batch: LoopBatch) -> float:
    """Return a frequency above which the loops are near their limits.

    (I + D)^-1 (L - D), D the direct part of L, is small there, or below one in its spectral radius
    where something passes on after a dead time.
    """
    omega = 1e3 * float(batch.bends[-1])
    before = math.inf
    for _ in range(30):
        rest = batch.rest(np.array([omega]))
        # No eigenvalue exceeds the sum of a row.
        size = float(np.abs(rest).sum(axis=-1).max())
        if size < SMALL or abs(size - before) < LEVEL * size:
            break
        omega, before = 10 * omega, size
    return omega


def _with_dead_time(
    batch: LoopBatch, omega: NDArray[np.float64]
) -> tuple[NDArray[np.float64], bool]:
    """Return `omega` with so many points that dead time turns det(I + L) little between them.

    And whether it has them: there may be too many. It ends where all that follows is calm: with the
    direct part D of L, the spectral radius of |(I + D)^-1 (L - D)| is below one, so that no
    eigenvalue can turn round zero, however often the dead time turns.
    """
    m = batch.direct.shape[-1]
    # A determinant has products of m elements; of the factors one has another's in its denominator.
    rate = (2 if batch.factors is not None else m) * batch.dead_time
    if not (rate * np.diff(omega) > LARGEST_TURN).any():
        return omega, True
    first = int(np.argmax(rate * np.diff(omega) > LARGEST_TURN))
    # Elements of several dead times add up otherwise from point to point: more are looked at.
    looks = omega[first:-1, None] + np.diff(omega[first:])[:, None] * np.arange(LOOKS) / LOOKS
    calm = np.asarray(_calm(batch, looks.ravel()).reshape(looks.shape).all(axis=1))
    calm[:-1] &= calm[1:]
    reaching = np.flatnonzero(~calm)
    if batch.factors is None:
        omega = omega[: first + 1 + (int(reaching[-1]) + 1 if reaching.size else 0)]
    turns = rate * np.diff(omega)
    followed = turns > LARGEST_TURN
    followed[first:] &= ~calm[: followed.size - first]
    counts = np.where(followed, np.ceil(turns / LARGEST_TURN), 1.0)
    if counts.sum() > max(FEWEST_FOLLOWED, MOST_FOLLOWED // batch.direct.size):
        return omega, False
    counts = counts.astype(int)
    start = np.repeat(omega[:-1], counts)
    step = np.repeat(np.diff(omega) / counts, counts)
    index = np.arange(start.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(start + index * step, omega[-1]), True


def _calm(batch: LoopBatch, omega: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether no eigenvalue of any loop, or factor, can turn round zero there, (k,)."""
    if batch.factors is not None:
        return np.asarray((np.abs(batch.factors(omega) - 1) < CALM).all(axis=(1, 2)))
    at_once = max(1, MAX_ENTRIES // batch.direct.size)
    found = np.empty(omega.size, dtype=bool)
    for first in range(0, omega.size, at_once):
        part = slice(first, first + at_once)
        found[part] = (_perron_bound(batch.rest(omega[part])) < CALM).all(axis=1)
    return found


def _perron_bound(L: NDArray[np.complexfloating]) -> NDArray[np.float64]:
    """Return a bound of the spectral radius of |L|, (k, loops), of matrices (k, loops, m, m).

    max_i (|L| x)_i / x_i for any x > 0 (L. Collatz, Math. Z. 48, 1942, 221-226).
    """
    size = np.abs(L)
    x = np.ones(size.shape[:-1])
    tiny = np.finfo(float).tiny
    for _ in range(PERRON_ROUNDS if size.shape[-1] > 1 else 1):
        image = np.einsum("...ij,...j->...i", size, x)
        bound = (image / x).max(axis=-1)
        mixed = x + image / np.maximum(bound[..., None], tiny)  # + x: a root of -1 would alternate
        x = mixed / mixed.max(axis=-1, keepdims=True)
    return np.asarray(bound)


def _determinant(L: NDArray[np.complex128]) -> _Determinant:
    """det(I + L) of each L (..., m, m)."""
    sign, log_size = np.linalg.slogdet(np.eye(L.shape[-1]) + L)
    return _Determinant(sign[..., None], log_size[..., None])


def _turns(
    batch: LoopBatch, omega: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], bool]:
    """Total turn of each argument over `omega`, refined, and where it passes through 0.

    The last: whether there was no room for more points, and some of the loops are given up.
    """
    values, log_size = batch.determinant(omega)
    lost: NDArray[np.bool_] = np.zeros(values.shape[1:], dtype=bool)
    # A determinant of many loops rises faster than each of them: a factor e for every four.
    size = 1 if batch.factors is not None else batch.direct.shape[-1]
    steep = max(1.0, 0.25 * size)
    most, exhausted = MAX_POINTS + 4 * omega.size, False
    while True:
        turn = np.angle(values[1:] * values[:-1].conj())
        coarse = (np.abs(turn) > LARGEST_TURN) | (np.abs(np.diff(log_size, axis=0)) > steep)
        coarse = coarse & ~lost
        middle = np.sqrt(omega[1:] * omega[:-1])
        # No room between two points, or for more of them: a zero on the axis.
        crowded = (middle <= omega[:-1]) | (middle >= omega[1:])
        lost |= coarse[crowded].any(axis=0)
        split = (coarse & ~lost).any(axis=(1, 2))
        if omega.size + np.count_nonzero(split) > most:
            lost |= coarse.any(axis=0)
            split, exhausted = np.zeros_like(split), True
        if not split.any():
            return turn.sum(axis=(0, 2)), np.asarray(lost.any(axis=1)), exhausted
        where = np.flatnonzero(split) + 1
        directions, sizes = batch.determinant(middle[split])
        values = np.insert(values, where, directions, axis=0)
        log_size = np.insert(log_size, where, sizes, axis=0)
        omega = np.insert(omega, where, middle[split])
