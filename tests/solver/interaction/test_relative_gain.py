"""The relative gain array: published values, invariants, integrating and singular plants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.interaction.relative_gain import (
    GainStatus,
    low_frequency_gain,
    relative_gain_array,
    relative_gain_at,
)
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.stability.singular import is_singular


def _matrix(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, n))


def test_example_11_2() -> None:
    """Astrom and Hagglund, Example 11.2: the index is -1."""
    np.testing.assert_allclose(relative_gain_array([[1, 2], [1, 1]]), [[-1, 2], [2, -1]])


def test_example_11_3() -> None:
    """Astrom and Hagglund, Example 11.3, Rosenbrock's system: the index is 3."""
    np.testing.assert_allclose(relative_gain_array([[1, 2 / 3], [1, 1]]), [[3, -2], [-2, 3]])


def test_example_11_4() -> None:
    """Astrom and Hagglund, Example 11.4: no interaction at steady state."""
    np.testing.assert_allclose(relative_gain_array([[-0.5, 0], [-3, -1]]), np.eye(2), atol=1e-15)


def test_array_need_not_be_symmetric() -> None:
    """For 3 x 3 the array is not symmetric, against the book's remark below eq. 11.4."""
    gains = relative_gain_array([[1, 2, 0], [0, 1, 3], [1, 0, 1]])
    assert np.max(np.abs(gains - gains.T)) > 0.5


@given(n=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_rows_and_columns_sum_to_one(n: int, seed: int) -> None:
    """Rows and columns sum to one, and scaling of the signals changes nothing."""
    P = _matrix(n, seed)
    gains = relative_gain_array(P)
    size = np.max(np.abs(gains))
    np.testing.assert_allclose(gains.sum(axis=0), 1, atol=1e-9 * size)
    np.testing.assert_allclose(gains.sum(axis=1), 1, atol=1e-9 * size)
    rng = np.random.default_rng(seed)
    scaled = np.diag(10 ** rng.uniform(-6, 6, n)) @ P @ np.diag(10 ** rng.uniform(-6, 6, n))
    np.testing.assert_allclose(relative_gain_array(scaled), gains, atol=1e-7 * size**2)


@given(seed=st.integers(0, 2**32 - 1))
def test_permuted_signals_permute_the_array(seed: int) -> None:
    """Renumbering inputs and outputs renumbers the array."""
    P = _matrix(5, seed)
    rng = np.random.default_rng(seed)
    rows, columns = rng.permutation(5), rng.permutation(5)
    gains = relative_gain_array(P)
    np.testing.assert_allclose(
        relative_gain_array(P[rows][:, columns]),
        gains[rows][:, columns],
        atol=1e-9 * np.max(np.abs(gains)) ** 2,
    )


@pytest.mark.parametrize(
    ("gain", "reason"),
    [
        ([[1, 2, 3], [4, 5, 6]], "2 x 3"),
        ([1, 2], "square"),
        ([], "square"),
        ([[1, 1], [1, 1]], "singular"),
        ([[0, 0], [1, 1]], "singular"),
        ([[1e-9, 2e-9], [1e9, 2e9]], "singular"),
        ([[1, np.nan], [1, 1]], "finite"),
        ([[1, np.inf], [1, 1]], "finite"),
    ],
)
def test_matrices_without_an_array_are_refused(gain: list[list[float]], reason: str) -> None:
    """Non-square, singular and non-finite gains are refused with the reason."""
    with pytest.raises(InvalidInputError, match=reason):
        relative_gain_array(gain)


def test_nearly_singular_gain_keeps_its_digits() -> None:
    """A = 0.9999: the array's element is 1/(1 - a^2)."""
    gains = relative_gain_array([[1, 0.9999], [0.9999, 1]])
    assert gains[0, 0] == pytest.approx(1 / (1 - 0.9999**2), rel=1e-10)


def test_bad_units_are_not_singular() -> None:
    """A gain in awkward units is regular all the same."""
    assert not is_singular(np.array([[1e-12, 0.0], [1e12, 1e3]]))


def test_array_over_frequency_of_rosenbrock() -> None:
    """Johansson (1993), below eq. 8: 1/(1-s) [[s+3, -2(s+1)], [-2(s+1), s+3]]."""
    lag = [1, 20, 100]
    g = TransferFunction([100], np.convolve([1, 1], lag))
    g12 = TransferFunction([200], np.convolve([1, 3], lag))
    plant = MatrixPlant([[g, g12], [g, g]])
    omega = np.array([1e-6, 0.3, 9.0, 1e5])
    s = 1j * omega
    gains = relative_gain_at(plant.response(omega))
    np.testing.assert_allclose(gains[:, 0, 0], (s + 3) / (1 - s), rtol=1e-9)
    np.testing.assert_allclose(gains[:, 0, 1], -2 * (s + 1) / (1 - s), rtol=1e-9)
    np.testing.assert_allclose(gains[0], [[3, -2], [-2, 3]], rtol=1e-5)
    np.testing.assert_allclose(gains[-1], [[-1, 2], [2, -1]], atol=1e-4)


def test_array_at_a_zero_on_the_axis_is_nan() -> None:
    """Where the response is singular there is no array."""
    notch = TransferFunction([1, 0, 1], [1, 2, 1])
    lag = TransferFunction([1], [1, 1])
    none = TransferFunction([0], [1])
    gains = relative_gain_at(MatrixPlant([[notch, none], [none, lag]]).response([0.5, 1.0]))
    assert np.all(np.isfinite(gains[0]))
    assert np.all(np.isnan(gains[1]))


def _integrating(orders: list[list[int]], gains: list[list[float]]) -> MatrixPlant:
    """Elements gain s^-order/(s+1)."""
    return MatrixPlant(
        [
            [TransferFunction([g], [1, 1, *[0] * m]) for m, g in zip(*row, strict=True)]
            for row in zip(orders, gains, strict=True)
        ]
    )


@pytest.mark.parametrize(
    "orders", [[[1, 1], [1, 1]], [[1, 0], [0, 1]], [[1, 0], [1, 0]], [[2, 1], [1, 0]]]
)
def test_integrating_plant_has_the_limit(orders: list[list[int]]) -> None:
    """The array of the scaled gain is that of the plant at a very low frequency."""
    plant = _integrating(orders, [[1, 2], [3, 5]])
    low = low_frequency_gain(plant)
    assert low.status is GainStatus.INTEGRATING
    limit = relative_gain_at(plant.response([1e-9]))[0]
    np.testing.assert_allclose(relative_gain_array(low.gain), limit.real, atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 5))
def test_scaled_gain_reproduces_the_leading_terms(seed: int, n: int) -> None:
    """No element exceeds diag(s^rows) gain diag(s^columns), and a full transversal meets it."""
    rng = np.random.default_rng(seed)
    orders = rng.integers(0, 3, (n, n))
    orders[0, 0] = 1
    plant = _integrating(orders.tolist(), rng.normal(size=(n, n)).tolist())
    low = low_frequency_gain(plant)
    s = 1e-7
    scaled = np.array([[plant.element(r, c)(s).real for c in range(n)] for r in range(n)])
    scaled /= s ** (low.rows[:, None] + low.columns[None, :]).astype(float)
    np.testing.assert_allclose(scaled, low.gain, atol=1e-5)


@pytest.mark.parametrize(
    "gains", [[[1, 2], [2, 4]], [[1, 1], [0, 0]], [[1, 0], [1, 0]]], ids=["rank", "row", "column"]
)
def test_singular_integrating_plant(gains: list[list[float]]) -> None:
    """Leading terms that cancel, and empty rows or columns, are singular."""
    assert low_frequency_gain(_integrating([[1, 1], [1, 1]], gains)).status is GainStatus.SINGULAR


def test_singular_static_gain_is_a_status() -> None:
    """A singular finite gain is reported, not raised."""
    low = low_frequency_gain(_integrating([[0, 0], [0, 0]], [[1, 1], [1, 1]]))
    assert low.status is GainStatus.SINGULAR
    np.testing.assert_array_equal(low.gain, np.ones((2, 2)))


def test_relative_gain_that_is_zero_but_for_rounding_is_zero() -> None:
    """Four units with a = -0.5 act through each other only: lambda_ii = 0, not 1.7e-16."""
    array = relative_gain_array(1.5 * np.eye(4) - 0.5)
    assert np.all(np.diag(array) == 0)
    np.testing.assert_allclose(array, (1 - np.eye(4)) / 3, atol=1e-12)


def test_array_that_others_print() -> None:
    """A 3 x 3 gain of arXiv:1805.10312, as the tests of ControlSystems.jl have it."""
    printed = [[-2.47, -2.41, 5.88], [3.29, 0.94, -3.24], [0.18, 2.47, -1.65]]
    found = relative_gain_array([[7, 4, 8], [7, 2, 5], [3, 8, 8]])
    np.testing.assert_allclose(found, printed, atol=0.01)
