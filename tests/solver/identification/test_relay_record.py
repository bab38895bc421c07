"""A plant found again from relay experiments, one on each input."""

import numpy as np
import pytest

from solver.identification.identify import identify
from solver.identification.relay_record import relay_record, relay_records
from solver.identification.selection import Allowed
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.relay.analysis import relay_experiment
from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment
from solver.relay.sequential_query import RelayTuning
from solver.simulation.loops import Loop

PLANT = MatrixPlant(
    [
        [TransferFunction([2], [10, 1], 2), TransferFunction([0.8], [14, 1], 3)],
        [TransferFunction([-0.5], [8, 1], 1), TransferFunction([1.5], [6, 1], 2.5)],
    ]
)


def experiment(unit: int, loops: tuple[PlacedLoop, ...] = ()) -> RelayExperiment:
    """Return the experiment on a loop of the diagonal."""
    return RelayExperiment(PLANT, unit, unit, Relay(1.0, 0.02), loops, 80.0, samples=401)


def test_plant_is_found_again() -> None:
    """Without noise: to a thousandth, dead times and all."""
    records = []
    for unit in range(2):
        one = experiment(unit)
        records.append(relay_record(one, relay_experiment(one), f"relay {unit + 1}"))
    found = identify(records, allowed=Allowed(1))
    omega = np.geomspace(1e-2, 2, 20)
    assert found.plant.response(omega) == pytest.approx(PLANT.response(omega), rel=5e-3, abs=1e-3)


def test_other_loops_must_be_open() -> None:
    """A controller's output is not held between samples."""
    closed = experiment(0, (PlacedLoop(1, 1, Loop(0.5, 10.0)),))
    with pytest.raises(InvalidInputError, match="no other loop"):
        relay_record(closed, relay_experiment(closed))


def test_sequence_of_experiments_tells_steady_state_and_ultimate_frequency() -> None:
    """Elements of third order are fitted with two lags: right at rest, covered beyond."""
    lag = TransferFunction([1], [1, 3, 3, 1])
    plant = MatrixPlant(
        [[lag, TransferFunction([-0.2], [2, 1])], [TransferFunction([0], [1]), lag]]
    )
    records = relay_records(RelayTuning(plant, Relay(1.0, 0.01)))
    assert [record.name for record in records] == [
        "relay u1-y1", "pulse u1", "relay u2-y2", "pulse u2",
    ]  # fmt: skip
    found = identify(records, allowed=Allowed(2))
    omega = np.array([1e-3, 0.03, 0.8, 3**0.5, 3.0])
    G, truth = found.plant.response(omega), plant.response(omega)
    assert truth[0] == pytest.approx(G[0], abs=0.03)
    error = np.linalg.norm(np.linalg.solve(G, truth - G), 2, axis=(-2, -1))
    assert np.all(error <= found.cover.weight.magnitude(omega))
