"""The overshoot of a loop without dead time, from its poles."""

import pytest

from solver.model.controllers import Controller
from solver.model.plants import ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.simulation.exact_overshoot import exact_overshoot
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response

NONE = TransferFunction((0,), (1,))


@pytest.mark.parametrize(
    ("process", "loop", "longest"),
    [
        (TransferFunction((1,), (100, 1)), Controller(40, 57), 75),
        (TransferFunction((1,), (100, 1)), Controller(19, 2.4), 55),
        (TransferFunction((2,), (30, 11, 1)), Controller(1, 8, 2), 40),
        (TransferFunction((1,), (10, 1, 0)), Controller(0.1, 60, 8), 90),
        (TransferFunction((-3, 1), (25, 10, 1)), Controller(0.7, 9), 80),
        (TransferFunction((1,), (100, 0.1, 1)), Controller(0.3, 40, 20, 1), 900),
        (TransferFunction((1, 3), (2, 1)), Controller(4, None), 6),
    ],
)
def test_it_is_that_of_the_simulation(process, loop, longest):
    """Lags, an integrator, inverse response, weak damping, feedthrough."""
    step = Step(StepKind.SETPOINT, 0, 0.0, 1.0)
    plant = ParallelPlant(1, process, NONE)
    seen = step_response(Experiment(plant, (Loop.of(loop),), (step,), longest)).responses[0]
    assert seen.metrics.set_point is not None
    found = exact_overshoot(process, loop, longest)
    assert found == pytest.approx(seen.metrics.set_point.overshoot, abs=1e-5)


@pytest.mark.parametrize(
    ("process", "loop"),
    [
        (TransferFunction((1,), (10, 1), 3), Controller(2, 10)),
        (TransferFunction((4,), (1,)), Controller(-0.25, None)),
        (TransferFunction((1,), (1, 3, 0)), Controller(3, 3)),
    ],
)
def test_where_poles_do_not_tell_it_there_is_none(process, loop):
    """Dead time, a loop without poles that is singular, and three poles in one place: no number."""
    assert exact_overshoot(process, loop, 50) is None


def test_a_loop_that_runs_away_exceeds_all_bounds_or_numbers():
    """An unstable loop: a large overshoot soon, and no number in the end."""
    lags, strong = TransferFunction((1,), (1, 3, 3, 1)), Controller(20, 5)
    early = exact_overshoot(lags, strong, 20)
    assert early is not None
    assert early > 100
    assert exact_overshoot(lags, strong, 1e5) is None
