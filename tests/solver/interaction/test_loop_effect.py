"""Effect of one loop's gain on another: Example 11.1 and 11.2, Rosenbrock, refusals."""

import math

import numpy as np
import pytest

from solver.interaction.loop_effect import LoopEffect, loop_effect, static_effects
from solver.interaction.loop_effect_query import MAX_GAINS, LoopEffectQuery
from solver.interaction.relative_gain import relative_gain_array
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction


def _effect(
    plant: MatrixPlant | ParallelPlant,
    loop: int,
    other: int,
    gains: list[float],
    controller: Controller | None = None,
) -> LoopEffect:
    return loop_effect(LoopEffectQuery(plant, loop, other, tuple(gains), controller))


def _second_order(gain: float) -> TransferFunction:
    return TransferFunction([gain], [1, 2, 1])


EXAMPLE = MatrixPlant([[_second_order(1), _second_order(2)], [_second_order(1), _second_order(1)]])
SWAPPED = MatrixPlant([[_second_order(2), _second_order(1)], [_second_order(1), _second_order(1)]])
PI = Controller(gain=1.0, integral_time=1.0)


def test_example_11_1_static_gain() -> None:
    """Astrom and Hagglund, Example 11.1: g_cl(0) = (1 - k2)/(1 + k2)."""
    gains = [0.0, 0.5, 0.8, 1.0, 1.6, 10.0]
    effect = _effect(EXAMPLE, 0, 1, gains)
    expected = [(1 - k) / (1 + k) for k in gains]
    np.testing.assert_allclose(effect.static_gains, expected, atol=1e-15)
    (first, _) = static_effects(EXAMPLE.static_gain())
    assert first.reversal_gain == pytest.approx(1)
    assert first.closed_gain == pytest.approx(-1)


def test_example_11_1_stability() -> None:
    """The book calls k2 = 0.8 unstable; it is stable (slowest pole -0.0565), k2 > 1 is not."""
    effect = _effect(EXAMPLE, 0, 1, [0.0, 0.8, 1.6], PI)
    assert effect.stable == (True, True, False)
    assert np.max(effect.poles[1].real) == pytest.approx(-0.0565, abs=5e-5)
    (interval,) = effect.stable_gains
    assert interval.low == 0
    assert interval.high == pytest.approx(1, abs=1e-14)


def test_example_11_1_characteristic_polynomial() -> None:
    """S (s+1)^2 (s^2+2s+1+k2) + (s+1)(s^2+2s+1-k2): the printed g_cl under k1 = ki = 1."""
    for k in (0.3, 0.8, 1.6):
        effect = _effect(EXAMPLE, 0, 1, [k], PI)
        square = [1, 2, 1]
        expected = np.polyadd(
            np.polymul([1, 0], np.polymul(square, [1, 2, 1 + k])),
            np.polymul([1, 1], [1, 2, 1 - k]),
        )
        np.testing.assert_allclose(np.poly(effect.poles[0]).real, expected, atol=1e-9)


def test_example_11_2_stays_stable() -> None:
    """Example 11.2, inputs exchanged: gain (2 + k2)/(1 + k2), stable for every k2."""
    gains = [0.0, 0.8, 1.6, 1e6]
    effect = _effect(SWAPPED, 0, 1, gains, PI)
    np.testing.assert_allclose(effect.static_gains, [(2 + k) / (1 + k) for k in gains])
    assert all(effect.stable)
    assert [(i.low, i.high) for i in effect.stable_gains] == [(0, math.inf)]
    assert static_effects(SWAPPED.static_gain())[0].reversal_gain is None


def test_open_loop_has_the_poles_of_the_other_loop() -> None:
    """Loop 1 open: poles of the plant and of loop 2 alone, (s+1)^2 + k = 0."""
    effect = _effect(EXAMPLE, 0, 1, [3.0])
    closed = [-1 + 1j * math.sqrt(3), -1 - 1j * math.sqrt(3)]
    assert effect.poles[0].size == 4
    for pole in closed:
        assert np.min(np.abs(effect.poles[0] - pole)) < 1e-12


def test_processes_of_negative_gain_take_negative_gains() -> None:
    """Turning the sign of the second input turns the sign of the limit."""
    turned = MatrixPlant(
        [[_second_order(1), _second_order(-2)], [_second_order(1), _second_order(-1)]]
    )
    (interval,) = _effect(turned, 0, 1, [-0.8], PI).stable_gains
    assert (interval.low, interval.high) == (pytest.approx(-1), 0)
    assert static_effects(turned.static_gain())[0].reversal_gain == pytest.approx(-1)


def test_rosenbrock_zero_limits_the_gain() -> None:
    """Rosenbrock's system with a fast first loop: the second gain is limited by the zero at 1."""
    plant = MatrixPlant(
        [
            [TransferFunction([1], [1, 1]), TransferFunction([2], [1, 3])],
            [TransferFunction([1], [1, 1]), TransferFunction([1], [1, 1])],
        ]
    )
    limits = [
        _effect(plant, 1, 0, [1.0], Controller(k, 1.0)).stable_gains[0].high
        for k in (1.0, 10.0, 100.0)
    ]
    assert limits == sorted(limits, reverse=True)
    assert limits[0] == math.inf
    # Perfect control of loop 2 leaves s^2 + (4 - k) s + 3 + k: the limit tends to 4.
    assert limits[2] == pytest.approx(4, rel=0.03)


def test_stability_agrees_with_the_poles_on_both_sides_of_each_limit() -> None:
    """A conditionally stable pair: every limit separates stable from unstable gains."""
    p = TransferFunction([4, 4.8, 1.6], [1, 0, 0, 0])
    small = TransferFunction([0.1], [1, 1])
    plant = MatrixPlant([[TransferFunction([1], [1, 1]), small], [small, p]])
    effect = _effect(plant, 0, 1, [1.0], Controller(1.0, 2.0))
    assert effect.stable_gains
    for interval in effect.stable_gains:
        for edge in (interval.low, interval.high):
            if 0 < edge < math.inf:
                inside = edge * (1 + 1e-6) if edge == interval.low else edge * (1 - 1e-6)
                outside = edge * (1 - 1e-6) if edge == interval.low else edge * (1 + 1e-6)
                check = _effect(plant, 0, 1, [inside, outside], Controller(1.0, 2.0))
                assert check.stable == (True, False)


def test_derivative_action_and_integrating_processes() -> None:
    """A PID loop beside an integrating one: infinite static gains keep their sign."""
    integrator = TransferFunction([1], [1, 0])
    lag = TransferFunction([1], [1, 1])
    none = TransferFunction([0], [1])
    plant = MatrixPlant([[integrator, lag], [none, lag]])
    effect = _effect(plant, 0, 1, [1.0], Controller(1.0, 5.0, 0.5))
    assert effect.static_gains[0] == math.inf
    assert effect.stable == (True,)
    assert effect.poles[0].size == 4  # integrator, shared lag, integral action, filter


def test_gain_that_cancels_the_other_loop_has_no_static_gain() -> None:
    """1 + k p_jj(0) = 0: the static gain is not finite."""
    effect = _effect(EXAMPLE, 0, 1, [-1.0])
    assert not np.isfinite(effect.static_gains[0])
    static = MatrixPlant([[TransferFunction([g], [1]) for g in row] for row in ((1, 2), (1, 1))])
    assert math.isnan(_effect(static, 0, 1, [-1.0]).static_gains[0])


def test_extreme_coefficients_do_not_overflow() -> None:
    """Gains of 1e-150 beside 1e12 in one plant: infinities where numbers end, no error."""
    tiny, huge = TransferFunction([1e-150], [1, 1]), TransferFunction([1e12], [3, 1])
    effect = _effect(MatrixPlant([[tiny, huge], [huge, tiny]]), 0, 1, [1e-20, 1e12])
    assert len(effect.stable) == 2
    assert all(np.isfinite(values).all() for values in effect.poles)


def test_a_vanishing_lag_changes_nothing() -> None:
    """A time constant of 1e-140: the crossings are those without it, not an overflow."""
    fast = TransferFunction([2], [1e-140, 3])
    rows = [[TransferFunction([1], [1, 1]), fast], [TransferFunction([1], [1, 1])] * 2]
    effect = _effect(MatrixPlant(rows), 0, 1, [1.0], Controller(2.0, 1.0))
    rows[0][1] = TransferFunction([2], [3])
    exact = _effect(MatrixPlant(rows), 0, 1, [1.0], Controller(2.0, 1.0))
    assert effect.stable_gains[0].high == pytest.approx(exact.stable_gains[0].high, rel=1e-12)


def test_closed_gain_is_open_gain_over_relative_gain() -> None:
    """For 2 x 2 the limit is the definition of the relative gain."""
    plant = first_order(2, 3, 10, 0.6)
    gains = relative_gain_array(plant.static_gain())
    for effect in static_effects(plant.static_gain()):
        assert effect.closed_gain == pytest.approx(3 / gains[0, 0])
        assert effect.reversal_gain is None


@pytest.mark.parametrize(
    ("loop", "other", "field"), [(2, 0, "/loop"), (0, -1, "/other"), (1, 1, "/other")]
)
def test_loops_that_do_not_exist_are_refused(loop: int, other: int, field: str) -> None:
    """Indices outside the plant and equal indices name the field."""
    with pytest.raises(InvalidInputError) as caught:
        _effect(EXAMPLE, loop, other, [1.0])
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("gains", "field"),
    [
        ([], "/gains"),
        ([0.0] * (MAX_GAINS + 1), "/gains"),
        ([1e13], "/gains/0"),
        ([1.0, 1e-308], "/gains/1"),
    ],
)
def test_gains_out_of_range_are_refused(gains: list[float], field: str) -> None:
    """None, too many, too large, so small that exact arithmetic never ends."""
    with pytest.raises(InvalidInputError) as caught:
        _effect(EXAMPLE, 0, 1, gains)
    assert caught.value.field == field


def test_dead_time_is_refused() -> None:
    """Infinitely many poles are not computed."""
    with pytest.raises(UnsupportedPlantError, match="dead time"):
        _effect(first_order(2, 1, 10, 0.5, 1), 0, 1, [1.0])


def test_a_filter_of_its_own_and_no_integral_action_are_seen() -> None:
    """The default filter written out changes nothing; a P controller is a static gain."""
    usual = _effect(EXAMPLE, 0, 1, [1.0], Controller(1.0, 5.0, 0.5))
    written = _effect(EXAMPLE, 0, 1, [1.0], Controller(1.0, 5.0, 0.5, 0.05))
    assert written.poles[0] == pytest.approx(usual.poles[0])
    static = _effect(EXAMPLE, 0, 1, [1.0], Controller(1.0, None))
    assert static.poles[0].size == usual.poles[0].size - 2
