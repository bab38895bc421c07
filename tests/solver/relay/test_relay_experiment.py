"""Relay experiments on processes whose oscillation is known, and on those that have none."""

from math import exp, log

import numpy as np
import pytest

from solver.model import memory
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.relay.analysis import RelayOutcome, relay_experiment
from solver.relay.behaviour import Behaviour
from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment, wire
from solver.simulation.experiment import Step, StepKind
from solver.simulation.loops import Loop


def alone(process: TransferFunction, relay: Relay, duration: float) -> RelayOutcome:
    """Carry out an experiment on a single process."""
    plant = MatrixPlant([[process]])
    return relay_experiment(RelayExperiment(plant, 0, 0, relay, (), duration, samples=201))


@pytest.mark.parametrize("hysteresis", [0.0, 0.1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_first_order_with_dead_time_has_the_known_period(hysteresis: float, sign: float) -> None:
    """k exp(-L s)/(T s + 1): half period and amplitude in closed form, for either sign of k."""
    gain, lag, dead_time, d = 2.0, 3.0, 1.0, 0.5
    outcome = alone(
        TransferFunction([sign * gain], [lag, 1], dead_time), Relay(sign * d, hysteresis), 80.0
    )
    high = gain * d
    # The output goes on for one dead time behind the switching level, then turns.
    peak = high - (high - hysteresis) * exp(-dead_time / lag)
    half_period = dead_time + lag * log((high + peak) / (high - hysteresis))
    cycle = outcome.cycle
    assert outcome.behaviour is Behaviour.LIMIT_CYCLE
    assert cycle is not None
    assert cycle.period == pytest.approx(2 * half_period, rel=1e-8)
    assert cycle.amplitudes[0] == pytest.approx(peak, rel=1e-8)
    assert cycle.cross_gains[0] == pytest.approx(4 * d / (np.pi * peak), rel=1e-8)
    # Hysteresis of a third of the amplitude takes the cycle too far from the ultimate point.
    assert (cycle.ultimate is None) is (hysteresis > 0)
    assert (cycle.settings is None) is (hysteresis > 0)
    if cycle.settings is not None:
        assert np.sign(cycle.settings.ziegler_nichols.gain) == sign
    # Among the solutions of Tsypkin's locus is the one that the simulation finds.
    found = [s.half_period for s in outcome.theory.solutions if s.exists]
    assert min(abs(h - half_period) for h in found) < 1e-3 * half_period


def test_first_harmonic_is_the_frequency_response() -> None:
    """The harmonics of the cycle measure the process at its frequency, to many digits."""
    process = TransferFunction([1, 1], np.poly([-1, -2, -0.5]), 0.4)
    outcome = alone(process, Relay(1.0, 0.05), 80.0)
    assert outcome.cycle is not None
    (measured,) = outcome.cycle.harmonics
    exact = process.response([2 * np.pi / outcome.cycle.period])[0]
    assert measured.gain * np.exp(1j * measured.phase) == pytest.approx(exact, rel=1e-6)


def test_switching_times_are_exact() -> None:
    """At every switching of an integrator of order two the output stands at the level."""
    # y = u/s^2 behind a lag: between switchings all is known in closed form at the switchings.
    outcome = alone(TransferFunction([1], [1, 1, 0]), Relay(1.0, 0.2), 60.0)
    times, level = outcome.switchings, 0.2
    # x1' = x2, x2' = u - x2 from rest, u alternating from +1.
    position = speed = before = 0.0
    for index, time in enumerate(times):
        u, h = (-1.0) ** index, time - before
        position += u * h + (speed - u) * (1 - exp(-h))
        speed = u + (speed - u) * exp(-h)
        assert position == pytest.approx((-1.0) ** index * level, abs=1e-9)
        before = time


def test_sampling_moves_switchings_to_samples() -> None:
    """A sampled relay switches at multiples of its period, later than one that always looks."""
    process = TransferFunction([1], np.poly([-1, -1, -1]))
    looking = alone(process, Relay(1.0, 0.1), 40.0)
    sampled = alone(process, Relay(1.0, 0.1, 0.05), 40.0)
    ratio = sampled.switchings / 0.05
    np.testing.assert_allclose(ratio, np.round(ratio), atol=1e-6)
    assert looking.cycle is not None
    assert sampled.cycle is not None
    assert looking.cycle.period < sampled.cycle.period < looking.cycle.period + 4 * 0.05


def test_describing_function_is_near_the_cycle() -> None:
    """For a lag of order three the describing function is right within a few per cent."""
    outcome = alone(TransferFunction([1], np.poly([-1, -1, -1])), Relay(1.0, 0.02), 60.0)
    assert outcome.cycle is not None
    assert outcome.theory.described is not None
    assert outcome.cycle.ultimate.omega == pytest.approx(outcome.theory.described.omega, rel=0.05)
    assert outcome.cycle.ultimate.gain == pytest.approx(outcome.theory.described.gain, rel=0.05)
    assert outcome.theory.ultimate is not None
    assert outcome.theory.ultimate.gain == pytest.approx(8, rel=1e-9)
    assert outcome.theory.ultimate.omega == pytest.approx(np.sqrt(3), rel=1e-9)


def test_scaling_of_time_and_amplitude() -> None:
    """Minutes to seconds and d, eps to 10 d, 10 eps: the same experiment."""
    one = alone(TransferFunction([1], [1, 2, 1], 0.5), Relay(1.0, 0.05), 40.0)
    ten = alone(TransferFunction([1], [3600, 120, 1], 30), Relay(10.0, 0.5), 2400.0)
    np.testing.assert_allclose(one.switchings * 60, ten.switchings, rtol=1e-9)
    assert one.cycle is not None
    assert ten.cycle is not None
    assert one.cycle.ultimate.gain == pytest.approx(ten.cycle.ultimate.gain, rel=1e-8)


def test_equal_units_of_a_large_plant_are_taken_together() -> None:
    """Units under equal control move alike: the plant written out in full says the same."""
    interaction, loop = 0.2, Loop(1.0, 4.0)

    def experiment(plant: Plant) -> RelayExperiment:
        loops = tuple(PlacedLoop(unit, unit, loop) for unit in range(1, plant.n))
        return RelayExperiment(plant, 0, 0, Relay(1.0, 0.02), loops, 40.0, samples=101)

    process = TransferFunction([1], [1, 2, 1], 0.3)
    side = TransferFunction([interaction], [1, 1])
    plant = ParallelPlant(3, process, side)
    size = range(3)
    full = MatrixPlant([[plant.element(row, column) for column in size] for row in size])
    reduced, written_out = relay_experiment(experiment(plant)), relay_experiment(experiment(full))
    assert reduced.units == ((0,), (1, 2))
    np.testing.assert_allclose(reduced.switchings, written_out.switchings, atol=1e-8)
    large = relay_experiment(experiment(first_order(50, 1.0, 5.0, 0.01, 1.0)))
    assert large.units == ((0,), tuple(range(1, 50)))
    assert large.behaviour is Behaviour.LIMIT_CYCLE
    assert large.theory.mcavoy is None


def test_inputs_that_never_move_are_left_out() -> None:
    """Ten by ten with dead times and all other loops open: one column is simulated."""
    size = range(10)
    rows = [[TransferFunction([1 / (1 + abs(r - c))], [5 + c, 1], 1 + r) for c in size]
            for r in size]  # fmt: skip
    experiment = RelayExperiment(MatrixPlant(rows), 0, 0, Relay(1.0, 0.02), (), 40.0, samples=101)
    system = wire(experiment).closed.wiring.build()
    assert (system.A.shape[0], system.dead_times.size) == (10, 10)
    single = alone(rows[0][0], experiment.relay, experiment.duration)
    np.testing.assert_allclose(
        relay_experiment(experiment).switchings, single.switchings, rtol=1e-9
    )


def test_frequency_responses_of_many_points_are_taken_in_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The batches that keep the memory small leave no seams."""
    plant = MatrixPlant([[TransferFunction([1], [1, 2, 1], 0.3)]])
    wired = wire(RelayExperiment(plant, 0, 0, Relay(), (), 1.0, samples=2))
    omega = np.geomspace(0.1, 10, 50)
    loop = (wired.closed.manuals[0].at, wired.closed.outputs[0].at)
    whole = wired.closed.wiring.build().response(*loop, omega)
    monkeypatch.setattr(memory, "MAX_ENTRIES", 30)
    np.testing.assert_array_equal(wired.closed.wiring.build().response(*loop, omega), whole)
    np.testing.assert_allclose(whole, plant.response(omega)[:, 0, 0], rtol=1e-12)


def test_hysteresis_above_the_reachable_output_never_switches() -> None:
    """The output ends below the switching level: a status, not a hang."""
    outcome = alone(TransferFunction([1], [1, 2, 1]), Relay(1.0, 1.5), 50.0)
    assert outcome.behaviour is Behaviour.NO_SWITCHING
    assert outcome.switchings.size == 0
    assert outcome.cycle is None
    assert outcome.theory.solutions == ()
    assert outcome.final_outputs[0] == pytest.approx(1, abs=1e-9)


def test_wrong_sign_of_the_relay_switches_once_or_never() -> None:
    """Positive feedback: the output runs to its end value."""
    outcome = alone(TransferFunction([-1], [1, 2, 1], 0.5), Relay(1.0, 0.1), 50.0)
    assert outcome.behaviour is Behaviour.NO_SWITCHING


def test_a_short_experiment_is_irregular() -> None:
    """Two switchings are no cycle."""
    outcome = alone(TransferFunction([1], [1, 2, 1], 1.0), Relay(1.0, 0.1), 8.0)
    assert outcome.behaviour is Behaviour.IRREGULAR


def test_unstable_other_loop_diverges_with_a_flag() -> None:
    """The loop under control is unstable: flagged, finite."""
    lag = TransferFunction([1], np.poly([-1, -1, -1]))
    weak = TransferFunction([0.01], [1, 1])
    plant = MatrixPlant([[lag, weak], [weak, lag]])
    outcome = relay_experiment(
        RelayExperiment(plant, 0, 0, Relay(1.0, 0.1), (PlacedLoop(1, 1, Loop(20.0, 1.0)),), 400.0)
    )
    assert outcome.behaviour is Behaviour.DIVERGED
    assert np.all(np.isfinite(outcome.outputs))


def test_chattering_is_refused() -> None:
    """Without hysteresis a process without dead time would switch for ever at time zero."""
    with pytest.raises(InvalidInputError, match="hysteresis"):
        alone(TransferFunction([1], [1, 1]), Relay(1.0, 0.0), 10.0)


def test_a_process_that_reacts_at_once_is_refused() -> None:
    """A biproper process has no relay oscillation."""
    with pytest.raises(InvalidInputError, match="without delay"):
        alone(TransferFunction([1, 1], [1, 2]), Relay(1.0, 0.1), 10.0)


PLANT = first_order(2, 1.0, 10.0, 0.5, 1.0)
LOOP = Loop(1.0, 5.0)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"output": 2}, "/output"),
        ({"input": -1}, "/input"),
        ({"loops": (PlacedLoop(0, 1, LOOP),)}, "/loops/0/output"),
        ({"loops": (PlacedLoop(1, 0, LOOP),)}, "/loops/0/input"),
        ({"loops": (PlacedLoop(1, 1, LOOP), PlacedLoop(1, 1, LOOP))}, "/loops/1/output"),
        ({"loops": (PlacedLoop(7, 1, LOOP),)}, "/loops/0/output"),
        ({"duration": -1.0}, "/duration"),
        ({"samples": 1}, "/samples"),
    ],
)
def test_contradictory_experiments_name_the_field(change: dict, field: str) -> None:
    """Wrong places and numbers are refused with a pointer."""
    good = {
        "plant": PLANT,
        "output": 0,
        "input": 0,
        "relay": Relay(),
        "loops": (),
        "duration": 10.0,
    }
    with pytest.raises(InvalidInputError) as caught:
        RelayExperiment(**(good | change))
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"amplitude": 0.0}, "/amplitude"),
        ({"amplitude": float("nan")}, "/amplitude"),
        ({"hysteresis": -0.1}, "/hysteresis"),
        ({"sampling_period": 0.0}, "/sampling_period"),
    ],
)
def test_impossible_relays_name_the_field(change: dict, field: str) -> None:
    """The relay checks itself."""
    with pytest.raises(InvalidInputError) as caught:
        Relay(**change)
    assert caught.value.field == field


def test_incomplete_pairing_has_no_equal_loops() -> None:
    """Three loops of which one is named: which input the others have is not said."""
    lag = TransferFunction([1], np.poly([-1, -1, -1]))
    weak = TransferFunction([0.1], [1, 1])
    plant = MatrixPlant([[lag if r == c else weak for c in range(3)] for r in range(3)])
    outcome = relay_experiment(RelayExperiment(plant, 0, 0, Relay(1.0, 0.1), (), 5.0))
    assert outcome.theory.mcavoy is None


def test_a_loop_without_ultimate_point_has_none_among_equals() -> None:
    """First-order lags never oscillate under proportional control."""
    outcome = relay_experiment(
        RelayExperiment(first_order(2, 1.0, 10.0, 0.5), 0, 0, Relay(1.0, 0.1), (), 20.0)
    )
    assert outcome.theory.ultimate is None
    assert outcome.theory.mcavoy is None


def test_a_disturbance_of_a_missing_unit_is_refused() -> None:
    """Its pointer names the step."""
    with pytest.raises(InvalidInputError) as caught:
        RelayExperiment(PLANT, 0, 0, Relay(), (), 10.0, steps=(Step(StepKind.LOAD, 2, 0.0, 1.0),))
    assert caught.value.field == "/steps/0/unit"


def test_a_load_step_biases_the_oscillation() -> None:
    """With a load the relay spends unequal times on both sides, its mean cancelling the load."""
    process = MatrixPlant([[TransferFunction([1], [1, 2, 1], 0.5)]])
    experiment = RelayExperiment(
        process, 0, 0, Relay(1.0, 0.02), (), 60.0, steps=(Step(StepKind.LOAD, 0, 5.0, 0.3),)
    )
    outcome = relay_experiment(experiment)
    assert outcome.behaviour is Behaviour.LIMIT_CYCLE
    up, down = np.diff(outcome.switchings)[-2:]
    if outcome.switchings.size % 2:
        up, down = down, up
    # The mean of the output is small beside the load: the relay's mean is nearly minus the load.
    assert abs(up - down) / (up + down) == pytest.approx(0.3, abs=0.1)


def test_phase_is_that_of_the_process() -> None:
    """The phase reported is the frequency response's, for either sign of the gain."""
    process = TransferFunction([-3.0], [2.0, 3.0, 1.0], 0.5)
    cycle = alone(process, Relay(-1.0, 0.05), 60.0).cycle
    assert cycle is not None
    response = -complex(process(2j * np.pi / cycle.period))
    assert cycle.phase == pytest.approx(np.angle(response) % (2 * np.pi) - 2 * np.pi, abs=1e-6)


def test_hysteresis_that_hides_the_ultimate_point_is_said() -> None:
    """2 e^(-8s)/(120s + 1) with hysteresis 20: phase -1.57, so no ultimate gain, no settings."""
    outcome = alone(TransferFunction([2.0], [120, 1], 8), Relay(50, 20), 3000)
    cycle = outcome.cycle
    assert cycle is not None
    assert cycle.phase == pytest.approx(-1.83, abs=0.3)
    assert cycle.ultimate is None
    assert cycle.settings is None
    assert cycle.remark is not None
    assert "No ultimate gain" in cycle.remark
    assert "Less hysteresis" in cycle.remark
    assert outcome.theory.ultimate is not None
    assert outcome.theory.ultimate.gain == pytest.approx(12.10, abs=0.01)
    assert outcome.theory.ultimate.omega == pytest.approx(0.2015, abs=1e-4)


@pytest.mark.parametrize(("dead_time", "within"), [(20.0, 1e-3), (5.0, 1e-2), (1.0, 4e-2)])
def test_an_output_that_is_no_sine_wave_is_measured_by_its_harmonic(
    dead_time: float, within: float
) -> None:
    """e^(-Ls)/(s + 1): 4 d/(pi a) is up to 26 % high behind a long dead time, and 11 % low at 1."""
    outcome = alone(TransferFunction([1.0], [1, 1], dead_time), Relay(1.0), 40 * dead_time)
    cycle, ultimate = outcome.cycle, outcome.theory.ultimate
    assert cycle is not None
    assert cycle.ultimate is not None
    assert ultimate is not None
    assert cycle.ultimate.gain == pytest.approx(ultimate.gain, rel=within)
    assert cycle.remark is not None
    assert "no sine wave" in cycle.remark


@pytest.mark.parametrize("zero", [0.5, 0.9])
def test_feedthrough_behind_dead_time_has_no_first_frequency_to_lose_stability(
    zero: float,
) -> None:
    """(s + z) e^(-s)/(s + 1) crosses the axis at ever less gain: none of them is the ultimate."""
    assert alone(TransferFunction([1, zero], [1, 1], 1.0), Relay(1.0), 40.0).theory.ultimate is None
    slower = alone(TransferFunction([1, 3], [1, 1], 1.0), Relay(1.0), 40.0)
    assert slower.theory.ultimate is not None


def test_process_without_ultimate_point_gets_none() -> None:
    """A first-order lag oscillates under hysteresis, but at no gain in a loop."""
    outcome = alone(TransferFunction([2.0], [10, 1]), Relay(1.0, 0.02), 10.0)
    assert outcome.behaviour is Behaviour.LIMIT_CYCLE
    assert outcome.cycle is not None
    assert outcome.cycle.ultimate is None
    assert outcome.cycle.settings is None
    assert outcome.theory.ultimate is None


@pytest.mark.parametrize(
    ("den", "hysteresis"), [([100, 20, 1], 0.5), ([1, 0.2, 1], 0.5), ([1, 1, 0], 0.1)]
)
def test_no_hysteresis_is_small_enough_for_an_ultimate_point_that_is_not_there(
    den: list[float], hysteresis: float
) -> None:
    """A lag of second order comes as near to -pi as one likes, and oscillates at no gain."""
    outcome = alone(TransferFunction([2.0], den), Relay(50.0, hysteresis), 80.0)
    assert outcome.cycle is not None
    assert outcome.cycle.ultimate is None
    assert outcome.cycle.settings is None
    assert outcome.cycle.remark is not None
    assert "does not reach -pi" in outcome.cycle.remark


def test_static_load_makes_the_cycle_uneven_and_is_said() -> None:
    """A load of half the relay's amplitude: the gain comes from the harmonics, with a remark."""
    process = TransferFunction([1.0], [1, 3, 3, 1])
    even = alone(process, Relay(1.0, 1e-4), 100.0).cycle
    plant = MatrixPlant([[process]])
    load = (Step(StepKind.LOAD, 0, 0.0, 0.5),)
    uneven = relay_experiment(
        RelayExperiment(plant, 0, 0, Relay(1.0, 1e-4), (), 200.0, steps=load)
    ).cycle
    assert even is not None
    assert even.ultimate is not None
    assert even.ultimate.gain == pytest.approx(8, rel=0.05)
    assert even.remark is None
    assert uneven is not None
    assert uneven.remark is not None
    assert "half periods are unequal" in uneven.remark
    response = complex(process(2j * np.pi / uneven.period))
    if uneven.ultimate is None:
        assert abs(np.angle(-response)) > np.radians(20)
    else:
        assert uneven.ultimate.gain == pytest.approx(1 / abs(response), rel=1e-5)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_change_nothing(unit: float) -> None:
    """Period, phase and gains follow the units of time, output and input."""

    def run(time: float, of_output: float, of_input: float) -> RelayOutcome:
        process = TransferFunction(
            [2 * of_output / of_input], [3 * time**2, 4 * time, 1], 0.5 * time
        )
        return alone(process, Relay(of_input, 0.01 * of_output), 40.0 * time)

    reference = run(1, 1, 1).cycle
    assert reference is not None
    assert reference.ultimate is not None
    for time, of_output, of_input in ((min(unit, 1e5), 1, 1), (1, unit, 1), (1, 1, unit)):
        outcome = run(time, of_output, of_input)
        cycle = outcome.cycle
        assert cycle is not None
        assert cycle.ultimate is not None
        assert cycle.period / time == pytest.approx(reference.period, rel=1e-9)
        assert cycle.phase == pytest.approx(reference.phase, rel=1e-9)
        gain = cycle.ultimate.gain * of_output / of_input
        assert gain == pytest.approx(reference.ultimate.gain, rel=1e-9)
        assert outcome.theory.ultimate is not None
