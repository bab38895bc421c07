"""The worst perturbation in time: it makes of the loop what mu says."""

import numpy as np
import pytest

import mutune
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import first_order
from solver.model.weights import Performance, Structure, Uncertainty
from solver.robustness.analysis import analyse
from solver.simulation.actuators import CoupledActuators, OwnActuators
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.integrator import End
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response
from solver.simulation.worst_actuators import with_worst_actuators, worst_actuators

PLANT = first_order(2, 1.0, 100.0, 0.949)
# Published settings and time constant, where mu has a peak of 1.0003 (SLH 1989, table 2).
LOOPS = (Controller(46.3, 101.0), Controller(22.8, 3.15))
PERFORMANCE = Performance(tau_p=19.0)


@pytest.mark.parametrize("structure", list(Structure))
def test_perturbed_sensitivity_reaches_the_demand(structure: Structure) -> None:
    """With the worst actuators sigma_max(w_P S) touches mu at one frequency."""
    uncertainty = Uncertainty.from_error(0.2, 1.0, structure)
    actuators = worst_actuators(PLANT, LOOPS, uncertainty, PERFORMANCE)
    omega = np.geomspace(1e-3, 10, 4000)
    if isinstance(actuators, OwnActuators):
        F = np.zeros((omega.size, 2, 2), dtype=complex)
        for unit, function in enumerate(actuators.functions):
            F[:, unit, unit] = function.response(omega)
    else:
        assert isinstance(actuators, CoupledActuators)
        left, right = (
            np.stack([function.response(omega) for function in factor], axis=1)
            for factor in (actuators.left, actuators.right)
        )
        weight = actuators.weight.response(omega)[:, None, None]
        F = np.eye(2) + weight * left[:, :, None] * right[:, None, :]
    C = np.stack([loop.response(omega) for loop in LOOPS], axis=1)
    S = np.linalg.inv(np.eye(2) + PLANT.response(omega) @ F * C[:, None, :])
    peak = np.max(np.linalg.norm(S, 2, axis=(1, 2)) * PERFORMANCE.magnitude(omega))
    peaks = analyse(PLANT, uncertainty, PERFORMANCE, LOOPS).peaks
    assert peaks is not None
    assert peak == pytest.approx(peaks.robust_performance.value, rel=0.01)


def test_perturbed_loops_are_stable() -> None:
    """Within the uncertainty for which they are robustly stable the loops settle all the same."""
    experiment = Experiment(
        PLANT, tuple(map(Loop.of, LOOPS)), (Step(StepKind.SETPOINT, 0, 0.0, 1.0),), 600.0
    )
    perturbed = with_worst_actuators(experiment, Uncertainty.from_error(0.2, 1.0), PERFORMANCE)
    result = step_response(perturbed)
    assert result.end is End.COMPLETE
    assert result.responses[0].output[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    "loops", [(None, Loop(1.0, 10.0)), (Loop(1.0), Loop(1.0, 10.0)), (Loop(-5.0, 1.0),) * 2]
)
def test_open_proportional_or_unstable_loops_have_no_worst_case(loops: tuple) -> None:
    """mu has no meaning there."""
    experiment = Experiment(PLANT, loops, (Step(StepKind.LOAD, 0, 0.0, 1.0),), 10.0)
    with pytest.raises(InvalidInputError) as caught:
        with_worst_actuators(experiment, Uncertainty.from_error(0.2, 1.0), PERFORMANCE)
    assert caught.value.field == "/kind"


def test_unstable_loops_have_no_worst_actuators():
    """A singular plant under integral action in every loop keeps a pole at zero: said, not met."""
    lag = mutune.TransferFunction([1], [10, 1])
    with pytest.raises(mutune.InvalidInputError, match="unstable") as error:
        mutune.worst_actuators(
            mutune.ParallelPlant(2, lag, lag), [mutune.Controller(0.1, 10)] * 2,
            mutune.Uncertainty.from_error(0.2, 1), mutune.Performance(tau_p=100),
        )  # fmt: skip
    assert error.value.field == "/loops"
