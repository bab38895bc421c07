"""How each loop moves after a set-point step and after a load, all loops closed.

The model as given, today's and identical settings beside it, and a band over plants that the
settings must serve: the inputs off by the whole weight up, down and in turns, and the perturbation
that is worst for robust performance; the sensors off by their weights; corners and worst plant of a
spread; plants of scenarios with all loops in service. The band is drawn from these plants; it
proves nothing of others.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from service.sheet.naming import instrument_of
from service.tuned import RequestedTuning
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, Plant
from solver.model.subsystems import interchangeable
from solver.model.transfer_function import TransferFunction
from solver.simulation.actuators import Actuators, OwnActuators
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.integrator import End
from solver.simulation.loops import Limits, Loop
from solver.simulation.step_response import step_response
from solver.simulation.worst_actuators import worst_actuators
from solver.stability.closed_loop import is_stable

__all__ = [
    "MOST_STEPS",
    "SHOWN",
    "Band",
    "Measured",
    "Moves",
    "Response",
    "interchange",
    "moves",
    "steps_of",
]

SHOWN = 6  # kinds of loops; a figure of more is read by nobody
_SHARE = 0.1  # of a span: the steps where spans are known
_PROBES = (3.0, 12.0, 48.0, 192.0)  # closed-loop time constants within which loops settle
_COARSE, _ENOUGH = 150, 0.99  # samples that a curve needs; a length that counts as the whole one
_FINE = 2001  # samples of a response whose beginning alone may be shown
# A simulation takes at least a step for each shortest dead time. So many steps take about a second:
# more are not spent on finding out how long a response lasts, nor on the plants of the band.
MOST_STEPS = 4000
_BEYOND = 1.4  # times the settling time is shown
_SET_POINT_BAND, _LOAD_BAND = 0.02, 0.05  # of the step, and of the largest error: settled


@dataclass(frozen=True)
class Measured:
    """One response in numbers, in the units of its signals; None where it does not settle."""

    settling_time: float | None
    overshoot: float | None
    largest_error: float
    input_peak: float


@dataclass(frozen=True, eq=False)
class Response:
    """Output and input of the loop that is stepped."""

    time: NDArray[np.float64]
    output: NDArray[np.float64]
    input: NDArray[np.float64]
    measured: Measured


@dataclass(frozen=True, eq=False)
class Band:
    """Lowest and highest output and input over the plants that were tried, at times of its own."""

    time: NDArray[np.float64]
    output: tuple[NDArray[np.float64], NDArray[np.float64]]
    input: tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Moves:
    """What follows one step, on one kind of loop.

    Parameters
    ----------
    kind : StepKind
        SETPOINT or LOAD.
    units : tuple of int
        The loops (from 0) that move like this one.
    size : float
        Of the step, in the unit of its signal.
    given : Response
        The settings found.
    band : Band or None
        None where no plant of the set could be simulated.
    others : dict
        Other settings by name; None for those that are unstable, and an entry on the first loop
        alone for those that are the same on all of identical units.
    limited : Response or None
        The settings found, the input within half its span on either side of rest; None where the
        span is not known, or the input stays within.

    """

    kind: StepKind
    units: tuple[int, ...]
    size: float
    given: Response
    band: Band | None
    others: dict[str, Response | None]
    limited: Response | None


def moves(tuned: RequestedTuning, others: dict[str, tuple[Controller, ...]]) -> Iterator[Moves]:
    """Yield what follows a set-point step and a load on each kind of loop.

    Parameters
    ----------
    tuned : RequestedTuning
        Stable settings.
    others : dict
        Further settings by name, one controller a unit.

    Raises
    ------
    InvalidInputError
        The simulation cannot hold the plant.

    """
    plant = tuned.plant
    stable = {name for name, loops in others.items() if is_stable(plant, loops)}
    kinds = interchangeable(plant, tuned.loops)[:SHOWN]
    for kind in (StepKind.SETPOINT, StepKind.LOAD):
        tasks = [_Task(tuned, _step(tuned, kind, units[0])) for units in kinds]
        first = [task.until_settled(tuned.loops) for task in tasks]
        duration = max(response.shown for response in first)
        count = int(MOST_STEPS // (len(kinds) * steps_of(plant, duration)))
        band = tuple(itertools.islice(_plants_of_the_set(tuned), count))
        for units, task, seen in zip(kinds, tasks, first, strict=True):
            given = seen.within(duration)
            if given.time[-1] < _ENOUGH * duration or given.time.size < _COARSE:
                given = task.response(tuned.loops, duration)
            span = instrument_of(tuned, units[0]).input_span
            half = None if span is None else span / 2
            limited = None
            if half is not None and given.measured.input_peak > half:
                limited = task.response(tuned.loops, duration, limit=half)
            yield Moves(
                kind,
                units,
                task.step.size,
                given,
                _band([task.response(tuned.loops, duration, other=each) for each in band]),
                {
                    name: task.response(loops, duration) if name in stable else None
                    for name, loops in others.items()
                    if units == kinds[0] or not interchange(plant, loops)
                },
                limited,
            )


def steps_of(plant: Plant, duration: float) -> float:
    """Return how many steps a simulation takes at least: one for each shortest dead time."""
    delays = [element.dead_time for element in plant.elements if element.dead_time > 0]
    return max(1.0, duration / min(delays)) if delays else 1.0


def interchange(plant: Plant, loops: Sequence[Controller]) -> bool:
    """Return whether the loops are all alike: what one does, all do."""
    return len(interchangeable(plant, loops)) == 1


def _step(tuned: RequestedTuning, kind: StepKind, unit: int) -> Step:
    """Return a step of a tenth of the signal's span, of one where that is not known."""
    signals = instrument_of(tuned, unit)
    span = signals.output_span if kind is StepKind.SETPOINT else signals.input_span
    return Step(kind, unit, 0.0, 1.0 if span is None else _SHARE * span)


@dataclass(frozen=True, eq=False)
class _Seen:
    """A response, and how long it is worth showing."""

    response: Response
    shown: float

    def within(self, duration: float) -> Response:
        """Return the response up to there."""
        whole = self.response
        kept = whole.time <= duration
        return replace(
            whole, time=whole.time[kept], output=whole.output[kept], input=whole.input[kept]
        )


@dataclass(frozen=True)
class _Task:
    """One step on one loop of the tuned plant."""

    tuned: RequestedTuning
    step: Step

    def until_settled(self, loops: Sequence[Controller]) -> _Seen:
        """Return a response with how much of it is worth showing: until it has settled, and more.

        Raises
        ------
        InvalidInputError
            The dead time is too short to simulate even the first part.

        """
        tau_p = self.tuned.result.tau_p
        assert tau_p is not None  # noqa: S101 - for the type checker: there are settings
        if steps_of(self.tuned.plant, _PROBES[0] * tau_p) > MOST_STEPS:
            message = "the shortest dead time is too short for responses of this length"
            raise InvalidInputError(message)
        seen = None
        for probe in _PROBES:
            if seen is not None and steps_of(self.tuned.plant, probe * tau_p) > MOST_STEPS:
                return seen
            response = self.response(loops, probe * tau_p, samples=_FINE)
            seen = _Seen(response, probe * tau_p)
            settled = response.measured.settling_time
            if settled is not None and settled * _BEYOND <= probe * tau_p:
                return _Seen(response, max(_BEYOND * settled, tau_p))
        assert seen is not None  # noqa: S101 - for the type checker: there are probes
        return seen

    def response(
        self,
        loops: Sequence[Controller],
        duration: float,
        *,
        other: _Other | None = None,
        limit: float | None = None,
        samples: int = 501,
    ) -> Response:
        """Simulate, with an `other` plant or other actuators than those of the task."""
        limits = None
        if limit is not None:
            limits = (Limits(-limit, limit),) * self.tuned.plant.n
        found = step_response(
            Experiment(
                self.tuned.plant if other is None else other.plant,
                tuple(Loop.of(loop).without_traces(duration) for loop in loops),
                (self.step,),
                duration,
                samples=samples,
                actuators=None if other is None else other.actuators,
                limits=limits,
            ),
            of=self.step.unit,
        )
        (own,) = found.responses
        output, moved = own.output, own.input
        if self.step.kind is StepKind.SETPOINT:
            error, wide, overshoot = self.step.size - output, _SET_POINT_BAND * self.step.size, None
            overshoot = max(0.0, float(np.max(output)) / self.step.size - 1)
        else:
            error, overshoot = -output, None
            wide = _LOAD_BAND * float(np.max(np.abs(error)))
        outside = np.flatnonzero(np.abs(error) > wide)
        settled: float | None = 0.0
        if outside.size:
            last = outside[-1]
            settled = float(found.time[last + 1]) if last + 1 < found.time.size else None
        if found.end is not End.COMPLETE:
            settled = None
        measured = Measured(
            settled, overshoot, float(np.max(np.abs(error))), float(np.max(np.abs(moved)))
        )
        return Response(found.time, output, moved, measured)


def _band(runs: Sequence[Response]) -> Band | None:
    if not runs:
        return None
    length = min(run.time.size for run in runs)
    outputs = np.array([run.output[:length] for run in runs])
    inputs = np.array([run.input[:length] for run in runs])
    return Band(
        runs[0].time[:length],
        (outputs.min(axis=0), outputs.max(axis=0)),
        (inputs.min(axis=0), inputs.max(axis=0)),
    )


@dataclass(frozen=True)
class _Other:
    """A plant that the settings must serve, and what its actuators do."""

    plant: Plant
    actuators: Actuators | None = None


def _plants_of_the_set(tuned: RequestedTuning) -> Iterator[_Other]:
    """Yield plants of the set, those of each kind first that are worst."""
    yield from _with_actuators(tuned)
    yield from _of_spread(tuned)
    for scenario in tuned.arranged.scenarios:
        everywhere = scenario.in_service is None and scenario.any_in_service is None
        if scenario.plant is not None and everywhere:
            yield _Other(scenario.plant)
    yield from _with_sensors(tuned)


def _of_spread(tuned: RequestedTuning) -> Iterator[_Other]:
    """Yield the worst plant of a spread, then its corners."""
    spread, outcome = tuned.arranged.spread, tuned.result.spread
    if spread is None:
        return
    axes = spread.axes(tuned.plant)
    if outcome is not None and axes:
        shares = [outcome.worst.get(axis.title, 0.0) / axis.width for axis in axes]
        yield _Other(spread.plant_at(tuned.plant, tuple(shares)))
    for corner in spread.corners(tuned.plant):
        yield _Other(spread.plant_at(tuned.plant, corner))


def _off(weight: TransferFunction, sign: int) -> TransferFunction:
    """Return 1 + w or 1 - w: Delta is I or -I; only the magnitude of w is given, no dead time."""
    return TransferFunction(tuple(np.polyadd(weight.den, sign * np.array(weight.num))), weight.den)


def _with_sensors(tuned: RequestedTuning) -> Iterator[_Other]:
    """Yield plants seen by sensors that are off, all up and all down."""
    outputs, plant = tuned.uncertainty.outputs, tuned.plant
    if outputs is None or plant.n > MAX_MATRIX_SIZE:
        return
    for sign in (1, -1):
        rows = [
            [_off(outputs.weight_of(row), sign).in_series(element) for element in elements]
            for row, elements in enumerate(plant.rows)
        ]
        yield _Other(MatrixPlant(rows))


def _with_actuators(tuned: RequestedTuning) -> Iterator[_Other]:
    """Yield actuators within the uncertainty: the worst, all up, all down, in turns."""
    n, plant = tuned.plant.n, tuned.plant

    def off(unit: int, sign: int) -> TransferFunction:
        return _off(tuned.uncertainty.weight_of(unit), sign)

    try:
        worst = worst_actuators(plant, tuned.loops, tuned.uncertainty, tuned.performance)
    except InvalidInputError:
        worst = None
    if worst is not None:
        yield _Other(plant, worst)
    yield _Other(plant, OwnActuators(tuple(off(unit, 1) for unit in range(n))))
    yield _Other(plant, OwnActuators(tuple(off(unit, -1) for unit in range(n))))
    if n > 1:
        in_turns = (off(unit, 1 if unit % 2 == 0 else -1) for unit in range(n))
        yield _Other(plant, OwnActuators(tuple(in_turns)))
