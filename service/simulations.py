"""Set-point responses of tuned loops: each alone, and all closed in a direction.

Each of the model, and with the input perturbation that is worst for robust performance
(Skogestad, Lundstrom and Hovd 1989, section 5.3, where a dead time stands for it).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from service.schemas.drawn import DrawnStepResponse, DrawnUnits
from service.tuned import Setting, Tuned
from solver.controllers import Controller
from solver.plants import Plant
from solver.simulation import (
    Experiment,
    Loop,
    Step,
    StepKind,
    StepResponse,
    step_response,
)
from solver.simulation.actuators import Actuators
from solver.simulation.worst_actuators import worst_actuators
from solver.stability import is_stable
from solver.subsystems import subsystem

__all__ = ["Case", "alone", "together"]

_LONG = 40.0  # time constants of the demand: what has not settled then, settles too slowly to show
_SHOWN = 1.5  # times the longest settling time
_SHORTEST = 1.0  # time constants of the demand


@dataclass(frozen=True)
class Case:
    """Responses to one change of the set points.

    `worst` is None where the perturbation has no form that can be simulated, `identical` where
    there are no identical settings beside.
    """

    nominal: DrawnStepResponse
    worst: DrawnStepResponse | None
    identical: DrawnStepResponse | None


def together(tuned: Tuned, direction: NDArray[np.float64]) -> Case:
    """Return the responses with all loops closed to set-point steps of size `direction` (n,).

    Raises
    ------
    InvalidInputError
        The simulation cannot hold the plant: see `solver.simulation.step_response`.

    """
    plant = tuned.plant
    duration = _duration(tuned, _simulate(plant, tuned.loops, direction, _longest(tuned)))
    worst = _worst_actuators(tuned, plant, tuned.loops)
    return Case(
        nominal=DrawnStepResponse.of(_simulate(plant, tuned.loops, direction, duration)),
        worst=None
        if worst is None
        else DrawnStepResponse.of(_simulate(plant, tuned.loops, direction, duration, worst)),
        identical=DrawnStepResponse.of(_simulate(plant, tuned.identical, direction, duration))
        if tuned.identical
        else None,
    )


def alone(tuned: Tuned) -> Case:
    """Return the responses of each different setting to a unit step, all other loops open.

    A loop that is unstable alone is left out.

    Raises
    ------
    InvalidInputError
        As for `together`, or no loop is stable alone.

    """
    step = np.ones(1)
    singles = [
        (setting, *subsystem(tuned.plant, tuned.loops, setting.units[:1]))
        for setting in tuned.settings
    ]
    singles = [single for single in singles if is_stable(*single[1:])]
    duration = max(
        (
            _duration(tuned, _simulate(plant, loops, step, _longest(tuned)))
            for _, plant, loops in singles
        ),
        default=_longest(tuned),
    )
    nominal, worst = [], []
    for setting, plant, loops in singles:
        nominal.append((setting, _simulate(plant, loops, step, duration)))
        actuators = _worst_actuators(tuned, plant, loops)
        if actuators is not None:
            worst.append((setting, _simulate(plant, loops, step, duration, actuators)))
    identical = None
    if tuned.identical:
        plant, loops = subsystem(tuned.plant, tuned.identical, (0,))
        if is_stable(plant, loops):
            identical = DrawnStepResponse.of(_simulate(plant, loops, step, duration))
    return Case(_merged(nominal), _merged(worst) if worst else None, identical)


def _simulate(
    plant: Plant,
    loops: Sequence[Controller],
    direction: NDArray[np.float64],
    duration: float,
    actuators: Actuators | None = None,
) -> StepResponse:
    steps = tuple(
        Step(StepKind.SETPOINT, int(unit), 0.0, float(direction[unit]))
        for unit in np.flatnonzero(direction)
    )
    closed = tuple(Loop.of(loop) for loop in loops)
    return step_response(Experiment(plant, closed, steps, duration, actuators=actuators))


def _longest(tuned: Tuned) -> float:
    assert tuned.result.tau_p is not None  # noqa: S101 - for the type checker: there are settings
    return _LONG * tuned.result.tau_p


def _duration(tuned: Tuned, probe: StepResponse) -> float:
    """Return how much of a long response is worth showing."""
    longest = _longest(tuned)
    times = [
        None if point is None else point.settling_time
        for point in (response.metrics.set_point for response in probe.responses)
    ]
    settled = [time for time in times if time is not None]
    if len(settled) < len(times):
        return longest
    return min(max(_SHOWN * max(settled), _SHORTEST / _LONG * longest), longest)


def _worst_actuators(tuned: Tuned, plant: Plant, loops: Sequence[Controller]) -> Actuators | None:
    return worst_actuators(plant, loops, tuned.uncertainty, tuned.performance)


def _merged(runs: Sequence[tuple[Setting, StepResponse]]) -> DrawnStepResponse:
    """Return runs of single loops over the same time as one response."""
    drawn = [(setting, DrawnStepResponse.of(response)) for setting, response in runs]
    return DrawnStepResponse(
        time=drawn[0][1].time if drawn else [],
        responses=[
            DrawnUnits.model_validate(
                response.responses[0].model_dump() | {"units": list(setting.units)}
            )
            for setting, response in drawn
        ],
    )
