"""Margins: textbook loops, an independent implementation, loops seen with the others closed."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.model.controllers import Controller
from solver.model.errors import UnsupportedPlantError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.subsystems import subsystem
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import BRACKET, proven_peaks
from solver.robustness.margins import Margins, loop_margins, loop_transfer, margins
from solver.stability.closed_loop import is_stable
from tests.solver.robustness.unusual_loops import draw_any

OMEGA = np.geomspace(1e-6, 1e6, 480)
FAST, SLOW = Controller(46.3, 101), Controller(22.8, 3.15)


def of(num: list[float], den: list[float], dead_time: float = 0.0) -> Margins:
    """Margins of a given loop transfer function."""
    return margins(TransferFunction(num, den, dead_time).response, OMEGA)


def scaled(controller: Controller, factor: float) -> Controller:
    """Return the controller with its gain multiplied."""
    return Controller(
        controller.gain * factor, controller.integral_time, controller.derivative_time
    )


def test_integrator_with_dead_time_in_closed_form() -> None:
    """L = k e^(-s)/s: gain margin pi/(2k), phase margin 90 degrees - k, delay margin its share."""
    k = 0.8
    found = of([k], [1, 0], 1.0)
    assert found.gain_increase == pytest.approx(math.pi / 2 / k, rel=1e-12)
    assert found.gain_decrease == 0
    assert found.crossover == pytest.approx(k, rel=1e-12)
    assert found.phase_margin == pytest.approx(90 - math.degrees(k), rel=1e-12)
    assert found.delay_margin == pytest.approx((math.pi / 2 - k) / k, rel=1e-12)


def test_second_order_loop_in_closed_form() -> None:
    """L = 1/(s (s + 1)): Mt = 2/sqrt(3) at 1/sqrt(2); no gain makes it unstable."""
    found = of([1], [1, 1, 0])
    assert found.gain_increase == math.inf
    assert found.complementary_sensitivity.value == pytest.approx(2 / math.sqrt(3), rel=1e-10)
    assert found.complementary_sensitivity.omega == pytest.approx(1 / math.sqrt(2), rel=1e-5)
    crossover = math.sqrt((math.sqrt(5) - 1) / 2)
    assert found.crossover == pytest.approx(crossover, rel=1e-12)
    assert found.phase_margin == pytest.approx(90 - math.degrees(math.atan(crossover)), rel=1e-12)


def test_third_order_loop_in_closed_form() -> None:
    """L = 2/(s (s + 1)(s + 2)): the gain margin is 3."""
    assert of([2], [1, 3, 2, 0]).gain_increase == pytest.approx(3, rel=1e-12)


def test_conditionally_stable_loop_has_a_lower_gain_margin() -> None:
    """L = k (s + 1)^2/s^3 is stable for k > 1/2 only."""
    found = of([2, 4, 2], [1, 0, 0, 0])
    assert found.gain_decrease == pytest.approx(0.25, rel=1e-9)
    assert found.gain_increase == math.inf


def test_pure_integrator_has_the_limits_of_its_curves() -> None:
    """L = 1/s: Ms = Mt = 1, bandwidth and crossover 1, a quarter turn of phase."""
    found = of([1], [1, 0])
    assert found.sensitivity.value == pytest.approx(1, abs=1e-9)
    assert found.complementary_sensitivity.value == pytest.approx(1, abs=1e-9)
    assert found.bandwidth == pytest.approx(1, rel=1e-12)
    assert found.delay_margin == pytest.approx(math.pi / 2, rel=1e-12)


def test_crossings_on_a_point_of_the_grid_are_found() -> None:
    """L = 1/s crosses one at 1 rad, which is a point of this grid; its bandwidth is there too."""
    found = margins(TransferFunction([1], [1, 0]).response, np.geomspace(1e-6, 1e6, 13))
    assert found.crossover == pytest.approx(1, rel=1e-12)
    assert found.bandwidth == pytest.approx(1, rel=1e-12)


def test_gain_at_all_frequencies_tolerates_no_dead_time() -> None:
    """L = 2 + 1/s never falls below one: the delay margin is zero, the phase margin infinite."""
    found = of([2, 1], [1, 0])
    assert found.delay_margin == 0
    assert found.phase_margin == math.inf


def test_process_zeros_on_the_axis_are_harmless() -> None:
    """A notch at 1 rad makes L exactly zero there."""
    found = of([1, 0, 1], [1, 3, 3, 1, 0])
    assert math.isfinite(found.crossover)
    assert found.sensitivity.value > 1


@settings(max_examples=30, deadline=None)
@given(
    gain=st.floats(0.1, 5),
    lags=st.lists(st.floats(0.1, 10), min_size=2, max_size=4),
)
def test_agrees_with_an_independent_implementation(gain: float, lags: list[float]) -> None:
    """python-control finds the same gain, phase and modulus margins."""
    den = np.array([1.0, 0.0])
    for lag in lags:
        den = np.polymul(den, [lag, 1])
    theirs = control.stability_margins(control.tf([gain], den))
    poles = np.roots(np.polyadd(den, [gain]))
    if np.max(poles.real) > -1e-3:
        return  # margins of an unstable loop mean nothing
    found = of([gain], den.tolist())
    if found.gain_increase < 1000:
        assert found.gain_increase == pytest.approx(theirs[0], rel=1e-6)
    assert found.phase_margin == pytest.approx(theirs[1], rel=1e-6)
    assert found.crossover == pytest.approx(theirs[4], rel=1e-6)
    assert 1 / found.sensitivity.value == pytest.approx(theirs[2], rel=1e-4)


@pytest.mark.parametrize("dead_time", [0.0, 1.0])
def test_parallel_closed_form_equals_the_general_one(dead_time: float) -> None:
    """What a unit of a parallel plant sees equals the Schur complement of its matrix."""
    interaction = TransferFunction([0.4], [20, 1], dead_time / 2)
    plant = ParallelPlant(4, TransferFunction([1], [100, 1], dead_time), interaction)
    general = MatrixPlant([[plant.element(row, column) for column in range(4)] for row in range(4)])
    loops = (FAST, SLOW, FAST, Controller(5, 50, 2))
    omega = np.geomspace(1e-3, 10, 30)
    for unit in range(4):
        parallel = loop_transfer(plant, loops, unit)(omega)
        assert parallel == pytest.approx(loop_transfer(general, loops, unit)(omega), rel=1e-9)


def test_one_plus_l_is_a_quotient_of_determinants() -> None:
    """1 + L_k = det(I + G C) / det(I + G C without loop k)."""
    plant = first_order(3, 1, 100, 0.5, 1.0)
    loops = (FAST, SLOW, Controller(5, 50))
    omega = np.geomspace(1e-2, 1, 5)
    G = plant.response(omega)
    C = np.stack([loop.response(omega) for loop in loops], axis=1)
    whole = np.linalg.det(np.eye(3) + G * C[:, None, :])
    rest = np.linalg.det(np.eye(2) + G[:, 1:, 1:] * C[:, None, 1:])
    assert 1 + loop_transfer(plant, loops, 0)(omega) == pytest.approx(whole / rest, rel=1e-9)


def test_gain_margin_is_the_limit_of_stability() -> None:
    """With the others closed, one gain raised to just below its margin is stable, above not."""
    plant = first_order(3, 1, 100, 0.6, 1.0)
    loops = (Controller(20, 65), Controller(10, 20), Controller(15, 30))
    for row in loop_margins(plant, loops):
        (unit,) = row.units
        assert row.together is not None
        for factor, stable in ((0.999, True), (1.001, False)):
            changed = list(loops)
            changed[unit] = scaled(loops[unit], factor * row.together.gain_increase)
            assert is_stable(plant, changed) is stable


def test_delay_margin_is_the_limit_of_stability() -> None:
    """A single loop with its delay margin added to the dead time is on the verge."""
    plant = first_order(1, 1, 100, 0, 1.0)
    loops = (Controller(30, 20),)
    (row,) = loop_margins(plant, loops)
    assert row.alone is not None
    for factor, stable in ((0.999, True), (1.001, False)):
        later = first_order(1, 1, 100, 0, 1.0 + factor * row.alone.delay_margin)
        assert is_stable(later, loops) is stable


def test_alone_is_the_unit_without_the_others() -> None:
    """Margins alone are those of g c, and of the sub-system with one unit in service."""
    plant = first_order(2, 1, 100, 0.949, 1.0)
    rows = loop_margins(plant, (FAST, SLOW))
    for row, loop in zip(rows, (FAST, SLOW), strict=True):
        (single,) = loop_margins(*subsystem(plant, (FAST, SLOW), row.units))
        assert row.alone == single.alone
        assert single.alone == single.together
        k, tau_i = loop.gain, loop.integral_time
        direct = margins(
            TransferFunction([k * tau_i, k], [100 * tau_i, tau_i, 0], 1.0).response, OMEGA
        )
        assert row.alone is not None
        assert row.alone.gain_increase == pytest.approx(direct.gain_increase, rel=1e-9)
        assert row.alone.sensitivity.value == pytest.approx(direct.sensitivity.value, rel=1e-9)


def test_without_interaction_alone_and_together_agree() -> None:
    """Loops that do not interact have the same margins either way."""
    for row in loop_margins(first_order(3, 1, 100, 0.0, 1.0), (FAST, SLOW, FAST)):
        assert row.alone is not None
        assert row.together is not None
        assert row.together.gain_increase == pytest.approx(row.alone.gain_increase, rel=1e-9)
        assert row.together.delay_margin == pytest.approx(row.alone.delay_margin, rel=1e-9)
        assert row.together.bandwidth == pytest.approx(row.alone.bandwidth, rel=1e-9)


def test_equal_units_of_a_parallel_plant_are_answered_once() -> None:
    """A thousand units in two groups give two rows; a matrix plant's loops are all different."""
    rows = loop_margins(first_order(1000, 1, 100, 0.0006), (FAST,) * 400 + (SLOW,) * 600)
    assert [len(row.units) for row in rows] == [400, 600]
    lag, none = TransferFunction([1], [100, 1]), TransferFunction([0], [1])
    rows = loop_margins(MatrixPlant([[lag, none], [none, lag]]), (FAST, FAST))
    assert [row.units for row in rows] == [(0,), (1,)]


def test_unstable_arrangements_have_no_margins() -> None:
    """A loop unstable alone, and a set unstable together, are told apart."""
    plant = first_order(2, 1, 10, 0.9, 1.0)
    hot, mild = Controller(40, 10), Controller(1, 10)
    rows = loop_margins(plant, (hot, mild))
    assert rows[0].alone is None
    assert rows[1].alone is not None
    assert all(row.together is None for row in rows)
    (row,) = loop_margins(plant, (hot, hot))
    assert row.alone is None
    assert row.together is None


def test_unstable_processes_are_refused() -> None:
    """Margins need an open-loop stable or integrating process."""
    plant = first_order(1, 1, 100, 0)
    bad = ParallelPlant(1, TransferFunction([1], [100, -1]), plant.interaction)
    with pytest.raises(UnsupportedPlantError):
        loop_margins(bad, (FAST,))


@pytest.mark.parametrize("near", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("coupling", [0.03, 0.1])
def test_a_resonance_of_the_other_loops_is_not_missed(near: float, coupling: float) -> None:
    """Loop 2 rings alone; through weak coupling loop 1 sees it in a band narrower than any grid."""
    plant = MatrixPlant(
        [
            [TransferFunction([1], [10, 1]), TransferFunction([coupling], [5, 1])],
            [TransferFunction([coupling], [5, 1]), TransferFunction([1], [1, 3, 3, 1])],
        ]
    )
    loops = [Controller(3, 10), Controller(8 * (1 - near), 1e4)]
    assert is_stable(plant, loops)
    found = loop_margins(plant, loops)[0].together
    assert found is not None
    # 1/(s + 1)^3 oscillates at sqrt(3) under the gain 8.
    aside = np.geomspace(1e-10, 1e-1, 4000)
    L = loop_transfer(plant, loops, 0)(math.sqrt(3) * np.concatenate([1 - aside, 1 + aside]))
    assert found.sensitivity.value >= np.abs(1 / (1 + L)).max() * (1 - 1e-9)
    assert found.complementary_sensitivity.value >= np.abs(L / (1 + L)).max() * (1 - 1e-9)
    # The gain margin holds: stable just inside, unstable just outside.
    for factor, stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        gain = factor * found.gain_increase
        assert is_stable(plant, [scaled(loops[0], gain), loops[1]]) == stable


def test_unstable_loops_say_how_far_to_reduce_each_gain() -> None:
    """20/(s + 1)^3 without reset is stable below 8: factor 0.4; the loop beside it has none."""
    lag = TransferFunction([1], [1, 3, 3, 1])
    none, other = TransferFunction([0], [1]), TransferFunction([1], [1, 1])
    plant = MatrixPlant([[lag, none], [none, other]])
    loops = [Controller(20, None), Controller(1, 1)]
    first, second = loop_margins(plant, loops)
    assert first.alone is None
    assert first.alone_factor == pytest.approx(0.4, rel=2e-3)
    assert first.together_factor == pytest.approx(0.4, rel=2e-3)
    assert second.alone is not None
    assert second.alone_factor is None
    assert second.together_factor is None


def test_two_loops_unstable_together_have_a_factor_each() -> None:
    """Stable just below each factor and unstable just above, the other loop as it is."""
    plant = first_order(2, 1, 100, 0.9, 10)
    loops = [Controller(8, 100), Controller(9, 50)]
    assert not is_stable(plant, loops)
    for unit, row in enumerate(loop_margins(plant, loops)):
        assert row.together is None
        assert row.together_factor is not None
        for factor, stable in ((0.998, True), (1.003, False)):
            changed = list(loops)
            changed[unit] = scaled(loops[unit], factor * row.together_factor)
            assert is_stable(plant, changed) is stable


@pytest.mark.parametrize("seed", range(8))
def test_peaks_of_sensitivities_are_those_that_a_proof_brackets(seed: int) -> None:
    """Ms and Mt of single unusual loops: |w_P S| and |w_I T| with both weights 1, proven."""
    drawn = draw_any(np.random.default_rng(seed))
    plant, loops = subsystem(drawn.plant, drawn.loops, (0,))
    (found,) = loop_margins(plant, loops)
    if found.alone is None:
        return
    one = Performance(max_peak=1 + 1e-12, offset=1 - 1e-12, tau_p=drawn.performance.tau_p)
    axis = proven_peaks(plant, Uncertainty(TransferFunction([1], [1])), one, loops)
    for mine, proven, top in (
        (found.alone.sensitivity, axis.proven[2], axis.peaks.nominal_performance),
        (found.alone.complementary_sensitivity, axis.proven[1], axis.peaks.robust_stability),
    ):
        assert mine.value >= top.value * (1 - 1e-6)
        assert mine.value <= top.value * (1 + BRACKET) or not proven
