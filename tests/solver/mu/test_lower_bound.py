"""The lower bound of mu: known values, agreement with the upper bound, its own perturbation."""

import ctrlsys
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from solver.model.errors import InvalidInputError
from solver.mu.lower_bound import MuLowerBound, lower_bound
from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure

# SLICOT's example for AB13MD (BSD-3), here with every block complex.
SLICOT_REAL = [[-1, 2, 3, 3, -5, -6], [4, -2, -6, -4, 8, 12], [5, -4, 1, -6, 2, 4]] * 2
SLICOT_IMAGINARY = [[6, -3, 8, 8, -9, 2], [2, 5, -7, 11, -7, -1], [-4, -8, -3, 14, -5, 16]] * 2


def random_matrices(seed: int, count: int, size: int) -> NDArray[np.complex128]:
    """Independent complex normal entries, (count, size, size)."""
    generator = np.random.default_rng(seed)
    real, imaginary = generator.standard_normal((2, count, size, size))
    return real + 1j * imaginary


def ab13md(N: NDArray[np.complex128], sizes: list[int]) -> NDArray[np.float64]:
    """SLICOT's upper bound for complex blocks."""
    kinds = np.full(len(sizes), 2, dtype=np.int32)
    blocks = np.array(sizes, dtype=np.int32)
    return np.array([ctrlsys.ab13md(np.asfortranarray(M), blocks, kinds)[0] for M in N])


def assert_attained(
    N: NDArray[np.complex128], structure: BlockStructure, bound: MuLowerBound
) -> None:
    """Delta has the structure and norm one, and I - N Delta / mu is singular."""
    performance = [structure.n_scales] * structure.performance
    owner = np.array([*structure.scales, *performance])
    assert np.all(bound.Delta[:, owner[:, None] != owner] == 0)
    for block in range(owner.max() + 1):
        part = bound.Delta[:, owner == block][:, :, owner == block]
        assert np.linalg.norm(part, 2, axis=(1, 2)) == pytest.approx(1, abs=1e-12)
    loop = np.eye(structure.size) - N @ bound.Delta / bound.mu[:, None, None]
    singular_values = np.linalg.svd(loop, compute_uv=False)
    assert np.max(singular_values[:, -1] / singular_values[:, 0]) < 1e-12


@pytest.mark.parametrize(("scales", "mu"), [((0, 1), 3.0), ((0, 0), np.sqrt(10))])
def test_textbook_matrix(scales: tuple[int, ...], mu: float) -> None:
    """Skogestad and Postlethwaite, example 8.5: mu is 3 for scalars, 3.162 for a full block."""
    N = np.array([[[2, 2], [-1, -1]]], dtype=complex)
    structure = BlockStructure(scales, 0)
    bound = lower_bound(N, structure, upper_bound(N, structure).d)
    assert bound.mu[0] == pytest.approx(mu, rel=1e-12)
    assert_attained(N, structure, bound)


def test_slicot_matrix_meets_the_upper_bound_of_ab13md() -> None:
    """On SLICOT's example, all blocks complex, both bounds agree: that is mu."""
    N = np.array([np.array(SLICOT_REAL) + 1j * np.array(SLICOT_IMAGINARY)])
    structure = BlockStructure((0, 1, 2, 2, 3, 4), 0)
    bound = lower_bound(N, structure, np.ones((1, 5)))
    assert bound.mu == pytest.approx(ab13md(N, [1, 1, 2, 1, 1]), rel=1e-6)
    assert_attained(N, structure, bound)


@pytest.mark.parametrize(
    ("structure", "sizes"),
    [(BlockStructure((0, 1), 2), [1, 1, 2]), (BlockStructure((0, 0, 0), 3), [3, 3])],
)
def test_three_blocks_or_fewer_are_exact(structure: BlockStructure, sizes: list[int]) -> None:
    """The lower bound meets SLICOT's upper bound to 1e-6, whatever scales it is given."""
    N = random_matrices(1, 40, structure.size)
    for d in (upper_bound(N, structure).d, np.ones((40, structure.n_scales))):
        bound = lower_bound(N, structure, d)
        assert bound.mu == pytest.approx(ab13md(N, sizes), rel=1e-6)
        assert_attained(N, structure, bound)


def test_more_blocks_stay_below_the_upper_bound() -> None:
    """With five scalars and a full block a gap may remain; most matrices show none."""
    structure = BlockStructure((0, 1, 2, 3, 4), 5)
    N = random_matrices(2, 40, 10)
    upper = upper_bound(N, structure)
    bound = lower_bound(N, structure, upper.d)
    assert_attained(N, structure, bound)
    assert np.all(bound.mu <= upper.mu * (1 + 1e-12))
    assert np.median(bound.mu / upper.mu) == pytest.approx(1, abs=1e-6)
    assert np.min(bound.mu / upper.mu) > 0.98


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 3), decades=st.floats(0, 4))
def test_invariants(seed: int, n: int, decades: float) -> None:
    """Between spectral radius and norm, the same under D-scaling, and linear in N."""
    structure = BlockStructure(tuple(range(n)), n)
    N = random_matrices(seed, 1, 2 * n)
    d = upper_bound(N, structure).d
    mu = lower_bound(N, structure, d).mu[0]
    assert mu >= np.abs(np.linalg.eigvals(N)).max() * (1 - 1e-6)
    assert mu <= np.linalg.norm(N[0], 2) * (1 + 1e-9)
    spread = 10.0 ** (decades * np.random.default_rng(seed).uniform(-1, 1, (1, n)))
    D = structure.diagonal(spread)
    scaled = 7.0 * N * D[:, :, None] / D[:, None, :]
    again = lower_bound(scaled, structure, d / spread).mu[0]
    assert again == pytest.approx(7.0 * mu, rel=1e-6)


def test_zero_matrix() -> None:
    """The bound of a zero matrix is zero."""
    structure = BlockStructure((0, 1), 2)
    bound = lower_bound(np.zeros((1, 4, 4), dtype=complex), structure, np.ones((1, 2)))
    assert bound.mu[0] == 0


def test_same_digits_every_time() -> None:
    """The search is deterministic."""
    structure = BlockStructure((0, 1, 2), 3)
    N = random_matrices(4, 10, 6)
    first, second = (lower_bound(N, structure, np.ones((10, 3))) for _ in range(2))
    assert np.array_equal(first.mu, second.mu)
    assert np.array_equal(first.Delta, second.Delta)


@pytest.mark.parametrize("N", [np.full((1, 4, 4), np.nan + 0j), np.zeros((1, 3, 3), complex)])
def test_unusable_matrices_are_refused(N: NDArray[np.complex128]) -> None:
    """NaN and wrong shapes raise an error that names the matrix."""
    with pytest.raises(InvalidInputError) as caught:
        lower_bound(N, BlockStructure((0, 1), 2), np.ones((1, 2)))
    assert caught.value.field == "/N"


def test_four_blocks_may_have_a_bound_above_mu() -> None:
    """Packard and Doyle (1993), section 9.2: the best scales prove 1, mu itself is 0.8723."""
    alpha, beta = 3 + np.sqrt(3), np.sqrt(3) - 1
    a, b, c, d = np.sqrt(2 / alpha), 1 / np.sqrt(alpha), 1 / np.sqrt(alpha), -np.sqrt(beta / alpha)
    f = (1 + 1j) * np.sqrt(1 / (alpha * beta))
    U = np.array([[a, 0], [b, b], [c, 1j * c], [d, f]])
    V = np.array([[0, a], [b, -b], [c, -1j * c], [-1j * f, -d]])
    N, structure = (U @ V.conj().T)[None], BlockStructure((0, 1, 2), 1)
    above = upper_bound(N, structure)
    assert above.mu[0] == pytest.approx(1, abs=1e-9)
    assert lower_bound(N, structure, above.d).mu[0] == pytest.approx(0.8723, abs=1e-4)
