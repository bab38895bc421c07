"""The record of a relay experiment: the relay's switchings exact, the outputs at their samples."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.record import Record
from solver.model.errors import InvalidInputError
from solver.model.frequencies import corners
from solver.model.validation import instance
from solver.relay.analysis import RelayOutcome, relay_experiment
from solver.relay.experiment import RelayExperiment
from solver.relay.sequential import experiment_of
from solver.relay.sequential_query import RelayTuning
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.step_response import step_response

if TYPE_CHECKING:
    from solver.model.plants import Plant

__all__ = ["relay_record", "relay_records"]

SAMPLES = 401  # of each test; the relay's switchings are there besides
SHORT = 1 / 6  # of an experiment that waits for a limit cycle: five periods
HOLD = 6.0  # of the slowest corner's time: within a 400th of the steady state


def relay_record(experiment: RelayExperiment, outcome: RelayOutcome, name: str = "relay") -> Record:
    """Return the record that a relay experiment leaves, for `identify`.

    The relay moves one input, so a plant of n inputs takes n experiments, each on another input.
    Inputs and outputs are called u1, y1 and so on.

    Parameters
    ----------
    experiment : RelayExperiment
        With no loop closed but the relay's: a controller's output is not held between samples.
    outcome : RelayOutcome
        Of that experiment.
    name : str
        What messages call the record.

    Raises
    ------
    InvalidInputError
        Another loop is closed, or a disturbance entered.

    """
    instance(experiment, RelayExperiment, "/experiment")
    instance(outcome, RelayOutcome, "/outcome")
    if experiment.loops or experiment.steps:
        message = "a relay experiment becomes a record where no other loop is closed nor disturbed"
        raise InvalidInputError(message, "/loops" if experiment.loops else "/steps")
    switched = outcome.switchings[outcome.switchings < outcome.time[-1]]
    time = np.union1d(outcome.time, switched)
    flips = np.searchsorted(switched, time, side="right")
    moved = experiment.relay.amplitude * np.where(flips % 2, -1.0, 1.0)
    n = experiment.plant.n
    inputs = {
        f"u{j + 1}": moved if j == experiment.input else np.zeros(time.size) for j in range(n)
    }
    outputs = {f"y{i + 1}": np.full(time.size, np.nan) for i in range(n)}
    places = np.searchsorted(time, outcome.time)
    for units, values in zip(outcome.units, outcome.outputs, strict=True):
        for unit in units:
            outputs[f"y{unit + 1}"][places] = values
    return Record.with_gaps(time, inputs, outputs, name)


def relay_records(task: RelayTuning) -> list[Record]:
    """Return the records of tests that tell a plant, no loop closed but the relay's.

    Of each input a relay experiment in its loop of the pairing, which tells the plant near the
    ultimate frequency, and a pulse as high as the relay, which tells the steady state that a relay
    hides.

    Parameters
    ----------
    task : RelayTuning
        Plant, pairing and relay; the rest does not matter here.

    Returns
    -------
    list of Record
        Two a loop, relay and pulse, in the order of the outputs.

    Raises
    ------
    InvalidInputError
        As `relay_experiment`.

    """
    instance(task, RelayTuning, "")
    slowest = float(corners(task.plant)[0])
    records = []
    for output, input_ in enumerate(task.inputs):
        one = experiment_of(task, output, input_, samples=SAMPLES)
        one = replace(one, duration=one.duration * SHORT)
        records.append(
            relay_record(one, relay_experiment(one), f"relay u{input_ + 1}-y{output + 1}")
        )
        records.append(_pulse(task.plant, input_, one.relay.amplitude, HOLD / slowest))
    return records


def _pulse(plant: Plant, unit: int, size: float, hold: float) -> Record:
    steps = (
        Step(StepKind.INPUT, unit, 0.0, size),
        Step(StepKind.INPUT, unit, hold, -size),
    )
    n = plant.n
    outcome = step_response(Experiment(plant, (None,) * n, steps, 2 * hold, samples=SAMPLES))
    time = np.union1d(outcome.time, [hold])
    places = np.searchsorted(time, outcome.time)
    inputs = {f"u{j + 1}": np.where((time < hold) & (j == unit), size, 0.0) for j in range(n)}
    outputs = {f"y{i + 1}": np.full(time.size, np.nan) for i in range(n)}
    for each in outcome.responses:
        for i in each.units:
            outputs[f"y{i + 1}"][places] = each.output
    return Record.with_gaps(time, inputs, outputs, f"pulse u{unit + 1}")
