"""Which input should control which output: pairings ranked by relative gains.

The published rules: relative gains of the pairs positive and as near one as possible
(Bristol's rule, Astrom and Hagglund, section 11.2), a positive Niederlinski index (Niederlinski
1971), and gains within 0.67..1.5 if no decoupling is wanted.
"""

from __future__ import annotations

import heapq
import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.interaction.integral_controllability import (
    ControllabilityVerdict,
    integral_controllability,
    parallel_integral_controllability,
)
from solver.interaction.relative_gain import relative_gain_array
from solver.model.equality import ByValue
from solver.model.validation import square_matrix
from solver.stability.singular import equilibrate

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from solver.interaction.parallel_matrix import ParallelMatrix

__all__ = [
    "BAND",
    "EXHAUSTIVE_UP_TO",
    "Pairing",
    "PairingRanking",
    "niederlinski_index",
    "rank_pairings",
    "rank_parallel_pairings",
]

BAND = (0.67, 1.5)  # Astrom and Hagglund: decoupling can improve control outside it
EXHAUSTIVE_UP_TO = 8
KEPT = 120  # all pairings of 5 x 5, the best of larger plants
TESTED = 20  # pairings that pass all conditions on integral control; a page of them is enough

# A pair with a relative gain of zero or less outweighs any set of positive ones, whose
# |ln lambda| stays below 30 a pair (gains with a condition number above 1e13 are singular).
_REFUSED = 1000.0


@dataclass(frozen=True, eq=False)
class Pairing(ByValue):
    """One way of pairing.

    Attributes
    ----------
    inputs : tuple of int
        `inputs[r]` is the input that controls output r, counted from 0.
    relative_gains : (n,)
        Relative gains of the pairs.
    niederlinski_index : float
        Negative: with integral action in all loops the closed system is unstable, however the
        loops are tuned (stable plants). NaN where a pair has no gain.
    admissible : bool
        All relative gains and the index are positive.
    within_band : bool
        All relative gains lie in `BAND`.
    distance : float
        Sum over the pairs of |ln lambda|, zero without interaction: halving and doubling a
        gain count alike, as they do in `BAND`. A pair with lambda <= 0 adds more than 1000.
    integral_controllability : ControllabilityVerdict or None
        Whether loops so paired may be detuned or switched off in any order. None for plants that
        are not stable, since the conditions do not apply, and behind the first `TESTED` pairings
        that pass, for those of which only the minors were looked at.

    """

    inputs: tuple[int, ...]
    relative_gains: NDArray[np.float64]
    niederlinski_index: float
    admissible: bool
    within_band: bool
    distance: float
    integral_controllability: ControllabilityVerdict | None = None

    @property
    def sound(self) -> bool:
        """Whether it is admissible and not known to fail when loops are detuned or switched off."""
        return (
            self.admissible
            and self.integral_controllability is not ControllabilityVerdict.IMPOSSIBLE
        )


@dataclass(frozen=True)
class PairingRanking:
    """Pairings, best first: the sound ones, the other admissible ones, the rest; by distance.

    `examined` pairings were compared; `exhaustive` says whether these are all. `pairings` holds
    the best `KEPT` of them.
    """

    pairings: tuple[Pairing, ...]
    examined: int
    exhaustive: bool

    @property
    def recommended(self) -> Pairing | None:
        """The best sound pairing, or None where there is none among those examined."""
        best = self.pairings[0]
        return best if best.sound else None


def niederlinski_index(gain: NDArray[np.float64]) -> float:
    """Return det P(0) over the product of the diagonal elements; NaN where either is zero.

    Parameters
    ----------
    gain : (n, n)
        Static gain with the columns in the order of the pairing.

    Raises
    ------
    InvalidInputError
        Not a square matrix of finite numbers.

    """
    gain = square_matrix(gain)
    diagonal = np.diag(gain)
    sign, log_size = np.linalg.slogdet(gain)  # the products alone may overflow
    with np.errstate(divide="ignore"):
        log_product = float(np.sum(np.log(np.abs(diagonal))))
    return _index(float(sign * np.prod(np.sign(diagonal))), float(log_size) - log_product)


def rank_pairings(gain: NDArray[np.float64], *, stable: bool = True) -> PairingRanking:
    """Rank pairings: all of them up to n = 8, beyond that the `KEPT` nearest to no interaction.

    Of a stable plant every admissible one is tested for decentralised integral controllability.

    Beyond n = 8 the candidates come in order of distance from the assignment problem and its
    next best solutions (Murty 1968), so every pairing left out is at least as far from one.

    Parameters
    ----------
    gain : (n, n)
        Static gain, regular.
    stable : bool
        Whether the plant is stable.

    Raises
    ------
    InvalidInputError
        As `relative_gain_array`.

    """
    gain = square_matrix(gain)
    relative_gains = relative_gain_array(gain)
    n = len(gain)
    cost = _distance(relative_gains)
    exhaustive = n <= EXHAUSTIVE_UP_TO
    if exhaustive:
        candidates = np.array(list(itertools.permutations(range(n))), dtype=np.intp)
    else:
        candidates = np.array(list(itertools.islice(_assignments(cost), KEPT)), dtype=np.intp)
    rows = np.arange(n)
    distances = cost[rows, candidates].sum(axis=1)
    pair_gains = gain[rows, candidates]
    # Sign and size apart: the products of the gains of a large plant may overflow.
    sign, log_size = np.linalg.slogdet(gain)
    signs = sign * _parity(candidates) * np.prod(np.sign(pair_gains), axis=1)
    with np.errstate(divide="ignore"):
        log_products = np.log(np.abs(pair_gains)).sum(axis=1)
    all_positive = np.all(relative_gains[rows, candidates] > 0, axis=1)
    admissible = all_positive & (signs > 0)
    possible = admissible.copy()
    if stable:
        possible[admissible] = _minors_positive(gain, candidates[admissible])
    verdicts = _verdicts(gain, candidates, distances, possible) if stable else {}
    sound = possible.copy()
    sound[
        [index for index, each in verdicts.items() if each is ControllabilityVerdict.IMPOSSIBLE]
    ] = False
    order = np.lexsort((distances, ~admissible, ~sound))[:KEPT]
    failed = ControllabilityVerdict.IMPOSSIBLE if stable else None
    pairings = tuple(
        _pairing(
            tuple(int(c) for c in candidates[index]),
            relative_gains[rows, candidates[index]],
            _index(float(signs[index]), log_size - log_products[index]),
            float(distances[index]),
            verdicts.get(int(index), None if sound[index] else failed),
        )
        for index in order
    )
    return PairingRanking(pairings, len(candidates), exhaustive)


def rank_parallel_pairings(matrix: ParallelMatrix, *, stable: bool = True) -> PairingRanking:
    """Rank the pairings of n > `EXHAUSTIVE_UP_TO` identical units.

    The distance is linear in the number of units that keep their own input, and the parity of
    the permutation decides the sign of the index. So the best pairing is one of four: all keep
    their own, all but two that swap (the other parity), or none, with either parity.

    Parameters
    ----------
    matrix : ParallelMatrix
        Real and regular.
    stable : bool
        Whether the plant is stable. Then the patterns in which units leave their own input fail on
        a sub-system: two units that leave without swapping are not told apart, and of two that stay
        and two that swap the former need |a| < 1, the latter |a| > 1.

    """
    n = matrix.n
    own, other = float(np.real(matrix.own)), float(np.real(matrix.other))
    own_relative_gain = float(np.real(matrix.own_relative_gain))
    other_relative_gain = float(np.real(matrix.other_relative_gain))
    determinant = matrix.log_determinant
    cycle = -1.0 if n % 2 == 0 else 1.0  # parity of a cycle of n
    candidates = (
        (np.arange(n), 1.0),
        (np.array([1, 0, *range(2, n)]), -1.0),
        (np.array([*range(1, n), 0]), cycle),
        (np.array([1, 0, *range(3, n), 2]), -cycle),
    )
    pairings = []
    for inputs, parity in candidates:
        kept = inputs == np.arange(n)
        verdict = None
        if stable:
            verdict = (
                parallel_integral_controllability(matrix).verdict
                if kept.all()
                else ControllabilityVerdict.IMPOSSIBLE
            )
        gains = np.where(kept, own, other)
        relative_gains = np.where(kept, own_relative_gain, other_relative_gain)
        sign = float(np.real(determinant.phase)) * parity * float(np.prod(np.sign(gains)))
        with np.errstate(divide="ignore"):
            log_product = float(np.sum(np.log(np.abs(gains))))
        pairings.append(
            _pairing(
                tuple(int(c) for c in inputs),
                relative_gains,
                _index(float(np.sign(sign)), determinant.log_magnitude - log_product),
                float(_distance(relative_gains).sum()),
                verdict,
            )
        )
    pairings.sort(key=lambda pairing: (not pairing.sound, not pairing.admissible, pairing.distance))
    return PairingRanking(tuple(pairings), len(pairings), exhaustive=False)


def _pairing(
    inputs: tuple[int, ...],
    relative_gains: NDArray[np.float64],
    index: float,
    distance: float,
    verdict: ControllabilityVerdict | None,
) -> Pairing:
    return Pairing(
        inputs=inputs,
        relative_gains=relative_gains,
        niederlinski_index=index,
        admissible=bool(np.all(relative_gains > 0)) and index > 0,
        within_band=bool(np.all((relative_gains >= BAND[0]) & (relative_gains <= BAND[1]))),
        distance=distance,
        integral_controllability=verdict,
    )


def _verdicts(
    gain: NDArray[np.float64],
    candidates: NDArray[np.intp],
    distances: NDArray[np.float64],
    possible: NDArray[np.bool_],
) -> dict[int, ControllabilityVerdict]:
    """Test the possible candidates by rising distance, until `TESTED` have passed."""
    verdicts: dict[int, ControllabilityVerdict] = {}
    passed = 0
    for index in np.flatnonzero(possible)[np.argsort(distances[possible], kind="stable")]:
        verdict = integral_controllability(gain[:, candidates[index]]).verdict
        verdicts[int(index)] = verdict
        passed += verdict is not ControllabilityVerdict.IMPOSSIBLE
        if passed == TESTED:
            break
    return verdicts


def _minors_positive(gain: NDArray[np.float64], candidates: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether no principal minor of the paired gain, its diagonal made positive, is negative.

    (m,) for m candidates, all at once: a quotient of two such minors is a relative gain of a
    sub-system, so a negative one excludes the pairing.
    """
    n = len(gain)
    scaled = equilibrate(gain)
    alive = np.arange(len(candidates))
    for size in range(2, n + 1):
        for subset in itertools.combinations(range(n), size):
            if not alive.size:
                break
            rows = np.array(subset)
            chosen = candidates[alive][:, rows]
            part = scaled[rows[None, :, None], chosen[:, None, :]]
            turned = part * np.sign(np.diagonal(part, axis1=1, axis2=2))[:, None, :]
            alive = alive[np.linalg.slogdet(turned).sign >= 0]
    result = np.zeros(len(candidates), dtype=bool)
    result[alive] = True
    return result


def _index(sign: float, log_size: float) -> float:
    """Niederlinski index from sign and logarithm; NaN where a pair has no gain."""
    if sign == 0:
        return math.nan
    return sign * (math.exp(log_size) if log_size < math.log(np.finfo(float).max) else math.inf)


def _distance(relative_gains: NDArray[np.float64]) -> NDArray[np.float64]:
    positive = relative_gains > 0
    near_one = np.abs(np.log(np.where(positive, relative_gains, 1.0)))
    refused = _REFUSED + np.log1p(np.abs(relative_gains))
    return np.asarray(np.where(positive, near_one, refused), dtype=np.float64)


def _parity(permutations: NDArray[np.intp]) -> NDArray[np.float64]:
    """Sign of each permutation, (m,), by counting inversions."""
    n = permutations.shape[1]
    inversions = np.zeros(len(permutations), dtype=np.intp)
    for first in range(n):
        for second in range(first + 1, n):
            inversions += permutations[:, first] > permutations[:, second]
    return np.where(inversions % 2, -1.0, 1.0)


def _assignments(cost: NDArray[np.float64]) -> Iterator[tuple[int, ...]]:
    """Yield assignments row -> column by rising cost (Murty 1968)."""
    n = len(cost)
    barred = n * 1e6  # above any sum of costs

    def solve(banned: NDArray[np.bool_]) -> tuple[float, tuple[int, ...]]:
        rows, columns = scipy.optimize.linear_sum_assignment(np.where(banned, barred, cost))
        total = float(np.where(banned, barred, cost)[rows, columns].sum())
        return total, tuple(int(c) for c in columns)

    counter = itertools.count()  # breaks ties before the heap compares arrays
    nothing = np.zeros((n, n), dtype=bool)
    heap = [(*solve(nothing), next(counter), 0, nothing)]
    while heap:
        _, columns, _, fixed, banned = heapq.heappop(heap)
        yield columns
        # Split what is left by the first row that differs from this assignment.
        kept = banned.copy()
        for row in range(fixed, n - 1):
            child = kept.copy()
            child[row, columns[row]] = True
            total, solution = solve(child)
            if total < barred:
                heapq.heappush(heap, (total, solution, next(counter), row, child))
            kept[row, :] = True
            kept[row, columns[row]] = False
