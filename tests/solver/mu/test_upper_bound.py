import numpy as np
import pytest
from ctrlsys import ab13md
from hypothesis import given, settings
from hypothesis import strategies as st
from zoo import ZOO

from solver.model.blocks import group_loops
from solver.model.errors import InvalidInputError
from solver.mu import sdp
from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure, bound_of_scales
from solver.robustness.curves import LoopAnalysis

EXTREMES = np.array([1e-6, 1e-3, 0.02, 0.3, 1.5, 1e2, 1e6])


def slicot(N, structure):
    """AB13MD of SLICOT, an independent implementation (one D-scale per scalar block only)."""
    n = len(structure.scales)
    sizes = np.array([1] * n + [structure.performance] * bool(structure.performance), np.int32)
    kinds = np.full(sizes.size, 2, np.int32)
    return np.array([ab13md(matrix, sizes, kinds)[0] for matrix in N])


@st.composite
def random_matrices(draw):
    """Complex matrices with rows of very different size, and a structure for them."""
    n, performance = draw(st.integers(1, 5)), draw(st.integers(0, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    p = n + performance
    N = rng.normal(size=(2, p, p)) + 1j * rng.normal(size=(2, p, p))
    N *= np.exp(draw(st.floats(0, 3)) * rng.normal(size=(2, p, 1)))
    return N, BlockStructure(tuple(range(n)), performance)


@settings(max_examples=60, deadline=None)
@given(random_matrices())
def test_fast_path_equals_the_sdp_and_slicot(problem):
    """Three ways agree to 1e-6 on random matrices, and the fast path is never the worse by more
    than 1e-8.
    """
    N, structure = problem
    fast = upper_bound(N, structure).mu
    reference = np.minimum(sdp.upper_bound(N, structure).mu, slicot(N, structure))
    assert fast == pytest.approx(reference, rel=1e-6)
    assert (fast <= reference * (1 + 1e-8)).all()


@pytest.mark.parametrize("case", ZOO, ids=str)
def test_fast_path_equals_the_sdp_on_the_zoo(case):
    """On every plant's N_RP, from 1e-6 to 1e6 rad, the two bounds agree to 1e-6."""
    blocks, controllers = group_loops(case.plant, case.loops, case.uncertainty)
    analysis = LoopAnalysis(blocks, controllers, case.uncertainty, case.performance)
    for block, N in zip(blocks.blocks, analysis.matrices(EXTREMES), strict=True):
        used = sorted(set(block.scales))
        structure = BlockStructure(tuple(used.index(s) for s in block.scales), block.size)
        fast, reference = upper_bound(N, structure).mu, sdp.upper_bound(N, structure).mu
        assert fast == pytest.approx(reference, rel=1e-6)


@settings(max_examples=40, deadline=None)
@given(random_matrices(), st.integers(0, 2**32 - 1))
def test_bound_has_the_invariants_of_mu(problem, seed):
    """rho <= bound <= sigma_max; D-scaling and the order of the scalars change nothing."""
    N, structure = problem
    rng = np.random.default_rng(seed)
    mu = upper_bound(N, structure).mu
    assert (np.abs(np.linalg.eigvals(N)).max(axis=1) <= mu * (1 + 1e-9)).all()
    assert (mu <= np.linalg.norm(N, 2, axis=(1, 2)) * (1 + 1e-9)).all()
    D = structure.diagonal(np.exp(rng.normal(size=(2, structure.n_scales))))
    assert upper_bound(D[:, :, None] * N / D[:, None, :], structure).mu == pytest.approx(
        mu, rel=1e-7
    )
    order = np.concatenate([rng.permutation(len(structure.scales)),
                            np.arange(len(structure.scales), structure.size)])  # fmt: skip
    assert upper_bound(N[:, order][:, :, order], structure).mu == pytest.approx(mu, rel=1e-7)


def test_textbook_example():
    """Skogestad and Postlethwaite, example 8.5: [[2, 2], [-1, -1]] has mu = 3 for two scalars and
    sqrt(10) for a full block.
    """
    M = np.array([[[2, 2], [-1, -1]]], dtype=complex)
    assert upper_bound(M, BlockStructure((0, 1), 0)).mu == pytest.approx([3.0], rel=1e-9)
    assert upper_bound(M, BlockStructure((0, 0), 0)).mu == pytest.approx([10**0.5], rel=1e-12)


def test_zero_and_reducible_matrices():
    """mu(0) = 0; a triangular matrix, whose best scales are infinite, is bounded to 1e-6."""
    structure = BlockStructure((0,), 1)
    N = np.array([[[0, 0], [0, 0]], [[0.5, 10], [0, 0.4]]], dtype=complex)
    bound = upper_bound(N, structure)
    assert bound.mu[0] == 0
    assert bound.mu[1] == pytest.approx(0.5, rel=1e-6)
    assert np.isfinite(bound.d).all()


def test_bound_is_what_its_scales_prove():
    """The reported bound is sigma_max of the scaled matrix."""
    rng = np.random.default_rng(0)
    N = rng.normal(size=(3, 4, 4)) + 0j
    structure = BlockStructure((0, 1), 2)
    bound = upper_bound(N, structure)
    assert (bound.mu == bound_of_scales(N, bound.d, structure).mu).all()


@pytest.mark.parametrize("N", [np.ones((2, 2)), np.ones((1, 3, 3)), np.full((1, 2, 2), np.nan)])
def test_wrong_shapes_are_refused(N):
    """N is (k, p, p) and finite."""
    with pytest.raises(InvalidInputError):
        upper_bound(N, BlockStructure((0,), 1))


@pytest.mark.parametrize(("scales", "performance"), [((0, 2), 1), ((), 0), ((0,), -1)])
def test_impossible_structures_are_refused(scales, performance):
    """Scales are numbered without gaps and there is at least one channel."""
    with pytest.raises(InvalidInputError):
        BlockStructure(scales, performance)
