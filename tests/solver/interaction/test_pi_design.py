"""PI design: published optima, brute force on a grid, invariance, detuning, refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.interaction.loop_shape import LoopShape, RobustnessLimits
from solver.interaction.pi_design import DesignStatus, PIDesign, design_pi
from solver.interaction.sampling import dense_frequencies
from solver.interaction.weighted_sum import WeightedSum
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.transfer_function import TransferFunction

LIMITS = RobustnessLimits()
WOOD_BERRY = (
    (TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)),
    (TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)),
)
DECOUPLER = np.linalg.inv([[12.8, -18.9], [6.6, -19.4]])
Q11 = WeightedSum(tuple(DECOUPLER[:, 0]), WOOD_BERRY[0])
Q22 = WeightedSum(tuple(DECOUPLER[:, 1]), WOOD_BERRY[1])
ROSENBROCK = WeightedSum(
    (3.0, -3.0), (TransferFunction([1], [1, 1]), TransferFunction([2], [1, 3]))
)


def _single(num: list[float], den: list[float], dead_time: float = 0.0) -> WeightedSum:
    return WeightedSum((1.0,), (TransferFunction(num, den, dead_time),))


def _settings(design: PIDesign) -> tuple[float, float]:
    assert design.gains is not None
    return design.gains.proportional_gain, design.gains.integral_gain


def _within(process: WeightedSum, k: float, x: np.ndarray, limits: RobustnessLimits) -> np.ndarray:
    """Whether each integral gain in x (m,) meets the limits and is stable, by plain sampling."""
    samples = dense_frequencies(process.active_terms)
    omega = np.exp(
        np.interp(np.arange(4 * samples.size) / 4, np.arange(samples.size), np.log(samples))
    )
    L = process.response(omega)[:, None] * (k - 1j * x / omega[:, None])
    F = (1 + L) * (1j * omega / (1 + 1j * omega))[:, None]
    turn = np.unwrap(np.angle(F), axis=0)
    stable = np.abs(turn[-1]) < math.pi / 2
    peak_S = np.max(1 / np.abs(1 + L), axis=0)
    peak_T = np.max(np.abs(L / (1 + L)), axis=0)
    return stable & (peak_S <= limits.max_sensitivity) & (peak_T <= limits.max_complementary)


def test_example_11_5() -> None:
    """Astrom and Hagglund, Example 11.5: k_P1 = 0.2975, k_I1 = 0.3420 at Ms = Mp = 1.6."""
    design = design_pi(ROSENBROCK, LIMITS)
    k, x = _settings(design)
    assert design.status is DesignStatus.OPTIMAL
    assert k == pytest.approx(0.2975, abs=5e-5)
    assert x == pytest.approx(0.3420, abs=5e-5)


def test_example_11_6_second_loop() -> None:
    """Astrom and Hagglund, Example 11.6: k2 = 0.5859, ki2 = 0.2978 for q22 at Ms = 1.6."""
    k, x = _settings(design_pi(Q22, LIMITS))
    assert k == pytest.approx(0.5859, abs=2e-4)
    assert x == pytest.approx(0.2978, abs=2e-4)


def test_example_11_6_first_loop_is_slightly_wrong_in_the_book() -> None:
    """Printed: k1 = 2.3481, ki1 = 1.5378, of which Ms is 1.6047; the optimum is beside it."""
    k, x = _settings(design_pi(Q11, LIMITS))
    assert k == pytest.approx(2.36294, abs=1e-5)
    assert x == pytest.approx(1.53721, abs=1e-5)
    printed, _ = LoopShape.of(Q11).peaks(2.3481, 1.5378)
    assert printed.value == pytest.approx(1.6047, abs=1e-4)


@pytest.mark.parametrize(
    ("process", "limits"),
    [
        (ROSENBROCK, LIMITS),
        (ROSENBROCK, RobustnessLimits(2.0, 1.1)),
        (Q11, LIMITS),
        (Q11, RobustnessLimits(2.0, 1.3)),
        (Q22, RobustnessLimits(1.4, 1.4)),
        (_single([1], [1, 0.1, 1], 0.1), LIMITS),
        (_single([1], [1], 1), LIMITS),
        (_single([1], [1, 4, 6, 4, 1]), RobustnessLimits(1.4, 900)),
        (_single([-0.3, 1], [0.2, 0.5, 1]), RobustnessLimits(1.8, 1.2)),
    ],
)
def test_no_grid_point_beats_the_optimum(process: WeightedSum, limits: RobustnessLimits) -> None:
    """A grid over (k, k_I) has no permitted point above the optimum, and one just below it."""
    design = design_pi(process, limits)
    k, x = _settings(design)
    higher = x * np.geomspace(1.001, 30, 8)
    scale = max(abs(k), 0.1)
    for gain in np.concatenate([np.linspace(-2, 4, 25) * scale, k * np.linspace(0.98, 1.02, 5)]):
        assert not np.any(_within(process, float(gain), higher, limits))
    loose = RobustnessLimits(limits.max_sensitivity * 1.0001, limits.max_complementary * 1.0001)
    assert _within(process, k, np.array([x * 0.9999]), loose)[0]


@given(
    time_constant=st.floats(0.1, 50),
    second=st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    dead_time=st.floats(0.05, 5),
    sign=st.sampled_from([-1.0, 1.0]),
    scale=st.floats(0.01, 100),
)
@settings(max_examples=3, deadline=None)
def test_gain_and_time_units_do_not_matter(
    time_constant: float, second: float, dead_time: float, sign: float, scale: float
) -> None:
    """Scaling gain and time scales the settings; one limit is met exactly."""

    def design(gain: float, unit: float) -> PIDesign:
        den = np.polymul([time_constant * unit, 1], [second * time_constant * unit, 1])
        den = np.trim_zeros(den, "f").tolist()
        return design_pi(_single([gain], den, dead_time * unit), LIMITS)

    plain, scaled = design(1.0, 1.0), design(sign * 3.0, scale)
    k, x = _settings(plain)
    k_scaled, x_scaled = _settings(scaled)
    assert x_scaled == pytest.approx(sign * x / 3 / scale, rel=1e-6)
    assert k_scaled == pytest.approx(sign * k / 3, rel=1e-4, abs=1e-4)
    assert plain.sensitivity is not None
    assert plain.complementary is not None
    excess = max(plain.sensitivity.value, plain.complementary.value) / 1.6
    assert excess == pytest.approx(1, abs=1e-6)


def test_first_order_process_has_no_finite_optimum() -> None:
    """1/(s+1) may be controlled as fast as you like: unbounded, until a limit is given."""
    process = _single([1], [1, 1])
    design = design_pi(process, LIMITS)
    assert design.status is DesignStatus.UNBOUNDED
    assert design.gains is None
    limited = design_pi(process, LIMITS, 0.234375)
    assert limited.status is DesignStatus.DETUNED
    k, x = _settings(limited)
    assert x == 0.234375
    # Both peaks are 1 from k = sqrt(1 + 2 k_I) - 1 on.
    assert k == pytest.approx(math.sqrt(1 + 2 * x) - 1, rel=1e-4)


def test_limit_beyond_all_gains_is_no_limit() -> None:
    """An integral gain that no proportional gain tried can carry leaves the loop unbounded."""
    assert design_pi(_single([1], [1, 1]), LIMITS, 1e15).status is DesignStatus.UNBOUNDED


@pytest.mark.parametrize("factor", [0.9, 0.25, 0.05])
def test_detuned_settings_have_the_lowest_peaks(factor: float) -> None:
    """No other proportional gain does better for the given integral gain."""
    _, greatest = _settings(design_pi(Q11, LIMITS))
    design = design_pi(Q11, LIMITS, factor * greatest)
    k, x = _settings(design)
    assert x == factor * greatest
    shape = LoopShape.of(Q11)
    best = max(shape.sampled_peaks(k, x))
    assert best < 1.6
    for other in np.linspace(0.0, 3.0, 31):
        if shape.is_stable(other, x):
            assert max(shape.sampled_peaks(other, x)) >= best - 1e-6


def test_detuning_joins_the_optimum() -> None:
    """A limit at the optimum, or above it, gives the optimum."""
    k, x = _settings(design_pi(Q22, LIMITS))
    assert _settings(design_pi(Q22, LIMITS, 10 * x)) == (k, x)
    near, _ = _settings(design_pi(Q22, LIMITS, x * (1 - 1e-5)))
    assert near == pytest.approx(k, rel=1e-3)


@pytest.mark.parametrize("dead_time", [0.0, 0.7])
def test_stability_is_that_of_the_poles(dead_time: float) -> None:
    """The winding number agrees with the poles of 1/(s+1)^3; dead time only makes it worse."""
    shape = LoopShape.of(_single([1], [1, 3, 3, 1], dead_time))
    for k in (-2.0, -0.5, 0.0, 1.0, 5.0, 12.0):
        for x in (0.01, 0.5, 1.9, 20.0):
            poles = np.roots(np.polyadd(np.polymul([1, 0], [1, 3, 3, 1]), [k, x]))
            without = bool(np.all(poles.real < 0))
            if dead_time:
                assert without or not shape.is_stable(k, x)
            else:
                assert shape.is_stable(k, x) is without


@pytest.mark.parametrize(
    ("process", "error"),
    [
        (_single([1], [1, 0]), UnsupportedPlantError),
        (_single([1], [1, -1]), UnsupportedPlantError),
        (_single([1, 0], [1, 1]), InvalidInputError),
    ],
)
def test_processes_without_a_design(process: WeightedSum, error: type[Exception]) -> None:
    """Integrating and unstable processes, and one without static gain, are refused."""
    with pytest.raises(error):
        design_pi(process, LIMITS)


@pytest.mark.parametrize("limit", [1.0, 0.5, math.nan, 2e3])
def test_limits_that_cannot_be_are_refused(limit: float) -> None:
    """A peak of 1 or less cannot be kept."""
    with pytest.raises(InvalidInputError) as caught:
        RobustnessLimits(max_complementary=limit)
    assert caught.value.field == "/max_complementary"
