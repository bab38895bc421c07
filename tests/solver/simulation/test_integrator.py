"""The engine below the experiments: resolution, polynomials, breakpoints."""

import dataclasses

import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import TransferFunction
from solver.simulation.breakpoints import Breakpoints
from solver.simulation.chebyshev import (
    DIFFERENTIATION,
    NODES,
    QUADRATURE,
    evaluation_matrix,
    first_root,
    roots,
)
from solver.simulation.delay_system import DelaySystem
from solver.simulation.integrator import integrate
from solver.simulation.propagator import Propagator
from solver.simulation.switching import Event
from solver.simulation.trajectory import Trajectory
from solver.simulation.wiring import Term, Wiring


def loop(process: TransferFunction, law: TransferFunction) -> tuple[Wiring, int]:
    """Return a loop with its set point as external 0, and its output signal."""
    wiring = Wiring()
    set_point, error, moved, output = (
        wiring.external(),
        wiring.signal(),
        wiring.signal(),
        wiring.signal(),
    )
    wiring.connect(error, [Term(set_point, 1.0), Term(output, -1.0)])
    wiring.connect(moved, wiring.transfer(law, error))
    wiring.connect(output, wiring.transfer(process, moved))
    return wiring, output.at


def test_polynomials_reproduce_an_exponential() -> None:
    """Value, slope, integral and root of exp(t) - 2 from its node values."""
    values = np.exp(NODES) - 2
    places = np.array([0.0, 0.1234, 0.5, 1.0])
    np.testing.assert_allclose(evaluation_matrix(places) @ values, np.exp(places) - 2, atol=1e-14)
    np.testing.assert_allclose(DIFFERENTIATION @ values, np.exp(NODES), atol=1e-11)
    assert float(QUADRATURE @ values) == pytest.approx(np.e - 3, abs=1e-14)
    np.testing.assert_allclose(roots(values), [np.log(2)], atol=1e-13)
    assert first_root(values, 0.0) == pytest.approx(np.log(2), abs=1e-13)


def test_first_root_ignores_rounding_but_not_jumps() -> None:
    """A signal that starts above the level has crossed at once, unless only by rounding."""
    assert first_root(np.full(NODES.size, 1.0), 1e-9) == 0.0
    assert first_root(1e-12 - NODES, 1e-9) is None
    assert first_root(-np.ones(NODES.size), 0.0) is None


@pytest.mark.parametrize("order", [1, 5, 10, 20])
def test_wired_transfer_functions_have_their_frequency_response(order: int) -> None:
    """A high-order process with widely spread poles keeps its digits in state space."""
    process = TransferFunction([2.0, 1.0], np.poly(-np.geomspace(0.01, 100, order)), 0.3)
    wiring = Wiring()
    given, driven, output = wiring.external(), wiring.signal(), wiring.signal()
    wiring.connect(driven, [Term(given, 1.0)])
    wiring.connect(output, wiring.transfer(process, driven))
    omega = np.geomspace(1e-4, 1e3, 30)
    response = wiring.build().response(0, output.at, omega)
    np.testing.assert_allclose(response, process.response(omega), rtol=1e-8)


def test_equal_denominators_share_their_states() -> None:
    """Elements of one input with one denominator and dead time cost one set of states."""
    wiring = Wiring()
    given, driven, output = wiring.external(), wiring.signal(), wiring.signal()
    wiring.connect(driven, [Term(given, 1.0)])
    for gain in (1.0, 2.0, 3.0):
        wiring.connect(output, wiring.transfer(TransferFunction([gain], [5, 1], 0.5), driven))
    system = wiring.build()
    assert system.A.shape == (1, 1)
    assert system.dead_times.size == 1


def test_smooth_signals_take_long_steps() -> None:
    """After the transient of a stiff loop the steps are as long as the slow signal permits."""
    wiring, output = loop(
        TransferFunction([1], np.polymul([1e-6, 1], [1, 1])), TransferFunction([2, 2], [1, 0])
    )
    trajectory, _ = integrate(
        wiring, 20.0, [Event(0.0, 0, 1.0)], outputs=[output], bound=np.array([1e6])
    )
    assert trajectory.lengths.min() < 1e-5
    assert trajectory.lengths.max() > 0.3
    assert len(trajectory) < 200


def test_steps_end_at_jumps_and_what_dead_time_makes_of_them() -> None:
    """Boundaries stand at each event and one and two dead times later."""
    wiring, output = loop(TransferFunction([1], [1, 0], 0.7), TransferFunction([0.5], [1]))
    events = [Event(0.0, 0, 1.0), Event(1.1, 0, -1.0)]
    trajectory, _ = integrate(wiring, 5.0, events, outputs=[output], bound=np.array([1e6]))
    for moment in (0.7, 1.4, 1.1, 1.8, 2.5):
        assert np.abs(trajectory.starts - moment).min() < 1e-12


def test_breakpoints_smooth_out_behind_states_and_fade_behind_direct_paths() -> None:
    """Behind an integrator a jump has few descendants; around a gain of 0.1, a dozen."""
    for law, most, least in ((TransferFunction([0.5], [1, 0]), 5, 2), (None, 20, 10)):
        process = TransferFunction([1], [1], 1.0)
        wiring, _ = loop(process, law or TransferFunction([0.1], [1]))
        queue = Breakpoints(wiring.build(), 1e-12)
        queue.jump(0.0)
        time, count = 0.0, 0
        while (time := queue.after(time)) < np.inf:
            count += 1
        assert least <= count <= most


def test_samples_are_right_continuous() -> None:
    """At a jump a sample is the value after it."""
    trajectory = Trajectory(1e-12)
    for start, value in ((0.0, 1.0), (1.0, 5.0)):
        trajectory.append(start, 1.0, np.full((NODES.size, 1), value))
    np.testing.assert_allclose(trajectory.sample(0, [0.0, 0.5, 1.0, 2.0]), [1, 1, 5, 5])


def test_states_that_are_too_many_for_one_exponential_are_refused() -> None:
    """Before it is computed: what it takes grows with the cube of the states that are coupled."""
    states = 720
    nothing = np.zeros((states, 0))
    coupled = DelaySystem(
        -np.ones((states, states)), np.ones((states, 1)), nothing, np.eye(states),
        np.zeros((states, 1)), nothing, np.zeros(0, dtype=int), np.zeros(0),
    )  # fmt: skip
    with pytest.raises(InvalidInputError, match="720 states act on each other") as caught:
        Propagator(coupled).states(1.0, np.zeros(states), np.ones(1), np.zeros((11, 0)))
    assert caught.value.field == "/plant"
    alone = dataclasses.replace(coupled, A=-np.eye(states))
    moved = Propagator(alone).states(1.0, np.zeros(states), np.ones(1), np.zeros((11, 0)))
    np.testing.assert_allclose(moved[-1], 1 - np.exp(-1.0), rtol=1e-14)
