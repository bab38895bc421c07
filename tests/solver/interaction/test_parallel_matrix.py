"""The closed forms of SLH section 3 against numpy, n = 1..8."""

import math

import numpy as np
import pytest

from solver.interaction.parallel_matrix import ParallelMatrix
from solver.model.errors import InvalidInputError

CASES = [
    (n, own, a)
    for n in range(2, 9)
    for own in (1.0, -2.5)
    for a in (0.0, 0.949, -0.3 / (n - 1), 1.7, -2.0, 0.3 + 0.4j)
]


@pytest.mark.parametrize(("n", "own", "a"), CASES)
def test_determinant_is_eq_12(n: int, own: float, a: complex) -> None:
    """The determinant equals numpy's."""
    matrix = ParallelMatrix(n, own, own * a)
    expected = np.linalg.det(matrix.dense())
    assert matrix.determinant == pytest.approx(expected, rel=1e-10)
    logarithm = matrix.log_determinant
    assert logarithm.phase * math.exp(logarithm.log_magnitude) == pytest.approx(expected, rel=1e-10)
    printed = own**n * (1 + (n - 1) * a) * (1 - a) ** (n - 1)
    assert matrix.determinant == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize(("n", "own", "a"), CASES)
def test_inverse_and_relative_gains_are_eqs_13_to_16(n: int, own: float, a: complex) -> None:
    """The inverse and the relative gains equal numpy's, and the printed formulas."""
    matrix = ParallelMatrix(n, own, own * a)
    inverse = np.linalg.inv(matrix.dense())
    gains = matrix.dense() * inverse.T
    assert matrix.own_inverse == pytest.approx(inverse[0, 0], rel=1e-10)
    assert matrix.other_inverse == pytest.approx(inverse[0, 1], rel=1e-10, abs=1e-14)
    assert matrix.own_relative_gain == pytest.approx(gains[1, 1], rel=1e-10)
    assert matrix.other_relative_gain == pytest.approx(gains[1, 0], rel=1e-10, abs=1e-14)
    denominator = (1 + (n - 1) * a) * (1 - a)
    assert matrix.own_relative_gain == pytest.approx((1 + (n - 2) * a) / denominator, rel=1e-12)
    assert matrix.other_relative_gain == pytest.approx(-(a**2) / denominator, rel=1e-12)


@pytest.mark.parametrize(("n", "own", "a"), CASES)
def test_eigenvalues_are_eqs_17_to_21(n: int, own: float, a: complex) -> None:
    """The Fourier matrix diagonalises it, with the two eigenvalues of eqs. 19 and 20."""
    matrix = ParallelMatrix(n, own, own * a)
    F = matrix.eigenvectors()
    expected = np.array([matrix.sum_eigenvalue] + [matrix.difference_eigenvalue] * (n - 1))
    np.testing.assert_allclose(F.conj().T @ matrix.dense() @ F, np.diag(expected), atol=1e-13)
    np.testing.assert_allclose(F.conj().T @ F, np.eye(n), atol=1e-13)


@pytest.mark.parametrize(("n", "own", "a"), CASES)
def test_singular_values_are_the_magnitudes_of_the_eigenvalues(
    n: int, own: float, a: complex
) -> None:
    """Singular values and condition number equal numpy's."""
    matrix = ParallelMatrix(n, own, own * a)
    np.testing.assert_allclose(
        matrix.singular_values, np.linalg.svd(matrix.dense(), compute_uv=False), rtol=1e-12
    )
    assert matrix.condition_number == pytest.approx(np.linalg.cond(matrix.dense()), rel=1e-10)


def test_large_matrix_does_not_overflow() -> None:
    """Ten thousand units: the logarithm of the determinant is finite, the plain one infinite."""
    matrix = ParallelMatrix(10_000, 1e12, 0.5e12)
    assert matrix.determinant == math.inf
    assert matrix.log_determinant.log_magnitude == pytest.approx(
        math.log(1e12 * (1 + 9999 * 0.5)) + 9999 * math.log(0.5e12)
    )
    assert matrix.own_relative_gain == pytest.approx(2.0, rel=1e-3)


def test_singular_matrix_is_refused() -> None:
    """Equal elements and constant total flow leave no inverse."""
    for other in (1.0, -0.5):
        matrix = ParallelMatrix(3, 1.0, other)
        assert matrix.is_singular
        assert matrix.condition_number == math.inf
        assert matrix.log_determinant.log_magnitude == -math.inf
        with pytest.raises(InvalidInputError, match="singular"):
            _ = matrix.own_inverse


def test_single_unit() -> None:
    """One unit interacts with nobody."""
    matrix = ParallelMatrix(1, 4.0, 0.0)
    assert matrix.own_relative_gain == 1
    assert matrix.determinant == 4
    assert matrix.condition_number == 1


def test_size_zero_is_refused() -> None:
    """A matrix has at least one row."""
    with pytest.raises(InvalidInputError) as caught:
        ParallelMatrix(0, 1.0, 0.0)
    assert caught.value.field == "/n"
