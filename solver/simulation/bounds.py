"""How large outputs may become before a simulation is given up as unstable.

Each output has a bound in its own unit: far beyond anything that its disturbances, and the inputs
with which the loops answer them, make of it at the slowest rate that the simulation shows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.simulation.experiment import StepKind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.state_space import StateSpace
    from solver.simulation.experiment import Step
    from solver.simulation.loops import Loop
    from solver.simulation.paths import Paths

__all__ = ["default_bounds", "sizes_of"]

_FAR = 1e6


def default_bounds(
    paths: Paths,
    loops: Sequence[Loop | None],
    distribution: NDArray[np.float64],
    duration: float,
    moved: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    controller: StateSpace | None = None,
) -> NDArray[np.float64]:
    """Return bounds that outputs stay below, unless unstable.

    Parameters
    ----------
    paths : Paths
        The plant, k kinds of units.
    loops : sequence of Loop or None
        Loop i acts on output i.
    distribution : (k, k)
        Plant inputs from controller outputs.
    duration : float
        Time simulated.
    moved : tuple of (k,)
        Sizes of what moves the inputs and of what moves the outputs.
    controller : StateSpace or None
        A full controller in place of loops.

    Returns
    -------
    (k,) ndarray
        A million times what can be expected; the largest number for an output that nothing moves.

    """
    inputs, outputs = moved
    kinds = range(paths.size)
    gain = np.array([[_size(paths, row, column, duration) for column in kinds] for row in kinds])
    first = np.maximum(outputs, (gain * inputs).max(axis=1))
    answers = np.array([0.0 if loop is None else _gain(loop, duration) for loop in loops])
    answer = (np.abs(distribution) * (answers * first)).max(axis=1)
    if controller is not None:
        answering = np.abs(controller.D) + np.abs(controller.response(1 / duration)[0])
        answer = (answering * first).max(axis=1)
    expected = np.maximum(first, (gain * answer).max(axis=1))
    return np.where(expected > 0, _FAR * expected, np.finfo(float).max)


def sizes_of(
    steps: Sequence[Step], kind_of: dict[int, int], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the sizes of steps on the inputs and on the outputs of each kind, (size,) each.

    `kind_of` gives the kind of a unit; steps on other units are left out.
    """
    inputs, outputs = np.zeros(size), np.zeros(size)
    for step in steps:
        if step.unit in kind_of:
            at_output = step.kind in {StepKind.SETPOINT, StepKind.MEASUREMENT}
            side = outputs if at_output else inputs
            side[kind_of[step.unit]] += abs(step.size)
    return inputs, outputs


def _size(paths: Paths, row: int, column: int, duration: float) -> float:
    return sum(
        weight * abs(complex(function(1j / duration)))
        for function, weight in paths.between(row, column)
    )


def _gain(loop: Loop, duration: float) -> float:
    """Return what a loop makes of an error that lasts for the duration."""
    return abs(loop.gain) + abs(loop.integral_gain) * duration
