"""Decentralised integral controllability (DIC): loops detuned or switched off one by one.

A stable plant is DIC if some diagonal controller with integral action in every loop is stable
and stays so while the gains are reduced independently by any factors in [0, 1]. Necessary
conditions on the static gain: Skogestad, Lundstrom and Hovd (1989), section 4.1, after Skogestad
and Morari (1988). Sufficient condition: a diagonal D > 0 with D G+ + G+^T D > 0 (proof in
docs/interaction.md). For parallel plants the two meet: DIC exactly for -1/(n-1) < a < 1.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.interaction.gain_ratios import unstable_speeds
from solver.model.validation import square_matrix
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.interaction.parallel_matrix import ParallelMatrix

__all__ = [
    "ControllabilityVerdict",
    "IntegralControllability",
    "integral_controllability",
    "parallel_integral_controllability",
]

# An eigenvalue below this, relative to the gain, is zero but for rounding.
_ZERO = 1e-12


class ControllabilityVerdict(StrEnum):
    """Whether the plant, as paired, is decentralised integral controllable.

    GUARANTEED: proven. IMPOSSIBLE: disproven; see `reasons`; try another pairing. UNDECIDED: the
    necessary conditions hold, the sufficient one does not, and no unstable reduction was found.
    """

    GUARANTEED = "guaranteed"
    IMPOSSIBLE = "impossible"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class IntegralControllability:
    """Outcome of the conditions.

    Attributes
    ----------
    verdict : ControllabilityVerdict
        What they say together.
    reasons : tuple of str
        Each necessary condition that fails, in words.
    failing_subsets : tuple of tuple of int
        The smallest sets of loops (from 0) whose own plant fails, the full set included; of an
        unstable reduction, the set that it needs.
    smallest_eigenvalue : float
        Least real part of the eigenvalues of G+(0), the gain with the signs of the inputs
        turned so that the diagonal is positive.
    scaling : (n,) or None
        Diagonal of D that proves the sufficient condition, where found.
    lower_limit, upper_limit : float or None
        For a parallel plant, the open interval of the interaction a in which it is DIC.

    """

    verdict: ControllabilityVerdict
    reasons: tuple[str, ...]
    failing_subsets: tuple[tuple[int, ...], ...]
    smallest_eigenvalue: float
    scaling: NDArray[np.float64] | None = None
    lower_limit: float | None = None
    upper_limit: float | None = None


def integral_controllability(gain: NDArray[np.float64]) -> IntegralControllability:
    """Test a static gain as paired (loop r connects output r to input r).

    The relative-gain condition on all sub-systems says that every principal minor of G+ is
    positive (a relative gain is a quotient of two of them), so the minors are tested; 2^n of
    them, n <= 10. The eigenvalue condition is tested on the same sub-systems.

    Parameters
    ----------
    gain : (n, n)
        Static gain of a stable plant, finite.

    """
    gain = square_matrix(gain)
    n = len(gain)
    diagonal = np.diag(gain)
    if np.any(diagonal == 0):
        dead = tuple((int(loop),) for loop in np.flatnonzero(diagonal == 0))
        names = ", ".join(str(loop + 1) for (loop,) in dead)
        reason = f"no gain from input to output in loop {names}"
        return IntegralControllability(ControllabilityVerdict.IMPOSSIBLE, (reason,), dead, 0.0)
    positive = gain * np.sign(diagonal)
    smallest = float(np.min(np.linalg.eigvals(positive).real))
    failing: list[tuple[int, ...]] = []
    reasons: list[str] = []
    for size in range(2, n + 1):
        for subset in itertools.combinations(range(n), size):
            if any(set(smaller) <= set(subset) for smaller in failing):
                continue
            failure = _failure(positive[np.ix_(subset, subset)])
            if failure is not None:
                failing.append(subset)
                names = ", ".join(str(loop + 1) for loop in subset)
                reasons.append(f"loops {names}: {failure}")
    if failing:
        return IntegralControllability(
            ControllabilityVerdict.IMPOSSIBLE, tuple(reasons), tuple(failing), smallest
        )
    scaling = _diagonal_proof(positive)
    if scaling is not None:
        verdict = ControllabilityVerdict.GUARANTEED
        return IntegralControllability(verdict, (), (), smallest, scaling)
    speeds = unstable_speeds(positive)
    if speeds is None:
        return IntegralControllability(ControllabilityVerdict.UNDECIDED, (), (), smallest)
    acting = tuple(np.flatnonzero(speeds).tolist())
    names = ", ".join(str(loop + 1) for loop in acting)
    shown = " : ".join(f"{speeds[loop]:.3g}" for loop in acting)
    reason = (
        f"loops {names}: slow integral action is unstable where the products of integral gain and "
        f"own static gain are as {shown}, which other gains become when they are reduced"
    )
    return IntegralControllability(
        ControllabilityVerdict.IMPOSSIBLE, (reason,), (acting,), smallest
    )


def parallel_integral_controllability(matrix: ParallelMatrix) -> IntegralControllability:
    """Test the static gain of n identical units, any n, in closed form (SLH eqs. 22 to 24).

    Within -1/(n-1) < a < 1 the matrix G+ is symmetric and positive definite, which proves DIC:
    SLH left the sufficiency open.

    Parameters
    ----------
    matrix : ParallelMatrix
        Static gain, real.

    """
    n, own, other = matrix.n, float(np.real(matrix.own)), float(np.real(matrix.other))
    if own == 0:
        reason = "no gain from input to output in any loop"
        return IntegralControllability(ControllabilityVerdict.IMPOSSIBLE, (reason,), ((0,),), 0.0)
    if n == 1:
        return IntegralControllability(
            ControllabilityVerdict.GUARANTEED, (), (), abs(own), np.ones(1), None, None
        )
    a = other / own
    lower = -1 / (n - 1)
    smallest = min(1 - a, 1 + (n - 1) * a) * abs(own)
    if lower < a < 1:
        return IntegralControllability(
            ControllabilityVerdict.GUARANTEED, (), (), smallest, np.ones(n), lower, 1.0
        )
    failing: tuple[int, ...] = (0, 1)
    if a == 1:
        reason = (
            "the interaction a is 1: no two units can be told apart, one controller must drive "
            "them all"
        )
    elif a > 1:
        reason = (
            f"the interaction a = {a:.6g} is above 1: each input moves the other outputs more than "
            "its own, so the differences between units go the wrong way, which units that split a "
            "stream or share a feed do not; check the model, or pair the loops anew"
        )
    else:
        # The sub-system of m units has the lower limit -1/(m-1): the smallest m that fails.
        count = next(m for m in range(2, n + 1) if 1 + (m - 1) * a <= 0)
        failing = tuple(range(count))
        reason = (
            f"the interaction a = {a:.6g} is not above -1/(n-1) = {lower:.6g}: "
            "the sum of the outputs goes the wrong way, which is physically impossible for a split "
            "of one stream; check the model, or pair the loops anew"
        )
    return IntegralControllability(
        ControllabilityVerdict.IMPOSSIBLE, (reason,), (failing,), smallest, None, lower, 1.0
    )


def _unit_diagonal(positive: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale rows and columns alike to a unit diagonal; minors keep their signs."""
    root = np.sqrt(np.diag(positive))
    return positive / root[:, None] / root[None, :]


def _failure(gain: NDArray[np.float64]) -> str | None:
    """Return the necessary condition that a sub-system fails, its own sub-systems being sound.

    `gain` has a positive diagonal.
    """
    if is_singular(gain):
        return "the static gain is singular"
    if np.linalg.slogdet(_unit_diagonal(gain)).sign < 0:
        return "negative relative gains and a negative Niederlinski index"
    smallest = float(np.min(np.linalg.eigvals(gain).real))
    if smallest < -_ZERO * float(np.linalg.norm(gain)):
        return f"an eigenvalue of the static gain has real part {smallest:.6g}"
    return None


def _diagonal_proof(positive: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return d > 0 with diag(d) G + G^T diag(d) > 0, or None where there is none.

    The smallest eigenvalue is concave in d; Kelley's cutting planes find d or a combination of
    cuts that excludes every d. The answer is checked by its eigenvalues.
    """
    from scipy.optimize import linprog  # noqa: PLC0415 - a tuning need not wait for it

    n = len(positive)
    # Units of outputs and inputs only move D: with rows over their diagonal and then a similarity,
    # positive = Lambda T G T^-1, D serves `positive` where T^2 Lambda D serves G.
    own = np.diag(positive)
    G, (unit, _) = scipy.linalg.matrix_balance(
        positive / own[:, None], permute=False, separate=True
    )
    G = G / np.linalg.norm(G, 2)
    d = np.full(n, 1.0 / n)
    cuts: list[NDArray[np.float64]] = []
    best, best_value = d, -np.inf
    for _ in range(50 * n):
        M = d[:, None] * G
        values, vectors = np.linalg.eigh(M + M.T)
        if values[0] > best_value:
            best, best_value = d, float(values[0])
        # v^T (D G + G^T D) v = 2 sum_i d_i v_i (G v)_i is linear in d.
        cuts.extend(2 * v * (G @ v) for v in vectors.T[values <= values[0] + 0.1 * abs(values[0])])
        # Maximise t: t <= cut . d for all cuts, sum d = 1, d >= 1e-9 (D must stay regular).
        solution = linprog(
            c=np.append(np.zeros(n), -1.0),
            A_ub=np.column_stack([-np.array(cuts), np.ones(len(cuts))]),
            b_ub=np.zeros(len(cuts)),
            A_eq=np.append(np.ones(n), 0.0)[None, :],
            b_eq=[1.0],
            bounds=[(1e-9, 1.0)] * n + [(None, None)],
        )
        bound = np.asarray(solution.x)[-1] if solution.success else 0.0
        if bound <= _ZERO or best_value >= 0.5 * bound:  # a proof far from rounding is enough
            break
        d = np.asarray(solution.x)[:-1]
    if best_value <= _ZERO:
        return None
    scaling = best / (np.asarray(unit) ** 2 * own)
    return np.asarray(scaling / scaling.sum(), dtype=np.float64)
