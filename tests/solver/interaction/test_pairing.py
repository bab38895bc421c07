"""Pairing: published recommendations, exhaustive against assignment, invariants."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from solver.interaction.integral_controllability import (
    ControllabilityVerdict,
    integral_controllability,
)
from solver.interaction.pairing import (
    KEPT,
    _assignments,
    niederlinski_index,
    rank_pairings,
    rank_parallel_pairings,
)
from solver.interaction.parallel_matrix import ParallelMatrix


def test_example_11_2_swaps_the_inputs() -> None:
    """Astrom and Hagglund, Example 11.2: y1 should be paired with u2."""
    ranking = rank_pairings(np.array([[1.0, 2.0], [1.0, 1.0]]))
    best = ranking.recommended
    assert best is not None
    assert best.inputs == (1, 0)
    np.testing.assert_allclose(best.relative_gains, [2, 2])
    assert best.niederlinski_index == pytest.approx(0.5)
    assert not best.within_band
    worst = ranking.pairings[-1]
    assert worst.inputs == (0, 1)
    assert worst.niederlinski_index == pytest.approx(-1)


def test_example_11_3_keeps_the_inputs() -> None:
    """Astrom and Hagglund, Example 11.3: y1 with u1; index 3 calls for decoupling."""
    best = rank_pairings(np.array([[1.0, 2 / 3], [1.0, 1.0]])).recommended
    assert best is not None
    assert best.inputs == (0, 1)
    assert not best.within_band


@pytest.mark.parametrize(("share", "inputs"), [(0.7, (0, 1)), (0.3, (1, 0))])
def test_blending_pairs_the_larger_stream_with_the_flow(
    share: float, inputs: tuple[int, int]
) -> None:
    """Smith and Corripio, section 9-1: total flow with the larger stream; here x1=1, x2=0."""
    gain = np.array([[1.0, 1.0], [1 - share, -share]])  # d(W, W x)/d(W1, W2) at W = 1
    best = rank_pairings(gain).recommended
    assert best is not None
    assert best.inputs == inputs
    np.testing.assert_allclose(best.relative_gains, max(share, 1 - share))


@given(n=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_ranking_is_what_the_definitions_say(n: int, seed: int) -> None:
    """Each pairing carries the Niederlinski index of the permuted gain; the order is right."""
    P = np.random.default_rng(seed).normal(size=(n, n))
    ranking = rank_pairings(P)
    assert ranking.exhaustive
    assert ranking.examined == math.factorial(n)
    assert len(ranking.pairings) == min(KEPT, ranking.examined)
    keys = [(not p.sound, not p.admissible, p.distance) for p in ranking.pairings]
    assert keys == sorted(keys)
    for pairing in ranking.pairings[:20]:
        permuted = P[:, pairing.inputs]
        assert pairing.niederlinski_index == pytest.approx(niederlinski_index(permuted), rel=1e-9)


def test_triangular_plant_pairs_the_diagonal() -> None:
    """One-way interaction leaves the relative gains at one; zero gains are never paired."""
    ranking = rank_pairings(np.array([[1.0, 0.0], [5.0, 2.0]]))
    assert ranking.pairings[0].distance == pytest.approx(0, abs=1e-15)
    assert ranking.pairings[0].within_band
    assert math.isnan(ranking.pairings[1].niederlinski_index)
    assert not ranking.pairings[1].admissible
    assert math.isnan(niederlinski_index(np.array([[0.0, 1.0], [1.0, 0.0]])))


@given(n=st.integers(1, 5), seed=st.integers(0, 2**32 - 1))
def test_assignments_come_in_order_and_completely(n: int, seed: int) -> None:
    """Murty's enumeration yields every permutation once, by rising cost."""
    cost = np.random.default_rng(seed).uniform(0, 5, (n, n))
    found = list(_assignments(cost))
    costs = [cost[range(n), columns].sum() for columns in found]
    assert sorted(found) == sorted(itertools.permutations(range(n)))
    np.testing.assert_allclose(costs, sorted(costs))


@given(n=st.integers(2, 4), seed=st.integers(0, 2**32 - 1))
@example(n=5, seed=0)
@example(n=5, seed=6)
@settings(max_examples=25)
def test_recommended_pairing_is_integral_controllable(n: int, seed: int) -> None:
    """The recommended pairing passes all conditions; where none is, each admissible one fails."""
    P = np.random.default_rng(seed).normal(size=(n, n))
    ranking = rank_pairings(P)
    every = {
        inputs: integral_controllability(P[:, inputs]).verdict
        for inputs in itertools.permutations(range(n))
    }
    sound = [
        inputs
        for inputs, verdict in every.items()
        if verdict is not ControllabilityVerdict.IMPOSSIBLE
    ]
    if ranking.recommended is None:
        assert not sound
        return
    best = ranking.recommended
    assert best.integral_controllability is every[best.inputs]
    assert best.inputs in sound
    # No nearer one is sound: the others further up would have been taken.
    distances = {p.inputs: p.distance for p in ranking.pairings}
    assert min(distances.get(inputs, math.inf) for inputs in sound) == best.distance


@pytest.mark.parametrize(("a", "some"), [(-0.5, False), (-0.9, True), (1.5, False), (-1.5, True)])
def test_parallel_plants_outside_the_limits(a: float, some: bool) -> None:
    """Four units outside -1/3 < a < 1: no pairing is recommended that is not sound."""
    P = np.full((4, 4), a) + (1 - a) * np.eye(4)
    sound = [
        inputs
        for inputs in itertools.permutations(range(4))
        if integral_controllability(P[:, inputs]).verdict is not ControllabilityVerdict.IMPOSSIBLE
    ]
    assert bool(sound) is some
    best = rank_pairings(P).recommended
    assert (best is not None) is some
    assert best is None or best.inputs in sound


def test_large_plant_by_assignment() -> None:
    """A hidden permutation of a diagonally dominant 9 x 9 plant is found."""
    rng = np.random.default_rng(3)
    hidden = rng.permutation(9)
    P = rng.uniform(-0.05, 0.05, (9, 9))
    P[np.arange(9), hidden] += np.where(rng.uniform(size=9) < 0.5, -1.0, 1.0)
    ranking = rank_pairings(P)
    assert not ranking.exhaustive
    assert ranking.examined == KEPT
    best = ranking.recommended
    assert best is not None
    assert best.inputs == tuple(hidden)
    assert best.within_band


@pytest.mark.parametrize("a", [0.949, -0.1, 0.0])
def test_parallel_units_keep_their_own_inputs(a: float) -> None:
    """Within decentralised integral controllability the own pairing is the admissible one."""
    best = rank_parallel_pairings(ParallelMatrix(9, 2.0, 2.0 * a)).recommended
    assert best is not None
    assert best.inputs == tuple(range(9))


@pytest.mark.parametrize("n", [9, 10])
@pytest.mark.parametrize("other", [1.5, -1.5, 7.0, -0.3])
def test_parallel_candidates_agree_with_the_dense_matrix(n: int, other: float) -> None:
    """The four patterns carry the index of the permuted dense gain and its relative gains."""
    matrix = ParallelMatrix(n, 1.0, other)
    dense = np.asarray(matrix.dense(), dtype=float)
    ranking = rank_parallel_pairings(matrix)
    assert len({p.inputs for p in ranking.pairings}) == 4
    for pairing in ranking.pairings:
        permuted = dense[:, pairing.inputs]
        assert pairing.niederlinski_index == pytest.approx(niederlinski_index(permuted), rel=1e-9)
        expected = np.diag(permuted * np.linalg.inv(permuted).T)
        np.testing.assert_allclose(pairing.relative_gains, expected, rtol=1e-9)


@pytest.mark.parametrize("n", [4, 5, 6])
@pytest.mark.parametrize("other", [0.5, 1.5, -1.5, 7.0, -0.3])
def test_four_candidates_stand_for_all_pairings(n: int, other: float) -> None:
    """The best of the four is as good as the best of all n!."""
    matrix = ParallelMatrix(n, 1.0, other)
    few = rank_parallel_pairings(matrix, stable=False).pairings[0]
    every = rank_pairings(np.asarray(matrix.dense(), dtype=float), stable=False).pairings[0]
    assert few.admissible is every.admissible
    assert few.distance == pytest.approx(every.distance, rel=1e-9)


def test_ten_thousand_units_do_not_overflow() -> None:
    """The index of a very large plant is finite or honestly infinite, with the right sign."""
    best = rank_parallel_pairings(ParallelMatrix(10_000, 1e6, 0.9e6)).pairings[0]
    assert best.inputs[:3] == (0, 1, 2)
    assert best.admissible is (best.niederlinski_index > 0)
