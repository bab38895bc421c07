"""A simulation is the same in all units of time, of inputs and of outputs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.simulation.algebraic import solve_signals
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.integrator import End
from solver.simulation.loops import Loop
from solver.simulation.step_response import StepResponse, step_response

Element = tuple[list[float], list[float], float]

WOOD_BERRY: list[list[Element]] = [
    [([12.8], [16.7, 1], 1), ([-18.9], [21, 1], 3)],
    [([6.6], [10.9, 1], 7), ([-19.4], [14.4, 1], 3)],
]
# Without dead time: integrator, lags of several orders, and direct feedthrough.
RATIONAL: list[list[Element]] = [
    [([1, 2], [1, 3], 0), ([0.5], [2, 1], 0)],
    [([0.3], [1, 2, 3, 1], 0), ([1], [3, 1, 0], 0)],
]
LOOPS = {"delayed": (0.2, -0.04), "rational": (1.0, 0.5)}
INTEGRAL_TIMES = (4.44, 6.0)
DURATION = 60.0


class Units(NamedTuple):
    """The numbers that one unit of time, of each output and of each input becomes."""

    time: float = 1.0
    outputs: tuple[float, float] = (1.0, 1.0)
    inputs: tuple[float, float] = (1.0, 1.0)


def simulate(
    elements: list[list[Element]], gains: tuple[float, float], units: Units | None = None
) -> StepResponse:
    """Simulate with all times, outputs and inputs counted in other units."""
    time, outputs, inputs = units or Units()
    plant = MatrixPlant(
        [
            [
                TransferFunction(
                    [
                        value * outputs[r] / inputs[c] * time ** (len(num) - 1 - k)
                        for k, value in enumerate(num)
                    ],
                    [value * time ** (len(den) - 1 - k) for k, value in enumerate(den)],
                    dead_time * time,
                )
                for c, (num, den, dead_time) in enumerate(row)
            ]
            for r, row in enumerate(elements)
        ]
    )
    loops = tuple(
        Loop(gain * inputs[k] / outputs[k], INTEGRAL_TIMES[k] * time)
        for k, gain in enumerate(gains)
    )
    steps = (
        Step(StepKind.SETPOINT, 0, 0.0, outputs[0]),
        Step(StepKind.LOAD, 1, DURATION * time / 2, 0.1 * inputs[1]),
    )
    return step_response(Experiment(plant, loops, steps, DURATION * time))


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("plant", ["delayed", "rational"])
def test_units_change_nothing(plant: str, unit: float) -> None:
    """Curves and measures follow the units of time, of one signal and of all to 1e-9."""
    elements = WOOD_BERRY if plant == "delayed" else RATIONAL
    reference = simulate(elements, LOOPS[plant])
    assert reference.end is End.COMPLETE
    # The coefficients of third order hold the third power of the unit of time.
    time = min(unit, 1e3)
    root = unit**0.5
    for units in (
        Units(time=time),
        Units(outputs=(unit, unit)),
        Units(outputs=(unit, 1.0)),
        Units(inputs=(unit, unit)),
        Units(inputs=(1.0, unit)),
        Units(outputs=(root, 1 / root), inputs=(1 / root, root)),
    ):
        got = simulate(elements, LOOPS[plant], units)
        assert got.end is End.COMPLETE
        for k, (mine, theirs) in enumerate(zip(got.responses, reference.responses, strict=True)):
            output, given = units.outputs[k], units.inputs[k]
            np.testing.assert_allclose(mine.output / output, theirs.output, atol=1e-9)
            size = np.abs(theirs.input).max()
            np.testing.assert_allclose(mine.input / given, theirs.input, atol=1e-9 * size)
            assert mine.metrics.absolute_error is not None
            assert theirs.metrics.absolute_error is not None
            assert mine.metrics.absolute_error / output / units.time == pytest.approx(
                theirs.metrics.absolute_error, rel=1e-8
            )


def test_large_gain_is_no_algebraic_loop() -> None:
    """A gain of 1e12 in front of a lag has a response like any other."""
    plant = MatrixPlant([[TransferFunction([1e12], [1, 1])]])
    steps = (Step(StepKind.SETPOINT, 0, 0.0, 1.0),)
    got = step_response(Experiment(plant, (Loop(1e-12, 1.0),), steps, 5.0)).responses[0]
    time = np.linspace(0, 5, 501)
    np.testing.assert_allclose(got.output, 1 - np.exp(-time), atol=1e-9)


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_algebraic_loop_of_gain_one_is_refused(unit: float) -> None:
    """A loop gain of one has no solution in any unit, one that is 1e-6 off it has."""
    for gain, solvable in ((1.0, False), (1.0 + 1e-6, True), (-1e9, True)):
        gains = np.array([[0.0, gain * unit], [1 / unit, 0.0]])
        given = np.array([[1.0 * unit], [0.0]])
        if solvable:
            np.testing.assert_allclose(solve_signals(gains, given)[0], unit / (1 - gain), rtol=1e-9)
        else:
            with pytest.raises(ValueError, match="exactly one"):
                solve_signals(gains, given)
