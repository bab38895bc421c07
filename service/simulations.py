"""Responses of tuned loops: each alone, all closed in a direction, all closed under a load.

Each of the model, and with the input perturbation that is worst for robust performance
(Skogestad, Lundstrom and Hovd 1989, section 5.3, where a dead time stands for it).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from service.schemas.drawn import DrawnStepResponse, DrawnUnits
from service.tuned import RequestedTuning, Setting
from service.valves import limits_of
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.subsystems import subsystem
from solver.simulation.actuators import Actuators
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Limits, Loop
from solver.simulation.step_response import StepResponse, step_response
from solver.simulation.worst_actuators import worst_actuators
from solver.stability.closed_loop import is_stable

__all__ = ["Case", "alone", "loaded", "together"]

# Time constants of the demand within which the loops are sought to settle; what has not settled
# after the last one settles too slowly to show. Dead time makes long simulations dear.
_PROBES = (4.0, 10.0, 40.0)
_LOAD_SHOWN = 4.0  # times tau_P or the longest integral time: a load is gone by then, or nearly
_SHOWN = 1.5  # times the longest settling time

_Limits: TypeAlias = tuple[Limits | None, ...]


@dataclass(frozen=True)
class Case:
    """Responses to one change of the set points, or of the loads.

    `worst` is None where the perturbation has no form that can be simulated, `identical` where
    there are no identical settings beside, `today` where no settings are known as found, or where
    those are unstable, `limited` where no valve comes to its limits, half its span to either side
    of rest, or spans are not given.
    """

    nominal: DrawnStepResponse
    worst: DrawnStepResponse | None
    identical: DrawnStepResponse | None
    today: DrawnStepResponse | None = None
    limited: DrawnStepResponse | None = None


def together(tuned: RequestedTuning, direction: NDArray[np.float64]) -> Case:
    """Return the responses with all loops closed to set-point steps of size `direction` (n,).

    Raises
    ------
    InvalidInputError
        The simulation cannot hold the plant: see `solver.simulation.step_response.step_response`.

    """
    plant = tuned.plant
    duration = _duration(tuned, plant, tuned.loops, direction)
    return _closed(tuned, StepKind.SETPOINT, direction, duration)


def loaded(tuned: RequestedTuning, unit: int) -> Case:
    """Return the responses with all loops closed to a unit step of load at one unit's input.

    Raises
    ------
    InvalidInputError
        As for `together`.

    """
    direction = np.eye(tuned.plant.n)[unit]
    tau_p = tuned.result.tau_p
    assert tau_p is not None  # noqa: S101 - for the type checker: there are settings
    slowest = max(loop.integral_time or 0.0 for loop in tuned.loops)
    return _closed(tuned, StepKind.LOAD, direction, _LOAD_SHOWN * max(tau_p, slowest))


def _closed(
    tuned: RequestedTuning, kind: StepKind, direction: NDArray[np.float64], duration: float
) -> Case:
    """Return the responses with all loops closed."""

    def simulated(
        actuators: Actuators | None = None, limits: _Limits | None = None
    ) -> StepResponse:
        return _simulate(
            tuned.plant, tuned.loops, direction, duration, actuators, kind=kind, limits=limits
        )

    def beside(loops: Sequence[Controller]) -> DrawnStepResponse:
        found = _simulate(tuned.plant, loops, direction, duration, kind=kind)
        return DrawnStepResponse.of(found)

    nominal = simulated()
    limits = _limits(tuned, nominal)
    worst = _worst_actuators(tuned, tuned.plant, tuned.loops, range(tuned.plant.n))
    today = tuned.as_found
    return Case(
        nominal=DrawnStepResponse.of(nominal),
        worst=None if worst is None else DrawnStepResponse.of(simulated(worst)),
        identical=beside(tuned.identical) if tuned.identical else None,
        today=beside(today) if today and is_stable(tuned.plant, today) else None,
        limited=None if limits is None else DrawnStepResponse.of(simulated(limits=limits)),
    )


def _limits(tuned: RequestedTuning, found: StepResponse) -> _Limits | None:
    """Return the limits of the valves; None where none of them is reached."""
    halves = limits_of(tuned.request.signals(tuned.plant.n))
    reached = any(
        (half := halves[unit]) is not None and float(np.abs(response.input).max()) > half
        for response in found.responses
        for unit in response.units
    )
    if not reached:
        return None
    return tuple(None if half is None else Limits(-half, half) for half in halves)


def alone(tuned: RequestedTuning) -> Case:
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
    if not singles:
        message = "no loop is stable alone"
        raise InvalidInputError(message)
    duration = max(_duration(tuned, plant, loops, step) for _, plant, loops in singles)
    nominal, worst = [], []
    for setting, plant, loops in singles:
        nominal.append((setting, _simulate(plant, loops, step, duration)))
        actuators = _worst_actuators(tuned, plant, loops, setting.units[:1])
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
    *,
    kind: StepKind = StepKind.SETPOINT,
    limits: _Limits | None = None,
) -> StepResponse:
    steps = tuple(
        Step(kind, int(unit), 0.0, float(direction[unit])) for unit in np.flatnonzero(direction)
    )
    closed = tuple(Loop.of(loop).without_traces(duration) for loop in loops)
    return step_response(
        Experiment(plant, closed, steps, duration, actuators=actuators, limits=limits)
    )


def _duration(
    tuned: RequestedTuning,
    plant: Plant,
    loops: Sequence[Controller],
    direction: NDArray[np.float64],
) -> float:
    """Return how much of the response is worth showing: until it has settled, and some more."""
    tau_p = tuned.result.tau_p
    assert tau_p is not None  # noqa: S101 - for the type checker: there are settings
    for probe in _PROBES:
        responses = _simulate(plant, loops, direction, probe * tau_p).responses
        changes = [response.metrics.set_point for response in responses]
        times = [change.settling_time for change in changes if change is not None]
        settled = [time for time in times if time is not None]
        if len(settled) == len(times):
            return max(_SHOWN * max(settled), tau_p)
    return _PROBES[-1] * tau_p


def _worst_actuators(
    tuned: RequestedTuning, plant: Plant, loops: Sequence[Controller], units: Sequence[int]
) -> Actuators | None:
    """Return the worst actuators of the `units` in service; None where outputs err too."""
    if tuned.uncertainty.outputs is not None:
        return None
    return worst_actuators(
        plant, loops, tuned.uncertainty.of_units(units), tuned.performance.of_units(units)
    )


def _merged(runs: Sequence[tuple[Setting, StepResponse]]) -> DrawnStepResponse:
    """Return runs of single loops over the same time as one response."""
    drawn = [(setting, DrawnStepResponse.of(response)) for setting, response in runs]
    return DrawnStepResponse(
        time=drawn[0][1].time,
        responses=[
            DrawnUnits.model_validate(
                response.responses[0].model_dump() | {"units": list(setting.units)}
            )
            for setting, response in drawn
        ],
    )
