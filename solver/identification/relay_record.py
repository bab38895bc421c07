"""The record of a relay experiment: the relay's switchings exact, the outputs at their samples."""

from __future__ import annotations

import numpy as np

from solver.identification.record import Record
from solver.model.errors import InvalidInputError
from solver.model.validation import instance
from solver.relay.analysis import RelayOutcome
from solver.relay.experiment import RelayExperiment

__all__ = ["relay_record"]


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
