"""The estimate of an overshoot that spares a simulation."""

import pytest

from solver.model.controllers import Controller
from solver.model.plants import ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.simulation.estimated import estimated_overshoot
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response

NONE = TransferFunction((0,), (1,))


@pytest.mark.parametrize(
    ("process", "loop", "longest"),
    [
        (TransferFunction((1,), (100, 1)), Controller(40, 57), 75),
        (TransferFunction((1,), (100, 1)), Controller(19, 2.4), 55),
        (TransferFunction((2,), (30, 11, 1), 1.5), Controller(1, 8, 2), 40),
        (TransferFunction((1,), (10, 1, 0)), Controller(0.1, 60, 8), 90),
        (TransferFunction((-3, 1), (25, 10, 1)), Controller(0.7, 9), 80),
        (TransferFunction((1,), (10, 1), 3), Controller(2, None), 50),
    ],
)
def test_the_estimate_is_near_the_simulation(process, loop, longest):
    """With lags, dead time, an integrator, inverse response, and without integral action."""
    plant = ParallelPlant(1, process, NONE)
    step = Step(StepKind.SETPOINT, 0, 0.0, 1.0)
    exact = step_response(Experiment(plant, (Loop.of(loop),), (step,), longest))
    about = estimated_overshoot(plant, loop, longest)
    assert about == pytest.approx(exact.responses[0].output.max() - 1, abs=0.05)


def test_what_is_over_before_the_first_step_is_not_estimated():
    """A loop a thousand times faster than the time shown: no number rather than a wrong one."""
    plant = ParallelPlant(1, TransferFunction((1,), (100, 1)), NONE)
    assert estimated_overshoot(plant, Controller(19, 2.4), 55e3) is None
