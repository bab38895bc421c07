"""What a loop sees when the others close."""

import math

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.robustness.loop_responses import loop_responses
from solver.robustness.loop_responses_query import LoopResponsesQuery

LAG = TransferFunction([1], [1, 2, 1])
EXAMPLE = MatrixPlant([[LAG, TransferFunction([2], [1, 2, 1])], [LAG, LAG]])


@pytest.mark.parametrize("k", [0.8, 1.6])
def test_the_transfer_function_of_example_11_1(k: float) -> None:
    """(s^2 + 2 s + 1 - k)/((s + 1)^2 (s^2 + 2 s + 1 + k)): Astrom and Hagglund, section 11.2."""
    loops = (Controller(1.0, 1.0), Controller(k, None))
    first = loop_responses(LoopResponsesQuery(EXAMPLE, loops)).loops[0]
    assert first.function_closed is not None
    assert first.function_closed.num == pytest.approx([1, 2, 1 - k])
    expected = np.polymul([1, 2, 1], [1, 2, 1 + k])
    assert first.function_closed.den == pytest.approx(expected)
    assert first.static_open == 1
    assert first.static_closed == pytest.approx((1 - k) / (1 + k))


def test_the_frequency_response_is_that_of_the_transfer_function() -> None:
    """Two ways to one curve: polynomials without common factors, and matrices."""
    loops = (Controller(1.0, 1.0), Controller(0.8, 2.0), Controller(0.3, None, 1.0))
    elements = [
        [TransferFunction([1 + r + 2 * c], [1 + r + c, 1]) for c in range(3)] for r in range(3)
    ]
    found = loop_responses(LoopResponsesQuery(MatrixPlant(elements), loops))
    for loop in found.loops:
        function = loop.function_closed
        assert function is not None
        s = 1j * found.omega
        expected = np.polyval(function.num, s) / np.polyval(function.den, s)
        np.testing.assert_allclose(loop.process_closed, expected, rtol=1e-8)


def test_units_that_are_alike_are_told_once() -> None:
    """Identical units under equal settings see the same, whatever their number."""
    loop = Controller(1.0, 5.0)
    plant = first_order(50, 1, 10, 0.3, dead_time=1)
    found = loop_responses(LoopResponsesQuery(plant, (loop,) * 49 + (None,)))
    assert [len(each.units) for each in found.loops] == [49, 1]
    # With integral action everywhere else the gain is the open one over the relative gain.
    a, n = 0.3, 50
    expected = (1 - a) * (1 + (n - 1) * a) / (1 + (n - 2) * a)
    assert found.loops[1].static_closed == pytest.approx(expected, rel=1e-4)
    assert found.loops[1].controller is None
    assert found.loops[1].function_closed is None


def test_what_other_loops_that_are_unstable_leave_is_marked() -> None:
    """A frequency response that no experiment could find is called formal."""
    slow = TransferFunction([1], [1, 3, 3, 1])
    plant = ParallelPlant(2, slow, TransferFunction([0.1], [1, 3, 3, 1]))
    found = loop_responses(LoopResponsesQuery(plant, (Controller(1.0, 5.0), Controller(20, 1))))
    assert not found.stable
    assert found.sensitivity is None
    assert [loop.others_stable for loop in found.loops] == [False, True]
    assert found.loops[1].sensitivity is None


def test_an_integrating_process_has_no_static_gain() -> None:
    """Infinite open; with the other loop closed, what the pair leaves."""
    tank = TransferFunction([1], [1, 0])
    plant = MatrixPlant([[tank, tank], [LAG, LAG]])
    found = loop_responses(LoopResponsesQuery(plant, (Controller(1.0, None),) * 2))
    assert math.isinf(found.loops[0].static_open)


def test_loops_must_be_as_many_as_units() -> None:
    """A missing loop is told by its field."""
    with pytest.raises(InvalidInputError) as error:
        LoopResponsesQuery(EXAMPLE, (None,))
    assert error.value.field == "/loops"


def test_poles_of_a_loop_alone() -> None:
    """Johansson, section 3: u2-y2 under 6.5, 0.56 has a damping of 0.236 (he prints 0.18)."""
    process = TransferFunction([100], np.poly([-1, -10, -10]).tolist())
    plant = MatrixPlant([[process]])
    (loop,) = loop_responses(LoopResponsesQuery(plant, (Controller(6.5, 0.56),))).loops
    assert loop.damping == pytest.approx(0.236, abs=5e-4)
    assert loop.poles is not None
    s = loop.poles
    values = process(s) * Controller(6.5, 0.56)(s)
    np.testing.assert_allclose(values, -1, rtol=1e-9)
