"""Transmission zeros: published examples, dead times, parallel plants, the search."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.interaction.zero_search import Rectangle, zeros_in_box
from solver.interaction.zeros import (
    Direction,
    ZeroMethod,
    bandwidth_limit,
    transmission_zeros,
)
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction

LAG = TransferFunction([1], [1, 1])


def _rosenbrock(times: tuple[tuple[float, float], tuple[float, float]]) -> MatrixPlant:
    (t11, t12), (t21, t22) = times
    return MatrixPlant(
        [
            [TransferFunction([1], [1, 1], t11), TransferFunction([2], [1, 3], t12)],
            [TransferFunction([1], [1, 1], t21), TransferFunction([1], [1, 1], t22)],
        ]
    )


def test_example_11_3() -> None:
    """Astrom and Hagglund, Example 11.3: one zero, at s = 1, in the right half plane."""
    result = transmission_zeros(_rosenbrock(((0, 0), (0, 0))))
    assert result.method is ZeroMethod.EXACT
    (zero,) = result.zeros
    assert zero.value == pytest.approx(1)
    assert zero.right_half_plane
    assert result.bandwidth_limit == pytest.approx(0.5)


def test_example_11_4_has_no_zeros() -> None:
    """Astrom and Hagglund, Example 11.4: right-half-plane zeros in the elements, none in all."""
    den = [1, 3, 2]
    plant = MatrixPlant(
        [
            [TransferFunction([1, -1], den), TransferFunction([1, 0], den)],
            [TransferFunction([-6], den), TransferFunction([1, -2], den)],
        ]
    )
    result = transmission_zeros(plant)
    assert result.zeros == ()
    assert result.bandwidth_limit is None
    assert not result.degenerate


def test_dead_time_of_rows_and_columns_changes_nothing() -> None:
    """Dead times that are a row's share plus a column's share leave the zeros exact."""
    result = transmission_zeros(_rosenbrock(((0.3, 0.5), (1.3, 1.5))))
    assert result.method is ZeroMethod.EXACT
    assert [zero.value for zero in result.zeros] == [pytest.approx(1)]


def test_other_dead_times_are_searched() -> None:
    """The zero found solves the transcendental equation, and moves continuously from s = 1."""
    result = transmission_zeros(_rosenbrock(((0.3, 0.5), (1.3, 1.6))))
    assert result.method is ZeroMethod.SEARCH
    assert result.searched_radius is not None
    (zero,) = result.zeros
    s = zero.value
    residual = cmath.exp(-0.1 * s) / (s + 1) - 2 / (s + 3)
    assert abs(residual) < 1e-12
    tiny = transmission_zeros(_rosenbrock(((1e-6, 0), (0, 0))))
    assert tiny.zeros[0].value == pytest.approx(1, abs=1e-5)


def test_wood_berry_has_none_within_reach() -> None:
    """Wood and Berry's column (Example 11.6): no zero in the right half plane up to 10 rad/min."""
    plant = MatrixPlant(
        [
            [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
            [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
        ]
    )
    result = transmission_zeros(plant)
    assert result.method is ZeroMethod.SEARCH
    assert result.searched_radius is not None
    assert result.searched_radius > 5
    assert result.zeros == ()


def test_parallel_first_order_has_no_finite_zeros() -> None:
    """k/(tau s + 1) [1, a; a, 1] has none, for a thousand units as for two."""
    assert transmission_zeros(first_order(1000, 1, 100, 0.949, 1)).zeros == ()
    assert transmission_zeros(first_order(1, 1, 100, 0)).zeros == ()


def test_parallel_zeros_belong_to_modes() -> None:
    """G = 1/(s+1), i = -2/(s+4), 5 units: sum (s+4-8(s+1)), differences (s+4+2(s+1))."""
    plant = ParallelPlant(5, LAG, TransferFunction([-2], [1, 4]))
    result = transmission_zeros(plant)
    assert result.method is ZeroMethod.EXACT
    found = {(zero.direction, zero.multiplicity): zero.value for zero in result.zeros}
    assert found[Direction.SUM, 1] == pytest.approx(-4 / 7)
    assert found[Direction.DIFFERENCES, 4] == pytest.approx(-2)
    dense = MatrixPlant([[plant.element(r, c) for c in range(5)] for r in range(5)])
    whole = transmission_zeros(dense)
    # At s = -1 and s = -4 nothing hides: the dense form finds the same zeros.
    assert sorted((zero.value.real, zero.multiplicity) for zero in whole.zeros) == [
        (pytest.approx(-2), 4),
        (pytest.approx(-4 / 7), 1),
    ]


def test_parallel_plant_with_two_dead_times() -> None:
    """e^-s/(10s+1) against 0.9 e^-3s/(5s+1): each zero found makes its mode vanish."""
    g, i = TransferFunction([1], [10, 1], 1), TransferFunction([0.9], [5, 1], 3)
    result = transmission_zeros(ParallelPlant(5, g, i))
    assert result.method is ZeroMethod.SEARCH
    assert len(result.zeros) > 3
    for zero in result.zeros:
        factor = 4 if zero.direction is Direction.SUM else -1
        value = g(zero.value) + factor * i(zero.value)
        assert abs(value) < 1e-9 * abs(g(zero.value))
        assert zero.multiplicity == (1 if zero.direction is Direction.SUM else 4)
        assert any(abs(other.value - zero.value.conjugate()) < 1e-9 for other in result.zeros)


def test_degenerate_plants() -> None:
    """Units that cannot be told apart, and dependent outputs, with and without dead time."""
    assert transmission_zeros(ParallelPlant(3, LAG, LAG)).degenerate
    delayed = TransferFunction([1], [1, 1], 1)
    later = TransferFunction([1], [1, 1], 2)
    assert transmission_zeros(MatrixPlant([[LAG, delayed], [delayed, later]])).degenerate
    h = TransferFunction([1], [2, 1])
    row = [LAG, h, delayed]
    assert transmission_zeros(MatrixPlant([row, [h, delayed, LAG], row])).degenerate


def test_zero_at_the_origin_forbids_any_bandwidth() -> None:
    """A washout in a loop: zero at s = 0, limit 0."""
    result = transmission_zeros(MatrixPlant([[TransferFunction([1, 0], [1, 1])]]))
    assert result.zeros[0].right_half_plane
    assert result.bandwidth_limit == 0


def test_zeros_on_the_axis_count_as_right() -> None:
    """A notch at 1 rad, alone and beside dead times that do not factor out."""
    notch = TransferFunction([1, 0, 1], [1, 2, 1])
    none = TransferFunction([0], [1])
    exact = transmission_zeros(MatrixPlant([[notch]]))
    assert [zero.value for zero in exact.zeros] == [-1j, 1j]
    assert exact.bandwidth_limit == pytest.approx(math.sqrt(3) / 2)
    plant = MatrixPlant(
        [
            [notch, none, none],
            [none, TransferFunction([1], [1, 1], 1), TransferFunction([0.1], [1, 2], 2)],
            [none, TransferFunction([0.1], [1, 1], 2), TransferFunction([1], [1, 2], 2)],
        ]
    )
    searched = transmission_zeros(plant)
    assert searched.method is ZeroMethod.SEARCH
    assert sorted(zero.value.imag for zero in searched.zeros if abs(zero.value) < 1.5) == [
        pytest.approx(-1),
        pytest.approx(1),
    ]


def test_unstable_and_integrating_elements_are_searched() -> None:
    """Poles in the box do not pass for zeros, nor hide one."""
    plant = MatrixPlant(
        [
            [TransferFunction([1], [1, -1], 1), TransferFunction([2], [1, 3], 2)],
            [TransferFunction([1], [1, 0]), TransferFunction([1], [1, -2], 0.5)],
        ]
    )
    result = transmission_zeros(plant)
    assert result.method is ZeroMethod.SEARCH
    assert result.zeros
    for zero in result.zeros:
        s = zero.value
        value = np.exp(-1.5 * s) / (s - 1) / (s - 2) - 2 * np.exp(-2 * s) / (s + 3) / s
        assert abs(value) < 1e-10
        assert min(abs(s - 1), abs(s - 2), abs(s)) > 1e-3


@pytest.mark.parametrize("unit", [1.0, 10.0, 1e-3])
def test_an_input_that_integrates_makes_no_zero_at_the_origin(unit: float) -> None:
    """Both elements of a column have a pole at s = 0, the determinant one only."""
    rows = [
        [TransferFunction([unit], [1, 0]), TransferFunction([0.5 / unit], [3, 1])],
        [TransferFunction([0.3 * unit], [1, 0], 1.0), TransferFunction([-2 / unit], [4, 1])],
    ]
    assert transmission_zeros(MatrixPlant(rows)).zeros == ()


def test_many_orders_are_searched() -> None:
    """Above the exact degree the search gives the same right-half-plane zeros."""
    rng = np.random.default_rng(5)

    def element(gain: float) -> TransferFunction:
        poles = -rng.uniform(0.5, 2.0, 5).round(2)
        return TransferFunction([gain], np.poly(poles).round(6).tolist())

    plant = MatrixPlant([[element(1.0 + 2.0 * (r == c)) for c in range(5)] for r in range(5)])
    result = transmission_zeros(plant)
    assert result.method is ZeroMethod.SEARCH
    for zero in result.zeros:
        P = plant_at(plant, zero.value)
        assert np.linalg.svd(P, compute_uv=False)[-1] < 1e-9 * np.linalg.norm(P)


def plant_at(plant: MatrixPlant, s: complex) -> np.ndarray:
    """Value of the plant at a complex point."""
    return np.array([[plant.element(r, c)(s) for c in range(plant.n)] for r in range(plant.n)])


@pytest.mark.parametrize("zero", [1 + 0j, 0.3 + 2j, 2j, 5 + 0.1j])
@pytest.mark.parametrize("max_peak", [1.5, 2.0, 4.0])
def test_bandwidth_limit_is_where_the_weight_reaches_one(zero: complex, max_peak: float) -> None:
    """At the limit |w_P(zero)| = 1 with w_P = (1/M)(tau s + 1)/(tau s), tau = 1/(M omega_B)."""
    tau = 1 / (max_peak * bandwidth_limit(zero, max_peak))
    assert abs((tau * zero + 1) / (max_peak * tau * zero)) == pytest.approx(1)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 6))
@settings(max_examples=30, deadline=None)
def test_search_finds_the_zeros_built_in(seed: int, count: int) -> None:
    """Zeros of a polynomial times an exponential, over four decades, all found, no others."""
    rng = np.random.default_rng(seed)
    inside = 10 ** rng.uniform(-3, 0.9, count) * np.exp(1j * rng.uniform(0.1, 1.4, count))
    outside = -(10 ** rng.uniform(-3, 1, 3))

    def function(points: np.ndarray) -> np.ndarray:
        value = np.exp(-0.3 * points)
        for root in (*inside, *outside):
            value = value * (points - root) / (abs(points) + abs(root))
        return value

    found = zeros_in_box(function, Rectangle(-1e-7, -1e-7, 10.0, 10.0))
    values = np.array([root.value for root in found for _ in range(root.multiplicity)])
    assert values.size == count
    if count:
        np.testing.assert_allclose(
            np.sort_complex(values), np.sort_complex(inside), rtol=1e-6, atol=1e-9
        )


def test_search_reports_a_double_zero_once() -> None:
    """A double zero is one root of multiplicity two."""
    found = zeros_in_box(lambda s: (s - 0.7 - 0.2j) ** 2 * (s + 1), Rectangle(0, 0, 2, 2))
    assert [root.multiplicity for root in found] == [2]
    assert found[0].value == pytest.approx(0.7 + 0.2j, abs=1e-5)
