"""How records begin, told from the readings alone."""

from pathlib import Path

import numpy as np
import pytest

from solver.identification.beginning import starts
from solver.identification.identify import identify
from solver.identification.problem import PlantStructure, Start
from solver.identification.record import Record
from solver.identification.selection import Allowed

EXAMPLES = Path(__file__).parents[3] / "examples"


def heaters(name, begin=0.0, every=1):
    """Return a record of the two-heater kit from `begin` on."""
    table = np.loadtxt(EXAMPLES / f"two_heaters_{name}.csv", delimiter=",", skiprows=1)
    table = table[table[:, 0] >= begin][::every]
    time, inputs, outputs = table[:, 0] - table[0, 0], table[:, 1:3].T, table[:, 3:].T
    return Record(
        time, dict(zip("uv", inputs, strict=True)), dict(zip("xy", outputs, strict=True)), name
    )


@pytest.mark.parametrize(
    ("record", "start"),
    [
        (heaters("steps"), Start.HELD),
        (heaters("steps", every=5), Start.HELD),
        (heaters("random"), Start.FROM_ZERO),
        (heaters("steps", 300), Start.MOVING),
        (heaters("random", 150), Start.MOVING),
        (heaters("random", 300), Start.MOVING),
    ],
)
def test_plants_that_rest_are_told_from_those_on_their_way(record, start):
    """Few readings before the first move, or none; the plant is not quite linear."""
    assert starts([record], PlantStructure.MATRIX) == [start]


def test_integrator_that_rests_is_not_on_its_way():
    """A level whose valve moves at once, with noise."""
    generator = np.random.default_rng(3)
    time = np.arange(400.0)
    u = np.repeat(generator.choice([-1.0, 0.0, 1.0], 20), 20)
    y = 0.05 * np.concatenate(([0.0], np.cumsum(u)[:-1])) + 0.05 * generator.standard_normal(400)
    assert starts([Record(time, {"u": u}, {"y": y})], PlantStructure.MATRIX) != [Start.MOVING]


def test_parts_kept_back_are_predicted():
    """Cut out of the middle of moves, they have starts of their own; as from rest it is -200 %."""
    parts = [heaters("steps", 300), heaters("random", 150), heaters("random", 300)]
    found = identify(
        [heaters("steps", every=3)], allowed=Allowed(1, integrating=False), validation=parts
    )
    assert found.begins == (Start.HELD,)
    assert min(p.normalised_fit for p in found.predictions) > 50
