"""DIC: limits of the parallel plant, subsets, the sufficient condition and what it promises."""

import itertools
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from solver.interaction.integral_controllability import (
    ControllabilityVerdict,
    integral_controllability,
    parallel_integral_controllability,
)
from solver.interaction.parallel_matrix import ParallelMatrix


@pytest.mark.parametrize("n", range(2, 9))
def test_limits_of_the_parallel_plant_are_eq_24(n: int) -> None:
    """Just inside -1/(n-1) < a < 1 the plant is DIC, just outside and at the limits it is not."""
    lower = -1 / (n - 1)
    for a, expected in (
        (lower + 1e-6, ControllabilityVerdict.GUARANTEED),
        (0.0, ControllabilityVerdict.GUARANTEED),
        (1 - 1e-6, ControllabilityVerdict.GUARANTEED),
        (lower - 1e-6, ControllabilityVerdict.IMPOSSIBLE),
        (1 + 1e-6, ControllabilityVerdict.IMPOSSIBLE),
        (1.0, ControllabilityVerdict.IMPOSSIBLE),
    ):
        matrix = ParallelMatrix(n, -3.0, -3.0 * a)
        closed = parallel_integral_controllability(matrix)
        dense = integral_controllability(np.asarray(matrix.dense()))
        assert closed.verdict is expected
        assert dense.verdict is expected
        assert closed.smallest_eigenvalue == pytest.approx(dense.smallest_eigenvalue, abs=1e-12)
        assert (closed.lower_limit, closed.upper_limit) == (lower, 1)


def test_negative_relative_gains_are_eq_22() -> None:
    """SLH eq. 22: the diagonal relative gain is negative there, and DIC fails."""
    for a in (-0.6, -0.9, 1.5):  # n = 3: -1/(n-2) = -1 < a < -1/2 or a > 1
        matrix = ParallelMatrix(3, 1.0, a)
        assert np.real(matrix.own_relative_gain) < 0
    assert np.real(ParallelMatrix(3, 1.0, -1.1).own_relative_gain) > 0
    assert np.real(ParallelMatrix(3, 1.0, -0.4).own_relative_gain) > 0


def test_subsets_of_a_parallel_plant() -> None:
    """At a = -0.4 two or three units are DIC together, four are not (limit -1/3)."""
    closed = parallel_integral_controllability(ParallelMatrix(6, 1.0, -0.4))
    assert closed.failing_subsets == ((0, 1, 2, 3),)
    dense = integral_controllability(np.asarray(ParallelMatrix(6, 1.0, -0.4).dense()))
    assert dense.failing_subsets == tuple(itertools.combinations(range(6), 4))


def test_own_gain_of_zero() -> None:
    """A loop whose input does not reach its output cannot have integral action."""
    assert parallel_integral_controllability(ParallelMatrix(3, 0.0, 1.0)).failing_subsets == ((0,),)
    result = integral_controllability(np.array([[1.0, 2.0], [3.0, 0.0]]))
    assert result.verdict is ControllabilityVerdict.IMPOSSIBLE
    assert result.failing_subsets == ((1,),)


def test_one_loop() -> None:
    """A single loop with gain is DIC, with either sign."""
    for gain in (2.0, -2.0):
        assert parallel_integral_controllability(ParallelMatrix(1, gain, 0.0)).verdict is (
            ControllabilityVerdict.GUARANTEED
        )
        assert (
            integral_controllability(np.array([[gain]])).verdict
            is ControllabilityVerdict.GUARANTEED
        )


def test_example_11_1_as_numbered_is_impossible() -> None:
    """Astrom and Hagglund, Example 11.1: index -1, so no DIC; swapped, DIC is proven."""
    result = integral_controllability(np.array([[1.0, 2.0], [1.0, 1.0]]))
    assert result.verdict is ControllabilityVerdict.IMPOSSIBLE
    assert "Niederlinski" in result.reasons[0]
    assert integral_controllability(np.array([[2.0, 1.0], [1.0, 1.0]])).verdict is (
        ControllabilityVerdict.GUARANTEED
    )


def test_eigenvalue_condition_sees_more_than_relative_gains() -> None:
    """A cyclic gain with positive minors and eigenvalues in the left half plane fails."""
    gain = np.array([[1.0, 3.0, 0.0], [0.0, 1.0, 3.0], [3.0, 0.0, 1.0]])
    result = integral_controllability(gain)
    assert result.verdict is ControllabilityVerdict.IMPOSSIBLE
    assert result.failing_subsets == ((0, 1, 2),)
    assert "eigenvalue" in result.reasons[0]
    assert result.smallest_eigenvalue == pytest.approx(-0.5)


def _least_routh(positive: np.ndarray) -> float:
    """Return the infimum over d > 0 of (E1 E2 - E3)/(d1 d2 d3) of diag(d) G for n = 3.

    Routh's condition: negative means unstable. E1 E2/(d1 d2 d3) is convex in log d.
    """
    own = np.diag(positive)
    minor = np.outer(own, own) - positive * positive.T
    others = [(i, j, 3 - i - j) for i in range(3) for j in range(3) if i != j]
    constant = sum(own[i] * minor[j, k] for i, j, k in others) / 2
    found = minimize(
        lambda y: sum(own[i] * minor[i, j] * np.exp(y[i] - y[k]) for i, j, k in others),
        np.zeros(3),
    )
    return float(constant + found.fun - np.linalg.det(positive))


@pytest.mark.parametrize(
    ("gain", "refuted"),
    [
        ([[1.8, 2.1, -0.3], [2.7, -0.3, 0.7], [1.8, 0.2, -0.5]], True),
        ([[-0.8, 3.0, 0.5], [-0.8, -1.3, 2.5], [1.7, 0.0, 0.8]], True),
        ([[0.2, 0.2, 0.5], [1.7, -0.8, 0.0], [-0.7, -1.2, 0.3]], True),
        ([[-0.8, -1.2, -1.4], [0.8, -0.3, 0.1], [0.3, 0.5, 0.6]], False),
        ([[0.1, 1.0, 0.4], [-0.5, 1.5, -0.6], [0.2, 2.4, 0.9]], False),
    ],
)
@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e4, 1.0, 1e-5)])
def test_gains_between_the_conditions_are_refuted_where_a_reduction_is_unstable(
    gain: list[list[float]], units: tuple[float, ...], *, refuted: bool
) -> None:
    """Exactly where Routh's condition fails for some ratio; the ratios that are told show it."""
    numbers = np.array(gain) * np.array(units)[:, None] / np.array(units[::-1])
    positive = numbers * np.sign(np.diag(numbers))
    result = integral_controllability(numbers)
    assert result.scaling is None
    assert (_least_routh(np.array(gain) * np.sign(np.diag(gain))) < 0) is refuted
    if not refuted:
        assert result.verdict is ControllabilityVerdict.UNDECIDED
        return
    assert result.verdict is ControllabilityVerdict.IMPOSSIBLE
    assert result.failing_subsets == ((0, 1, 2),)
    told = re.search(r"are as (.*), which", result.reasons[0])
    assert told is not None
    speeds = np.array([float(each) for each in told[1].split(" : ")])
    assert np.linalg.eigvals((speeds / np.diag(positive))[:, None] * positive).real.min() < 0


def test_a_loop_that_does_not_matter_is_no_part_of_an_unstable_reduction() -> None:
    """Three loops of four fail, beside one without interaction."""
    gain = np.eye(4)
    gain[:3, :3] = [[1.8, 2.1, -0.3], [2.7, -0.3, 0.7], [1.8, 0.2, -0.5]]
    assert integral_controllability(gain).failing_subsets == ((0, 1, 2),)


@given(n=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_proof_exists_where_one_was_built_in(n: int, seed: int) -> None:
    """G = D^-1 (positive definite + skew) is DIC by construction; the proof found is checked."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    skew = rng.normal(size=(n, n))
    core = A @ A.T + 0.1 * np.eye(n) + skew - skew.T
    gain = core / 10 ** rng.uniform(-1, 1, n)[:, None] * np.where(rng.uniform(size=n) < 0.5, -1, 1)
    result = integral_controllability(gain)
    assert result.verdict is ControllabilityVerdict.GUARANTEED
    positive = gain * np.sign(np.diag(gain))
    assert result.scaling is not None
    DG = result.scaling[:, None] * positive
    assert np.min(np.linalg.eigvalsh(DG + DG.T)) > 0
    assert np.all(result.scaling > 0)


@given(n=st.integers(2, 4), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_verdicts_agree_with_slow_integrators(n: int, seed: int) -> None:
    """Guaranteed: slow integral control is stable for all gain ratios. Impossible: not for all.

    Slow modes of u' = -K G u are the eigenvalues of -K G.
    """
    rng = np.random.default_rng(seed)
    gain = rng.normal(size=(n, n)) + 1.2 * np.eye(n)
    result = integral_controllability(gain)
    positive = gain * np.sign(np.diag(gain))

    def slowest(K: np.ndarray) -> float:
        return float(np.min(np.linalg.eigvals(K[:, None] * positive).real))

    if result.verdict is ControllabilityVerdict.GUARANTEED:
        for _ in range(50):
            assert slowest(10 ** rng.uniform(-3, 3, n)) > 0
    if result.verdict is ControllabilityVerdict.IMPOSSIBLE:
        for subset in result.failing_subsets:
            part = positive[np.ix_(subset, subset)]
            assert np.min(np.linalg.eigvals(part).real) <= 0 or np.linalg.det(part) <= 0
