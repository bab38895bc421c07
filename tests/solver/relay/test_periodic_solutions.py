"""Theorems 1 and 2 against each other, Tsypkin's locus and simulation."""

import johansson
import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.relay.describing_function import Ultimate
from solver.relay.experiment import Relay, RelayExperiment, wire
from solver.relay.mcavoy import mcavoy
from solver.relay.periodic import RelayLoop, periodic_solutions


def seen(experiment: RelayExperiment) -> RelayLoop:
    """Return what the relay of an experiment sees."""
    wired = wire(experiment)
    closed = wired.closed
    return RelayLoop(
        closed.wiring.build(), closed.manuals[wired.input].at, closed.outputs[wired.output].at
    )


@pytest.mark.parametrize("loops", [(), (johansson.U2_Y2,)])
def test_matrix_exponential_and_harmonics_agree(loops: tuple) -> None:
    """f(h) by theorem 1 equals the sum over the harmonics of the square wave."""
    loop = seen(johansson.experiment(1, 1, loops=loops))
    half_periods = np.array([0.1, 0.3, 2.0])
    harmonics = loop.harmonics(half_periods, np.zeros(1), 400)[:, 0]
    np.testing.assert_allclose(loop.switching_output(half_periods), harmonics, atol=1e-7)


def test_solution_repeats_itself_with_the_opposite_sign() -> None:
    """After a half period the output stands at -eps, and the state is the negative."""
    loop = seen(johansson.experiment(1, 1))
    (solution,) = periodic_solutions(loop, johansson.RELAY, 0.02, 10.0)
    ends = loop.waveform(solution.half_period, np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends, [0.01, -0.01], atol=1e-12)


def test_eigenvalues_foretell_how_fast_a_disturbance_dies() -> None:
    """The interval errors of a relay oscillation shrink by the largest eigenvalue of W."""
    from solver.relay.analysis import relay_experiment  # noqa: PLC0415

    process = TransferFunction([1], np.poly([-1, -2, -3]))
    plant = MatrixPlant([[process]])
    experiment = RelayExperiment(plant, 0, 0, Relay(1.0, 0.02), (), 30.0, samples=2)
    outcome = relay_experiment(experiment)
    (solution,) = outcome.theory.solutions
    errors = np.abs(np.diff(outcome.switchings) - solution.half_period)
    largest = abs((solution.eigenvalues or ())[0])
    # Between rounding and the first intervals.
    usable = errors[3:][errors[3:] > 1e-8]
    assert usable.size >= 3
    rate = (usable[-1] / usable[0]) ** (1 / (usable.size - 1))
    assert rate == pytest.approx(largest, rel=0.05)


def test_a_pole_too_fast_for_exponentials_leaves_out_a_root() -> None:
    """Where e^{Ah} overflows there is no root to be had, and no error either."""
    fast = TransferFunction([200], [1e-30, 23, 160, 300])
    own = johansson.PLANT.element(0, 0)
    plant = MatrixPlant([[own, fast], [own, own]])
    experiment = RelayExperiment(plant, 0, 0, johansson.RELAY, (johansson.U2_Y2,), 40.0, samples=2)
    for solution in periodic_solutions(seen(experiment), johansson.RELAY, 0.01, 20.0):
        assert np.isfinite(solution.half_period)


def test_no_oscillation_without_phase_lag() -> None:
    """A first-order lag has no ultimate point; only its hysteresis makes it oscillate."""
    plant = MatrixPlant([[TransferFunction([1], [2, 1])]])
    experiment = RelayExperiment(plant, 0, 0, Relay(1.0, 0.1), (), 20.0)
    (solution,) = periodic_solutions(seen(experiment), experiment.relay, 0.01, 10.0)
    # (1 - e^{-h/2})/(1 + e^{-h/2}) = 0.1
    assert solution.half_period == pytest.approx(2 * np.log(1.1 / 0.9), rel=1e-10)
    assert solution.stable


def test_reversed_relay_on_a_reversed_process_is_the_same() -> None:
    """Both signs reversed: the same solutions."""
    found = []
    for sign in (1.0, -1.0):
        plant = MatrixPlant([[TransferFunction([sign], np.poly([-1, -1, -1]))]])
        experiment = RelayExperiment(plant, 0, 0, Relay(sign, 0.05), (), 40.0)
        found.append(periodic_solutions(seen(experiment), experiment.relay, 0.02, 20.0))
    assert found[0][0].half_period == pytest.approx(found[1][0].half_period, rel=1e-12)
    assert found[0][0].slope == pytest.approx(found[1][0].slope, rel=1e-9)


def test_mcavoy_without_interaction_changes_nothing() -> None:
    """A diagonal plant: factor one, and the exact point is the loop's own."""
    lag, nothing = TransferFunction([1], np.poly([-1, -1, -1])), TransferFunction([0], [1])
    plant = MatrixPlant([[lag, nothing], [nothing, lag]])
    own = Ultimate(8.0, float(np.sqrt(3)))
    found = mcavoy(plant, [0, 1], 0, own, (0.01, 100.0))
    assert found.factor == pytest.approx(1)
    assert found.exact is not None
    assert found.exact.gain == pytest.approx(8, rel=1e-9)


def test_mcavoy_of_three_equal_units_is_the_strongest_mode() -> None:
    """For a parallel plant the least gain is that of its largest mode, g + (n-1) i."""
    g = TransferFunction([1], np.poly([-1, -1, -1]))
    i = TransferFunction([0.4], np.poly([-1, -1, -1]))
    plant = MatrixPlant([[g if row == column else i for column in range(3)] for row in range(3)])
    found = mcavoy(plant, [0, 1, 2], 1, Ultimate(8.0, float(np.sqrt(3))), (0.01, 100.0))
    assert found.exact is not None
    assert found.exact.gain == pytest.approx(8 / 1.8, rel=1e-9)
    assert found.factor == pytest.approx(1 / 1.8, rel=1e-9)


def test_mcavoy_refuses_what_cannot_be_paired() -> None:
    """Not a permutation, or a zero element on the diagonal."""
    lag, nothing = TransferFunction([1], [1, 1]), TransferFunction([0], [1])
    plant = MatrixPlant([[lag, nothing], [nothing, lag]])
    for inputs in ([0, 0], [1, 0]):
        with pytest.raises(InvalidInputError) as caught:
            mcavoy(plant, inputs, 0, Ultimate(1.0, 1.0), (0.01, 100.0))
        assert caught.value.field == "/loops"
