"""Step responses against analytic solutions, Laplace transforms and the sources' figures."""

from math import exp, factorial, pi, sqrt

import laplace
import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.simulation import integrator
from solver.simulation.actuators import CoupledActuators, OwnActuators
from solver.simulation.directions import difficult_direction, easy_direction
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.integrator import End
from solver.simulation.loops import Limits, Loop
from solver.simulation.step_response import StepResponse, step_response

SETPOINT = Step(StepKind.SETPOINT, 0, 0.0, 1.0)
INTEGRATOR = MatrixPlant([[TransferFunction([1], [1, 0])]])
WOOD_BERRY = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)
ROSENBROCK = MatrixPlant(
    [
        [TransferFunction([1], [1, 1]), TransferFunction([2], [1, 3])],
        [TransferFunction([1], [1, 1]), TransferFunction([1], [1, 1])],
    ]
)
JOHANSSON = MatrixPlant(
    [
        [
            TransferFunction([100], np.poly([-1, -10, -10])),
            TransferFunction([200], np.poly([-3, -10, -10])),
        ],
        [TransferFunction([100], np.poly([-1, -10, -10]))] * 2,
    ]
)


def delayed_integrator(gain: float, time: np.ndarray) -> np.ndarray:
    """Return the unit step response of the loop k exp(-s)/s, by the method of steps."""
    rest = np.zeros_like(time)
    for m in range(int(time.max()) + 1):
        rest += np.where(time >= m, (-gain * (time - m)) ** m / factorial(m), 0.0)
    return 1 - rest


def setpoints(sizes: np.ndarray | tuple[float, ...]) -> tuple[Step, ...]:
    """Return steps of these sizes at time zero, one a unit."""
    return tuple(Step(StepKind.SETPOINT, unit, 0.0, float(s)) for unit, s in enumerate(sizes) if s)


def response_of(result: StepResponse, unit: int) -> np.ndarray:
    """Return the output of a unit."""
    return next(each.output for each in result.responses if unit in each.units)


@pytest.mark.parametrize("gain", [0.3, 1.0, 1.5])
def test_delayed_integrator_follows_the_method_of_steps(gain: float) -> None:
    """A proportional loop around exp(-s)/s equals its analytic solution."""
    plant = MatrixPlant([[TransferFunction([1], [1, 0], 1)]])
    result = step_response(Experiment(plant, (Loop(gain),), (SETPOINT,), 12.0, samples=1201))
    assert result.end is End.COMPLETE
    np.testing.assert_allclose(
        result.responses[0].output, delayed_integrator(gain, result.time), atol=1e-9
    )


def test_two_incommensurate_dead_times_follow_the_method_of_steps() -> None:
    """A loop disturbing another one through another dead time equals its analytic solution."""
    cross, k = sqrt(2), 0.7
    delay = TransferFunction([1], [1, 0], 1)
    plant = MatrixPlant(
        [
            [delay, TransferFunction([0], [1])],
            [TransferFunction([1], [1, 0], cross), delay],
        ]
    )
    result = step_response(Experiment(plant, (Loop(k), Loop(k)), (SETPOINT,), 10.0, samples=1001))
    # Y_2 = k exp(-sqrt(2) s)/(s + k exp(-s))^2, a series in exp(-s).
    exact = np.zeros_like(result.time)
    for m in range(10):
        late = np.clip(result.time - cross - m, 0, None)
        exact += k * (m + 1) * (-k) ** m * late ** (m + 1) / factorial(m + 1)
    np.testing.assert_allclose(response_of(result, 1), exact, atol=1e-9)


@pytest.mark.parametrize("units", [2, 3, 1000])
def test_directions_of_a_parallel_plant_are_single_loops(units: int) -> None:
    """With tau_I = tau both directions are the delayed integrator, with gains g + (n-1)i, g - i."""
    interaction, gain = 0.5 / (units - 1), 60.0
    plant = first_order(units, 1.0, 100.0, interaction, 1.0)
    loops = (Loop(gain, 100.0),) * units
    for direction, mode in (
        (easy_direction(plant), 1 + (units - 1) * interaction),
        (difficult_direction(plant), 1 - interaction),
    ):
        result = step_response(Experiment(plant, loops, setpoints(direction), 10.0))
        exact = delayed_integrator(gain * mode / 100, result.time)
        for unit in (0, units - 1):
            np.testing.assert_allclose(
                response_of(result, unit), direction[unit] * exact, atol=1e-9
            )


def test_no_dead_time_equals_the_partial_fractions() -> None:
    """A stiff loop, time constants 1e-6 and 1, equals its two exponentials."""
    plant = MatrixPlant([[TransferFunction([1], np.polymul([1e-6, 1], [1, 1]))]])
    result = step_response(Experiment(plant, (Loop(2.0, 1.0),), (SETPOINT,), 5.0))
    poles = np.roots([1e-6, 1, 2])
    weights = np.linalg.solve([[1, 1], poles], [-1, 0])
    exact = 1 + np.exp(np.outer(result.time, poles)) @ weights
    np.testing.assert_allclose(result.responses[0].output, exact, atol=1e-8)


def test_pure_dead_time_keeps_its_jumps() -> None:
    """Around 0.5 exp(-s) a proportional loop is a recursion, whose jumps do not smear."""
    plant = MatrixPlant([[TransferFunction([0.5], [1], 1)]])
    result = step_response(Experiment(plant, (Loop(1.2),), (SETPOINT,), 20.0, samples=41))
    value, exact = 0.0, []
    for index in range(41):
        if index and index % 2 == 0:
            value = 0.6 * (1 - value)
        exact.append(value)
    # At a jump the value after it; the last sample stands before the jump at 20.
    exact[-1] = exact[-2]
    np.testing.assert_allclose(result.responses[0].output, exact, atol=1e-12)


def test_algebraic_loop_is_solved() -> None:
    """A process that reacts at once under proportional control jumps to k/(1 + k)."""
    plant = MatrixPlant([[TransferFunction([1, 2], [1, 1])]])
    result = step_response(Experiment(plant, (Loop(3.0),), (SETPOINT,), 4.0))
    # y = 3 (s + 2)/(4 s + 7) r
    exact = 6 / 7 + (3 / 4 - 6 / 7) * np.exp(-7 / 4 * result.time)
    np.testing.assert_allclose(result.responses[0].output, exact, atol=1e-10)


def test_algebraic_loop_without_solution_is_refused() -> None:
    """A direct loop gain of exactly one is an error, not a division by zero."""
    plant = MatrixPlant([[TransferFunction([1, 2], [1, 1])]])
    with pytest.raises(InvalidInputError, match="no solution"):
        step_response(Experiment(plant, (Loop(-1.0),), (SETPOINT,), 4.0))


@pytest.mark.parametrize("s", [0.1, 1.0])
def test_wood_berry_has_the_laplace_transform_of_its_loops(s: float) -> None:
    """Four dead times, PID with set-point weights and all kinds of steps: the transforms agree."""
    experiment = Experiment(
        WOOD_BERRY,
        (Loop(0.375, 8.29, 0.5, 0.3, 0.0), Loop(-0.075, 23.6, 1.0, 0.5, 0.2)),
        (
            SETPOINT,
            Step(StepKind.LOAD, 1, 10.0, 0.3),
            Step(StepKind.MEASUREMENT, 0, 17.3, 0.1),
            Step(StepKind.INPUT, 1, 3.1, -0.2),
        ),
        250.0,
    )
    np.testing.assert_allclose(
        laplace.simulated(experiment, s), laplace.exact(experiment, s), rtol=1e-8
    )


@pytest.mark.parametrize("seed", range(6))
def test_random_loops_have_the_laplace_transform_of_their_loops(seed: int) -> None:
    """Random plants, orders, dead times and open or closed loops: the transforms agree."""
    rng = np.random.default_rng(seed)

    def element() -> TransferFunction:
        dead_time = float(rng.uniform(0.3, 2)) if rng.random() < 0.5 else 0.0
        if dead_time == 0 and rng.random() < 0.3:
            return TransferFunction([rng.normal(), 1.0], [1.0, rng.uniform(0.5, 3)])
        return TransferFunction(rng.normal(size=2), np.poly(-rng.uniform(0.3, 3, 2)), dead_time)

    plant = MatrixPlant([[element() for _ in range(2)] for _ in range(2)])
    experiment = laplace.random_experiment(rng, plant, 40.0)
    exact = laplace.exact(experiment, 0.8)
    np.testing.assert_allclose(
        laplace.simulated(experiment, 0.8), exact, atol=1e-8 * np.abs(exact).max()
    )


def test_perturbed_actuators_have_the_laplace_transform_of_their_loops() -> None:
    """Gain errors, lags and dead time of the actuators act as factors of the inputs."""
    experiment = Experiment(
        first_order(2, 1.0, 10.0, -0.4),
        (Loop(2.0, 8.0), Loop(1.5, 5.0)),
        setpoints((1.0, -0.5)),
        120.0,
        actuators=OwnActuators(
            (TransferFunction([1.2], [0.3, 1], 0.7), TransferFunction([-0.3, 0.8], [0.4, 1]))
        ),
    )
    np.testing.assert_allclose(
        laplace.simulated(experiment, 0.3), laplace.exact(experiment, 0.3), rtol=1e-8
    )


def test_coupled_actuators_reduce_to_own_ones() -> None:
    """A rank-one perturbation that touches one input only is an actuator of that input."""
    plant, loops = first_order(2, 1.0, 10.0, 0.3), (Loop(2.0, 8.0), Loop(1.5, 5.0))
    weight, factor = TransferFunction([0.5], [1, 1]), TransferFunction([-1, 2], [1, 2])
    one, nothing = TransferFunction([1], [1]), TransferFunction([0], [1])
    coupled = CoupledActuators(weight, (factor, nothing), (one, nothing))
    # The product of both, added to one, over the common denominator.
    own = OwnActuators((TransferFunction([1, 2.5, 3], [1, 3, 2]), one))
    results = [
        step_response(Experiment(plant, loops, (SETPOINT,), 30.0, actuators=actuators))
        for actuators in (coupled, own)
    ]
    for unit in (0, 1):
        np.testing.assert_allclose(
            response_of(results[0], unit), response_of(results[1], unit), atol=1e-9
        )


def test_equal_units_are_simulated_once_and_exactly() -> None:
    """Six units of four kinds, with limits and actuators, equal the plant written out in full."""
    plant = ParallelPlant(6, TransferFunction([1], [8, 1], 0.5), TransferFunction([0.3], [3, 1], 1))
    fast, slow = Loop(3.0, 6.0), Loop(1.0, 9.0, 0.5)
    experiment = {
        "loops": (fast, fast, fast, slow, slow, slow),
        "steps": (
            SETPOINT,
            Step(StepKind.SETPOINT, 1, 0.0, 1.0),
            Step(StepKind.LOAD, 4, 10.0, 0.2),
        ),
        "duration": 30.0,
        "limits": (Limits(-1.5, 1.5),) * 6,
        "actuators": OwnActuators((TransferFunction([1.1], [1]),) * 6),
    }
    size = range(6)
    full = MatrixPlant([[plant.element(row, column) for column in size] for row in size])
    reduced, written_out = (
        step_response(Experiment(each, **experiment))  # type: ignore[arg-type]
        for each in (plant, full)
    )
    assert [each.units for each in reduced.responses] == [(0, 1), (2,), (3, 5), (4,)]
    for unit in size:
        np.testing.assert_allclose(
            response_of(reduced, unit), response_of(written_out, unit), atol=1e-8
        )


def test_time_unit_is_the_callers() -> None:
    """Seconds instead of minutes: the same response, stretched."""
    slow = step_response(
        Experiment(first_order(2, 1.0, 10.0, 0.5, 1.0), (Loop(3.0, 8.0),) * 2, (SETPOINT,), 40.0)
    )
    fast = step_response(
        Experiment(
            first_order(2, 1.0, 600.0, 0.5, 60.0), (Loop(3.0, 480.0),) * 2, (SETPOINT,), 2400.0
        )
    )
    np.testing.assert_allclose(slow.responses[0].output, fast.responses[0].output, atol=1e-9)


def test_measures_of_a_first_order_response() -> None:
    """1 - exp(-k t): rise time ln 9/k, settling ln 50/k, integrals 1/k and 1/(2k), variation 2k."""
    k = 0.8
    metrics = (
        step_response(Experiment(INTEGRATOR, (Loop(k),), (SETPOINT,), 40.0)).responses[0].metrics
    )
    assert metrics.set_point is not None
    assert metrics.set_point.rise_time == pytest.approx(np.log(9) / k, rel=1e-8)
    assert metrics.set_point.settling_time == pytest.approx(np.log(50) / k, rel=1e-8)
    assert metrics.set_point.overshoot == pytest.approx(0, abs=1e-9)
    assert metrics.absolute_error == pytest.approx(1 / k, rel=1e-8)
    assert metrics.squared_error == pytest.approx(1 / (2 * k), rel=1e-8)
    assert metrics.largest_error == 1
    assert metrics.input_variation == pytest.approx(2 * k, rel=1e-8)


def test_overshoot_of_a_second_order_response() -> None:
    """Overshoot exp(-pi zeta/sqrt(1 - zeta^2)), however coarse the samples."""
    zeta = 0.3
    plant = MatrixPlant([[TransferFunction([1], [1, 2 * zeta, 0])]])
    result = step_response(Experiment(plant, (Loop(1.0),), (SETPOINT,), 60.0, samples=2))
    measured = result.responses[0].metrics.set_point
    assert measured is not None
    assert measured.overshoot == pytest.approx(exp(-pi * zeta / sqrt(1 - zeta**2)), rel=1e-8)


def test_measures_stop_at_the_next_step() -> None:
    """A load step after the set-point change counts as an error, not as overshoot."""
    steps = (SETPOINT, Step(StepKind.LOAD, 0, 20.0, 5.0))
    metrics = step_response(Experiment(INTEGRATOR, (Loop(1.0),), steps, 40.0)).responses[0].metrics
    assert metrics.set_point is not None
    assert metrics.set_point.overshoot < 1e-8
    assert metrics.set_point.settling_time == pytest.approx(np.log(50), rel=1e-8)
    assert metrics.largest_error == pytest.approx(5.0, rel=1e-6)


SECOND_ORDER = MatrixPlant([[TransferFunction([1], [1, 0.6, 0], dead_time=0.2)]])


@pytest.mark.parametrize("moment", [1e-3, 1.0, 37.3])
def test_a_late_step_is_measured_like_one_at_once(moment: float) -> None:
    """Rise, settling, overshoot do not depend on when the step is made."""
    measured = [
        step_response(
            Experiment(
                SECOND_ORDER, (Loop(0.3),), (Step(StepKind.SETPOINT, 0, at, 2.0),), at + 60.0
            )
        )
        .responses[0]
        .metrics.set_point
        for at in (0.0, moment)
    ]
    first, late = measured
    assert first is not None
    assert late is not None
    assert first.rise_time
    assert late.rise_time == pytest.approx(first.rise_time, rel=1e-6)
    assert late.settling_time == pytest.approx(first.settling_time, rel=1e-6)
    assert late.overshoot == pytest.approx(first.overshoot, rel=1e-6)


def test_every_set_point_change_has_its_measures() -> None:
    """Of three changes, up, further up and back, each is measured as the first one is."""
    steps = tuple(
        Step(StepKind.SETPOINT, 0, time, size) for time, size in ((0, 1), (80, 3), (160, -4))
    )
    result = step_response(Experiment(SECOND_ORDER, (Loop(0.3, 50.0),), steps, 240.0))
    metrics = result.responses[0].metrics
    assert [event.change for event in metrics.events] == [1, 3, -4]
    reference = step_response(Experiment(SECOND_ORDER, (Loop(0.3, 50.0),), steps[:1], 80.0))
    first = reference.responses[0].metrics.set_point
    assert first is not None
    assert first.settling_time is not None
    assert metrics.set_point == metrics.events[0].set_point
    for event in metrics.events:
        assert event.set_point is not None
        assert event.set_point.rise_time == pytest.approx(first.rise_time, rel=1e-2)
        assert event.set_point.overshoot == pytest.approx(first.overshoot, abs=1e-2)
        # The error right before and right after differ by the step.
        assert event.error_after - event.error_before == pytest.approx(event.change, abs=1e-9)
    assert metrics.absolute_error == pytest.approx(
        sum(event.absolute_error for event in metrics.events), rel=1e-9
    )
    assert metrics.input_variation == pytest.approx(
        sum(event.input_variation for event in metrics.events), rel=1e-9
    )


def test_events_on_other_units_start_a_new_window() -> None:
    """A load on loop 2 is an event of loop 1, without set-point measures."""
    steps = (SETPOINT, Step(StepKind.LOAD, 1, 20.0, 0.1))
    loops = (Loop(0.2, 4.44), Loop(-0.04, 2.67))
    result = step_response(Experiment(WOOD_BERRY, loops, steps, 60.0))
    for response in result.responses:
        first, second = response.metrics.events
        assert (first.start, first.end, second.start, second.end) == (0, 20, 20, 60)
        assert second.set_point is None
        assert second.change == 0
        assert second.error_after == pytest.approx(second.error_before, abs=1e-9)


def test_an_open_loop_has_no_error() -> None:
    """Moving a valve by hand gives the open-loop step response, and no set-point measures."""
    result = step_response(
        Experiment(JOHANSSON, (None, None), (Step(StepKind.INPUT, 1, 0.0, 1.0),), 10.0)
    )
    outputs = [response_of(result, unit)[-1] for unit in (0, 1)]
    # Johansson (1993), fig. 2: final values g_12(0) = 2/3 and g_22(0) = 1.
    np.testing.assert_allclose(outputs, [2 / 3, 1], atol=1e-3)
    assert result.responses[0].metrics.absolute_error is None
    assert result.responses[0].metrics.set_point is None


def test_limits_make_the_analytic_ramp() -> None:
    """An integrator at its input limit moves on a ramp, then exponentially."""
    experiment = Experiment(
        INTEGRATOR,
        (Loop(2.0),),
        (Step(StepKind.SETPOINT, 0, 0.0, 5.0),),
        10.0,
        limits=(Limits(-1, 1),),
    )
    result = step_response(experiment)
    time = result.time
    exact = np.where(time < 4.5, time, 5 - 0.5 * np.exp(-2 * (time - 4.5)))
    np.testing.assert_allclose(result.responses[0].output, exact, atol=1e-9)
    np.testing.assert_allclose(result.responses[0].input[time < 4.4], 1.0, atol=1e-12)


def test_limits_are_kept() -> None:
    """However the loop struggles, the input stays within its limits, from one to the other."""
    steps = (SETPOINT, Step(StepKind.SETPOINT, 0, 8.0, -2.0))
    plant = first_order(1, 1.0, 10.0, 0.0, 1.0)
    result = step_response(
        Experiment(plant, (Loop(20.0, 5.0),), steps, 30.0, limits=(Limits(-2, 3),))
    )
    moved = result.responses[0].input
    assert moved.max() == pytest.approx(3)
    assert moved.min() == pytest.approx(-2)


def test_back_calculation_prevents_windup() -> None:
    """Slow tracking winds the integrator up; tracking in the integral time does not."""
    plant = first_order(1, 1.0, 10.0, 0.0)

    def overshoot(tracking_time: float | None) -> float:
        limits = (Limits(-2.0, 2.0, tracking_time),)
        result = step_response(
            Experiment(plant, (Loop(5.0, 2.0),), (SETPOINT,), 60.0, limits=limits)
        )
        measured = result.responses[0].metrics.set_point
        assert measured is not None
        return measured.overshoot

    assert overshoot(1e6) > 1.5 * overshoot(None)


def test_limited_direct_loop_is_consistent() -> None:
    """A process that reacts at once with its input at the limit: input and output agree."""
    plant = MatrixPlant([[TransferFunction([1, 2], [1, 1])]])
    steps = (Step(StepKind.SETPOINT, 0, 0.0, 10.0),)
    result = step_response(Experiment(plant, (Loop(3.0),), steps, 8.0, limits=(Limits(-1, 1),)))
    # y = 1 + (1 - exp(-t)) at the limit
    np.testing.assert_allclose(result.responses[0].output, 2 - np.exp(-result.time), atol=1e-9)


def test_unstable_loop_ends_at_its_bound() -> None:
    """An unstable loop is returned up to the bound, flagged, and finite throughout."""
    plant = MatrixPlant([[TransferFunction([1], [1, 0], 1)]])
    result = step_response(Experiment(plant, (Loop(3.0),), (SETPOINT,), 1e4, bound=1e3))
    assert result.end is End.BOUND
    output = result.responses[0].output
    assert np.all(np.isfinite(output))
    assert 1e3 < np.abs(output).max() < 1e5
    assert result.time[-1] < 30


def test_violently_unstable_loop_is_finite() -> None:
    """Growth by exp(1000) a time unit overflows no double on the way to the bound."""
    plant = MatrixPlant([[TransferFunction([1], [1, -1000])]])
    result = step_response(Experiment(plant, (Loop(1.0),), (SETPOINT,), 200.0))
    assert result.end is End.BOUND
    assert np.all(np.isfinite(result.responses[0].output))


def test_a_large_gain_is_not_taken_for_instability() -> None:
    """Pascals per per cent: the default bound follows the gain of the plant."""
    plant = MatrixPlant([[TransferFunction([1e9], [5, 1])]])
    result = step_response(Experiment(plant, (None,), (Step(StepKind.INPUT, 0, 0.0, 1.0),), 100.0))
    assert result.end is End.COMPLETE
    assert result.responses[0].output[-1] == pytest.approx(1e9, rel=1e-6)


def test_growth_beyond_all_numbers_is_finite() -> None:
    """A pole that overflows within the shortest step ends the simulation at once, finite."""
    plant = MatrixPlant([[TransferFunction([1], [1e-12, -1e12])]])
    result = step_response(Experiment(plant, (Loop(1.0),), (SETPOINT,), 10.0))
    assert result.end is End.BOUND
    assert np.all(np.isfinite(result.responses[0].output))


def test_skogestad_figures_8_to_10() -> None:
    """SLH (1989), section 5.3: what its figures show of the two tunings, dead time 1 included."""
    plant = first_order(2, 1.0, 100.0, 0.949, 1.0)
    identical = (Loop(39.7, 65.1),) * 2
    different = (Loop(46.3, 101.0), Loop(22.8, 3.15))

    def measured(loops: tuple[Loop, ...], direction: np.ndarray) -> list:
        result = step_response(Experiment(plant, loops, setpoints(direction), 100.0))
        return [next(r for r in result.responses if unit in r.units).metrics for unit in (0, 1)]

    # Fig. 8, single loops: loop 2 of the different settings oscillates more than loop 1.
    single = first_order(1, 1.0, 100.0, 0.0, 1.0)
    overshoots = [
        step_response(Experiment(single, (loop,), (SETPOINT,), 100.0))
        .responses[0]
        .metrics.set_point
        for loop in different
    ]
    assert overshoots[1].overshoot > overshoots[0].overshoot
    # Figs. 9 and 10: the easy direction is much faster than the difficult one.
    for loops in (identical, different):
        easy = measured(loops, easy_direction(plant))
        difficult = measured(loops, difficult_direction(plant))
        for unit in (0, 1):
            assert easy[unit].set_point.rise_time < 2
            assert difficult[unit].set_point.rise_time > 5 * easy[unit].set_point.rise_time
    # Fig. 10: different settings reach the steady state faster in the difficult direction.
    settled = [m.set_point.settling_time for m in measured(different, difficult_direction(plant))]
    assert max(settled) == pytest.approx(78.1, abs=0.1)
    slow = measured(identical, difficult_direction(plant))
    assert [m.set_point.settling_time for m in slow] == [None, None]


def test_rosenbrock_at_the_gains_of_example_11_3() -> None:
    """Astrom and Hagglund, ex. 11.3: k = k_i = 2 settles; three times that is unstable."""
    steps = (SETPOINT, Step(StepKind.SETPOINT, 1, 15.0, 1.0))
    calm = step_response(Experiment(ROSENBROCK, (Loop(2.0, 1.0),) * 2, steps, 40.0))
    assert [response_of(calm, unit)[-1] for unit in (0, 1)] == pytest.approx([1, 1], abs=1e-3)
    wild = step_response(Experiment(ROSENBROCK, (Loop(6.0, 1.0),) * 2, steps, 400.0))
    assert wild.end is End.BOUND


def test_johansson_figures_12_and_13() -> None:
    """Johansson (1993), section 5: K_c = 2.46 oscillates at T_i = 0.56, not at three times it."""
    measured = []
    for integral_time in (0.56, 1.68):
        loops = (Loop(2.46, integral_time),) * 2
        result = step_response(Experiment(JOHANSSON, loops, (SETPOINT,), 60.0))
        assert result.end is End.COMPLETE
        measured.append(result.responses[0].metrics)
    wild, calm = measured
    assert wild.set_point is not None
    assert wild.set_point.overshoot == pytest.approx(0.563, abs=1e-3)
    assert wild.set_point.settling_time is None
    assert calm.set_point is not None
    assert calm.set_point.overshoot < 1e-6
    assert calm.set_point.settling_time == pytest.approx(10.05, abs=0.01)
    assert wild.input_variation > 10 * calm.input_variation


def test_static_decoupler_distributes_the_controllers() -> None:
    """Astrom and Hagglund, ex. 11.5, set-point weight 0: h_12 stays small, h_21 is zero."""
    decoupler = np.linalg.inv(ROSENBROCK.static_gain())
    experiment = Experiment(
        ROSENBROCK,
        (Loop(0.2975, 0.2975 / 0.3420, setpoint_weight=0.0), Loop(0.23, 1.0, setpoint_weight=0.0)),
        (SETPOINT, Step(StepKind.SETPOINT, 1, 30.0, 1.0)),
        60.0,
        distribution=decoupler,
    )
    result = step_response(experiment)
    first, second = (response_of(result, unit) for unit in (0, 1))
    before = result.time < 30
    assert np.abs(second[before]).max() < 1e-8
    assert np.abs(first[~before] - 1).max() < 0.3


def test_two_motors_drift_apart_and_one_integrator_cures_it() -> None:
    """Astrom and Hagglund, section 11.4: a measurement pulse shifts the load between PI loops."""
    motors = MatrixPlant([[TransferFunction([1], [1, 0.1])] * 2] * 2)
    steps = (
        SETPOINT,
        Step(StepKind.SETPOINT, 1, 0.0, 1.0),
        Step(StepKind.LOAD, 0, 10.0, -1.0),
        Step(StepKind.MEASUREMENT, 1, 20.0, 1.0),
        Step(StepKind.MEASUREMENT, 1, 21.0, -1.0),
    )
    pi_loop = Loop(1.0, 1.0)
    drifting = step_response(Experiment(motors, (pi_loop, pi_loop), steps, 60.0))
    torques = [each.input[-1] for each in drifting.responses]
    # The pulse adds its integral times K/T_i to the difference, where nothing takes it back.
    assert torques[0] - torques[1] == pytest.approx(1.0, abs=1e-3)
    shared = step_response(
        Experiment(
            motors,
            (Loop(2.0, 1.0), None),
            [step for step in steps if step.unit == 0],  # the other one has no loop to step
            60.0,
            distribution=np.array([[0.5, 0.0], [0.5, 0.0]]),
        )
    )
    torques = [each.input[-1] for each in shared.responses]
    assert torques[0] == torques[1] == pytest.approx(0.55, abs=1e-3)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"loops": (Loop(1.0),)}, "/loops"),
        ({"steps": ()}, "/steps"),
        ({"steps": (SETPOINT, Step(StepKind.LOAD, 2, 0.0, 1.0))}, "/steps/1/unit"),
        ({"duration": 0.0}, "/duration"),
        ({"duration": float("nan")}, "/duration"),
        ({"samples": 1}, "/samples"),
        ({"bound": -1.0}, "/bound"),
        ({"limits": (Limits(-1, 1),)}, "/limits"),
        ({"actuators": OwnActuators((TransferFunction([1], [1]),))}, "/actuators"),
        ({"distribution": np.eye(3)}, "/distribution"),
        ({"distribution": np.full((2, 2), np.nan)}, "/distribution"),
    ],
)
def test_contradictory_experiments_name_the_field(change: dict, field: str) -> None:
    """Wrong numbers and dimensions are refused with a pointer."""
    good = {
        "plant": first_order(2, 1.0, 10.0, 0.5),
        "loops": (Loop(1.0, 5.0),) * 2,
        "steps": (SETPOINT,),
        "duration": 10.0,
    }
    with pytest.raises(InvalidInputError) as caught:
        Experiment(**(good | change))
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: Step(StepKind.LOAD, 0, -1.0, 1.0), "/time"),
        (lambda: Step(StepKind.LOAD, 0, 0.0, 0.0), "/size"),
        (lambda: Step(StepKind.LOAD, 0, 0.0, float("inf")), "/size"),
        (lambda: Loop(0.0), "/gain"),
        (lambda: Loop(1.0, -1.0), "/integral_time"),
        (lambda: Loop(1.0, 1.0, 0.0), "/derivative_time"),
        (lambda: Loop(1.0, setpoint_weight=1.5), "/setpoint_weight"),
        (lambda: Limits(1.0, 2.0), "/low"),
        (lambda: Limits(0.0, 0.0), "/low"),
        (lambda: Limits(-1.0, 1.0, 0.0), "/tracking_time"),
        (lambda: OwnActuators((TransferFunction([1], [1, -1]),)), "/0/den"),
        (
            lambda: CoupledActuators(TransferFunction([1], [1, 0]), (), ()),
            "/weight/den",
        ),
        (
            lambda: CoupledActuators(TransferFunction([1], [1]), (TransferFunction([1], [1]),), ()),
            "/right",
        ),
    ],
)
def test_impossible_parts_name_the_field(build: object, field: str) -> None:
    """Each part of an experiment checks itself."""
    with pytest.raises(InvalidInputError) as caught:
        build()  # type: ignore[operator]
    assert caught.value.field == field


def test_too_short_a_dead_time_is_refused() -> None:
    """A dead time of a millionth of the duration is refused instead of simulated for ever."""
    plant = first_order(1, 1.0, 10.0, 0.0, 1e-5)
    with pytest.raises(InvalidInputError, match="dead time") as caught:
        step_response(Experiment(plant, (Loop(1.0),), (SETPOINT,), 10.0))
    assert caught.value.field == "/duration"


def test_too_many_different_units_are_refused() -> None:
    """A thousand units, each with its own step, are more than a simulation holds."""
    plant = first_order(1000, 1.0, 10.0, 0.0005)
    steps = tuple(Step(StepKind.SETPOINT, unit, 0.0, 1.0 + unit) for unit in range(1000))
    with pytest.raises(InvalidInputError, match="kinds") as caught:
        step_response(Experiment(plant, (Loop(1.0, 5.0),) * 1000, steps, 10.0))
    assert caught.value.field == "/steps"


def test_endless_jumps_end_at_the_step_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dead times without common measure around direct paths breed jumps without end: flagged."""
    monkeypatch.setattr(integrator, "MAX_STEPS", 1000)
    delays = [[0.01, 0.01 * sqrt(2)], [0.01 * sqrt(3), 0.01 * sqrt(5)]]
    plant = MatrixPlant([[TransferFunction([0.4], [1], d) for d in row] for row in delays])
    result = step_response(Experiment(plant, (Loop(1.0), Loop(0.9)), (SETPOINT,), 9.0))
    assert result.end is End.STEP_LIMIT
    assert np.all(np.isfinite(result.responses[0].output))


def test_a_derivative_that_vanishes_does_not_cost_the_simulation() -> None:
    """Ten nanoseconds of derivative in a response of minutes are left out; seconds are not."""
    fleeting, seen = Loop(20.0, 50.0, 1e-8), Loop(20.0, 50.0, 1.0)
    assert fleeting.without_traces(100.0) == Loop(20.0, 50.0)
    assert seen.without_traces(100.0) == seen
    bare = Loop(20.0, 50.0, 1.0, filter_time=1e-12)
    assert bare.without_traces(100.0) == bare
