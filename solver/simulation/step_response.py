"""Closed-loop time responses to steps, with exact dead time.

Set-point, load and measurement steps on any mix of closed and open loops: what Skogestad,
Lundstrom and Hovd (1989), figs. 8-10, and Astrom and Hagglund, Advanced PID Control (2006),
figs. 11.2-11.8 and 11.10, show.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.equality import ByValue
from solver.model.validation import instance
from solver.simulation.bounds import default_bounds, sizes_of
from solver.simulation.closed_loop import ClosedLoop, close, events
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.integrator import End, integrate
from solver.simulation.metrics import (
    SetPointMetrics,
    absolute_integrals,
    set_point_metrics,
    square_integral,
    total_variation,
)
from solver.simulation.paths import Paths, alike
from solver.simulation.saturation import Saturation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.simulation.trajectory import Trajectory, TurningPoints

__all__ = [
    "EventMetrics",
    "Metrics",
    "StepResponse",
    "UnitResponse",
    "step_response",
]


EVENTS_KEPT = 100  # with measures of their own; more than anybody reads


@dataclass(frozen=True)
class EventMetrics:
    """Measures of one closed loop from one event to the next, whatever unit they are on.

    Attributes
    ----------
    start, end : float
        The event, and the next one or the end of the simulation.
    change : float
        What the event changes the loop's own set point by; 0 where it does not.
    set_point : SetPointMetrics or None
        The response to that change; None without one.
    error_before, error_after : float
        Set point minus output right before and right after the event.
    largest_error : float
        Largest |error| after the event.
    absolute_error : float
        Integral of |error|.
    input_variation : float
        Total variation of the input, the jump at the event included.

    """

    start: float
    end: float
    change: float
    set_point: SetPointMetrics | None
    error_before: float
    error_after: float
    largest_error: float
    absolute_error: float
    input_variation: float


@dataclass(frozen=True)
class Metrics:
    """Measures of one unit's response, over all time unless said otherwise.

    Attributes
    ----------
    set_point : SetPointMetrics or None
        Of its first set-point change, from there to the next step of any unit; None for an open
        loop, or where there is no such change.
    events : tuple of EventMetrics
        From each event to the next, the first hundred; empty for an open loop.
    absolute_error, squared_error : float or None
        Integrals of |e| and e^2, e the set point minus output; None for an open loop.
    largest_error : float or None
        Largest |e|; None for an open loop.
    input_variation : float
        Total variation of the input.

    """

    set_point: SetPointMetrics | None
    events: tuple[EventMetrics, ...]
    absolute_error: float | None
    squared_error: float | None
    largest_error: float | None
    input_variation: float


@dataclass(frozen=True, eq=False)
class UnitResponse(ByValue):
    """Response of units that move alike.

    Attributes
    ----------
    units : tuple of int
        The units.
    set_point, output, input : (k,) ndarray
        At the sampled times; the input is the limited one, before the actuator. At a jump the
        value after it.
    metrics : Metrics
        The measures of each of these units.

    """

    units: tuple[int, ...]
    set_point: NDArray[np.float64]
    output: NDArray[np.float64]
    input: NDArray[np.float64]
    metrics: Metrics


@dataclass(frozen=True, eq=False)
class StepResponse(ByValue):
    """Outcome of a simulation; every response is right up to the last time.

    Attributes
    ----------
    end : End
        COMPLETE; BOUND where an output exceeded its bound, as those of an unstable loop do;
        STEP_LIMIT where the resolution wanted too many steps.
    time : (k,) ndarray
        Sampled times.
    responses : tuple of UnitResponse
        One for each kind of unit.

    """

    end: End
    time: NDArray[np.float64]
    responses: tuple[UnitResponse, ...]


def step_response(experiment: Experiment, *, of: int | None = None) -> StepResponse:
    """Simulate.

    Parameters
    ----------
    experiment : Experiment
        Plant, loops and steps.
    of : int or None
        The unit, from 0, whose response alone is sampled and measured; None: all.

    Returns
    -------
    StepResponse
        Signals within about 1e-9 of their largest value, and their measures.

    Raises
    ------
    InvalidInputError
        More than 20 different units, a dead time far shorter than the duration, an
        algebraic loop without solution.

    """
    instance(experiment, Experiment, "")
    paths = _paths(experiment)
    stand_ins = [units[0] for units in paths.units]
    loops = [experiment.loops[unit] for unit in stand_ins]
    distribution = (
        np.eye(paths.size) if experiment.distribution is None else experiment.distribution
    )
    wired = close(
        paths,
        loops,
        distribution,
        experiment.actuators,
        None if experiment.limits is None else [experiment.limits[u] for u in stand_ins],
        controller=experiment.controller,
    )
    steps = [
        (stand_ins.index(step.unit), step)
        for step in experiment.steps
        if step.unit in stand_ins and step.time < experiment.duration
    ]
    moved = sizes_of(experiment.steps, {unit: at for at, unit in enumerate(stand_ins)}, paths.size)
    trajectory, end = integrate(
        wired.wiring,
        experiment.duration,
        events(experiment.steps, wired, paths),
        outputs=[place.at for place in wired.outputs],
        bound=default_bounds(
            paths,
            loops,
            distribution,
            experiment.duration,
            moved,
            controller=experiment.controller,
        )
        if experiment.bound is None
        else np.full(paths.size, experiment.bound),
        switching=_saturation(wired, experiment, stand_ins),
    )
    time = np.linspace(0.0, trajectory.end, experiment.samples)
    moments = sorted({step.time for _, step in steps if step.time < trajectory.end})
    responses = tuple(
        UnitResponse(
            units=units,
            set_point=_set_point([step for at, step in steps if at == kind], time),
            output=trajectory.sample(wired.outputs[kind].at, time),
            input=trajectory.sample(wired.inputs[kind].at, time),
            metrics=_metrics(
                trajectory,
                wired,
                kind,
                closed=experiment.controller is not None or experiment.loops[units[0]] is not None,
                steps=[step for at, step in steps if at == kind],
                moments=moments,
            ),
        )
        for kind, units in enumerate(paths.units)
        if of is None or of in units
    )
    return StepResponse(end, time, responses)


def _paths(experiment: Experiment) -> Paths:
    n = experiment.plant.n
    if experiment.distribution is not None or experiment.controller is not None:
        # A general matrix has no symmetry to use.
        characters: list[object] = list(range(n))
    else:
        disturbed: dict[int, list[Step]] = {}
        for step in experiment.steps:
            disturbed.setdefault(step.unit, []).append(Step(step.kind, 0, step.time, step.size))
        characters = [
            (
                experiment.loops[unit],
                frozenset(_counted(disturbed.get(unit, []))),
                None if experiment.actuators is None else experiment.actuators.of(unit),
                None if experiment.limits is None else experiment.limits[unit],
            )
            for unit in range(n)
        ]
    return alike(experiment.plant, characters)


def _counted(steps: Sequence[Step]) -> list[tuple[Step, int]]:
    """Return the steps with the number of each: two equal steps on a unit add up."""
    return [(step, steps.count(step)) for step in steps]


def _saturation(
    wired: ClosedLoop, experiment: Experiment, stand_ins: Sequence[int]
) -> Saturation | None:
    given = [
        limit
        for kind in wired.limited
        if experiment.limits is not None
        and (limit := experiment.limits[stand_ins[kind]]) is not None
    ]
    if not given:
        return None
    return Saturation(
        wired.wiring.limited, [limit.low for limit in given], [limit.high for limit in given]
    )


def _set_point(steps: Sequence[Step], time: NDArray[np.float64]) -> NDArray[np.float64]:
    value = np.zeros_like(time)
    for step in steps:
        if step.kind is StepKind.SETPOINT:
            value[time >= step.time] += step.size
    return value


def _metrics(
    trajectory: Trajectory,
    wired: ClosedLoop,
    kind: int,
    *,
    closed: bool,
    steps: Sequence[Step],
    moments: Sequence[float],
) -> Metrics:
    moved = trajectory.turning_points(wired.inputs[kind].at)
    if not closed:
        return Metrics(None, (), None, None, None, total_variation(moved))
    error = wired.errors[kind].at
    points = trajectory.turning_points(error)
    integrals = absolute_integrals(trajectory, error)
    changes = dict.fromkeys(moments, 0.0)
    for step in steps:
        if step.kind is StepKind.SETPOINT and step.time in changes:
            changes[step.time] += step.size
    kept = list(changes.items())[:EVENTS_KEPT]
    ends = [*list(moments)[1:], trajectory.end]
    seen = tuple(
        _event(trajectory, (points, moved), integrals, (start, end), change)
        for (start, change), end in zip(kept, ends, strict=False)
        if trajectory.between(start, end).start < trajectory.between(start, end).stop
    )
    return Metrics(
        set_point=next((event.set_point for event in seen if event.set_point), None),
        events=seen,
        absolute_error=float(integrals.sum()),
        squared_error=square_integral(trajectory, error),
        largest_error=float(np.abs(points.value).max()),
        input_variation=total_variation(moved),
    )


def _event(
    trajectory: Trajectory,
    signals: tuple[TurningPoints, TurningPoints],
    integrals: NDArray[np.float64],
    window: tuple[float, float],
    change: float,
) -> EventMetrics:
    """Return the measures in a window; `signals` are the error and the input."""
    steps = trajectory.between(*window)
    error, moved = (points.of_steps(steps) for points in signals)
    before = slice(steps.start - 1, steps.start)
    error_before, input_before = (
        float(points.of_steps(before).value[-1]) if steps.start else 0.0 for points in signals
    )
    return EventMetrics(
        start=window[0],
        end=window[1],
        change=change,
        set_point=set_point_metrics(error, change, window[0]) if change else None,
        error_before=error_before,
        error_after=float(error.value[0]),
        largest_error=float(np.abs(error.value).max()),
        absolute_error=float(integrals[steps].sum()),
        input_variation=total_variation(moved, input_before),
    )
