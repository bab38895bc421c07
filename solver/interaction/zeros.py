"""Transmission zeros of a plant, and what those in the right half plane forbid.

Zeros of the Smith-McMillan form: Astrom and Hagglund, chapter 11, eq. 11.6, made exact where
zeros hide behind poles. A dead time that factors out by rows and columns changes nothing; other
dead times make the determinant transcendental, and its right-half-plane zeros are sought in a
box.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.dead_time_zeros import SumMatrix, right_half_plane_zeros, search_radius
from solver.interaction.near_cancellations import near_cancelling
from solver.interaction.rational_matrix import Rational, common_degree, transmission_zeros_of
from solver.model.plants import ParallelPlant, Plant
from solver.model.validation import instance

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.interaction.rational_matrix import Root
    from solver.model.transfer_function import TransferFunction

__all__ = [
    "Direction",
    "TransmissionZeros",
    "Zero",
    "ZeroMethod",
    "bandwidth_limit",
    "transmission_zeros",
]

MAX_EXACT_DEGREE = 80  # below a second of exact arithmetic
MAX_PEAK = 2.0  # M of the sensitivity for which bandwidth limits are quoted, as in SLH


class ZeroMethod(StrEnum):
    """How zeros were found.

    EXACT: all finite zeros, in rational arithmetic. SEARCH: those in the closed right half plane
    with magnitudes up to `searched_radius`; the others are not listed.
    """

    EXACT = "exact"
    SEARCH = "search"


class Direction(StrEnum):
    """What a zero belongs to: the whole plant, or a mode of identical parallel units."""

    PLANT = "plant"
    SUM = "sum"
    DIFFERENCES = "differences"


@dataclass(frozen=True)
class Zero:
    """A transmission zero.

    Attributes
    ----------
    value : complex
        Where it lies, 1 per time unit.
    multiplicity : int
        How often; a zero of the differences between n parallel units counts n - 1 times.
    direction : Direction
        What it belongs to.
    right_half_plane : bool
        Whether Re >= 0: it limits the bandwidth whatever controller is used.
    bandwidth_limit : float or None
        The limit, rad per time unit; None for a zero in the left half plane.
    near_cancellation : bool
        Whether it exists by rounding only: it is gone when poles of the elements that differ by
        less than a per cent are equal.

    """

    value: complex
    multiplicity: int
    direction: Direction
    right_half_plane: bool
    bandwidth_limit: float | None
    near_cancellation: bool = False


@dataclass(frozen=True)
class TransmissionZeros:
    """Zeros of a plant by rising magnitude; `method` says how they were found.

    `degenerate`: the determinant vanishes identically, so the outputs depend on each other at
    all frequencies and zeros have no meaning; `zeros` is empty. `searched_radius` (rad per time
    unit) is None where everything was exact.
    """

    zeros: tuple[Zero, ...]
    method: ZeroMethod
    degenerate: bool
    searched_radius: float | None

    @property
    def bandwidth_limit(self) -> float | None:
        """The tightest limit on the bandwidth of the worst direction; None without one."""
        limits = [zero.bandwidth_limit for zero in self.zeros if zero.bandwidth_limit is not None]
        return min(limits) if limits else None


def bandwidth_limit(zero: complex, max_peak: float = MAX_PEAK) -> float:
    """Return the greatest bandwidth omega_B that a right-half-plane zero permits.

    At the zero the sensitivity in the zero's output direction is 1, so by the maximum modulus
    principle `sigma_max(w_P S) < 1` needs |w_P(zero)| < 1. For w_P of SLH eq. 29 with A = 0 and
    omega_B = 1/(M tau_P) this is a bound on omega_B; for a real zero z it is z (M - 1)/M.

    Parameters
    ----------
    zero : complex
        Re >= 0.
    max_peak : float
        M > 1.

    Examples
    --------
    >>> bandwidth_limit(1 + 0j)
    0.5

    """
    # |zero tau + 1|^2 = M^2 tau^2 |zero|^2 solved for 1/tau.
    real = zero.real
    spread = (max_peak**2 - 1) * abs(zero) ** 2
    return (math.sqrt(real**2 + spread) - real) / max_peak


def transmission_zeros(plant: Plant) -> TransmissionZeros:
    """Return the transmission zeros of the plant.

    Identical parallel units of any number are split into their two modes first.

    Parameters
    ----------
    plant : Plant
        Any plant.

    Raises
    ------
    InvalidInputError
        No plant.

    """
    instance(plant, Plant, "/plant")
    if not isinstance(plant, ParallelPlant):
        rows: SumMatrix = [[(plant.element(r, c),) for c in range(plant.n)] for r in range(plant.n)]
        return _zeros_of_sums(rows, (1,), 1, Direction.PLANT)
    g, i = plant.process, plant.interaction
    if plant.n == 1:
        return _zeros_of_sums([[(g,)]], (1,), 1, Direction.PLANT)
    total = _zeros_of_sums([[(g, i)]], (1, plant.n - 1), 1, Direction.SUM)
    difference = _zeros_of_sums([[(g, i)]], (1, -1), plant.n - 1, Direction.DIFFERENCES)
    zeros = sorted((*total.zeros, *difference.zeros), key=_order)
    degenerate = total.degenerate or difference.degenerate
    radii = [part.searched_radius for part in (total, difference)]
    searched = [radius for radius in radii if radius is not None]
    return TransmissionZeros(
        zeros=() if degenerate else tuple(zeros),
        method=ZeroMethod.SEARCH if searched else ZeroMethod.EXACT,
        degenerate=degenerate,
        searched_radius=min(searched) if searched else None,
    )


def _zeros_of_sums(
    rows: SumMatrix, factors: tuple[int, ...], copies: int, direction: Direction
) -> TransmissionZeros:
    """Zeros of a matrix whose elements are sums of transfer functions times `factors`."""
    exact = [[_add(terms, factors, {}) for terms in row] for row in rows]
    doubtful: frozenset[int] = frozenset()
    if _dead_time_factors_out(rows) and common_degree(exact) <= MAX_EXACT_DEGREE:
        roots = transmission_zeros_of(exact)
        method, radius = ZeroMethod.EXACT, None
        doubtful = near_cancelling(
            (term for row in rows for terms in row for term in terms),
            roots or (),
            lambda joined: transmission_zeros_of(
                [[_add(terms, factors, joined) for terms in row] for row in rows]
            ),
        )
    else:
        radius = search_radius(rows)
        roots = right_half_plane_zeros(rows, factors, radius)
        method = ZeroMethod.SEARCH
    zeros = tuple(
        _zero(root, copies, direction, index in doubtful) for index, root in enumerate(roots or ())
    )
    return TransmissionZeros(tuple(sorted(zeros, key=_order)), method, roots is None, radius)


def _add(
    terms: tuple[TransferFunction, ...],
    factors: tuple[int, ...],
    joined: Mapping[TransferFunction, Rational],
) -> Rational:
    """Add terms times factors, those that are in `joined` as they stand there."""
    total, *others = (
        (joined.get(term) or Rational.from_transfer_function(term)).scaled(factor)
        for term, factor in zip(terms, factors, strict=True)
    )
    for other in others:
        total = total + other
    return total


def _zero(root: Root, copies: int, direction: Direction, doubtful: bool) -> Zero:  # noqa: FBT001
    value = root.value
    if abs(value.real) <= 1e-12 * abs(value):  # on the axis but for rounding
        value = complex(0.0, value.imag)
    right = value.real >= 0
    limit = bandwidth_limit(value) if right else None
    return Zero(value, root.multiplicity * copies, direction, right, limit, doubtful)


def _order(zero: Zero) -> tuple[float, float]:
    return abs(zero.value), zero.value.imag


def _dead_time_factors_out(rows: SumMatrix) -> bool:
    """Whether every present element's dead time is a row's share plus a column's share."""
    n = len(rows)
    equations, times = [], []
    for row, column in itertools.product(range(n), repeat=2):
        for term in rows[row][column]:
            if not term.is_zero:
                equation = np.zeros(2 * n)
                equation[[row, n + column]] = 1
                equations.append(equation)
                times.append(term.dead_time)
    if not any(times):
        return True
    shares = np.linalg.lstsq(np.array(equations), np.array(times))[0]
    error = np.max(np.abs(np.array(equations) @ shares - times))
    return bool(error <= 1e-9 * max(times))  # rounding of the shares
