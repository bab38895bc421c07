"""Plants from physical data over HTTP."""

import json

import httpx
import pytest
from samples import altered
from typer.testing import CliRunner

from service.analyses.physical import EXAMPLE
from service.cli.commands import app
from service.schemas import TuningRequest
from service.schemas.parsing import parse

PATH = "/v1/physical-models"
KINDS = {
    "stream_split": {"flow": 10, "opening": 0.5, "pressure_drop": 2, "supply_resistance": 0.8},
    "cooled_reactors": {
        "holdup": 5000, "feed": 50, "heat_capacity": 4, "coolant": 10, "opening": 0.5,
        "evaporation_heat": 200, "vapour_heat_capacity": 0.9, "exchanger": 100,
        "feed_superheat": 60,
    },
    "exchangers": {
        "holdup_heat": 800, "stream_heat": 20, "medium_flow": 2, "medium_heat_capacity": 4,
        "exchange": 10, "temperature_difference": 60, "opening": 0.5, "pressure_drop": 2,
        "supply_resistance": 0.5,
    },
    "compressors": EXAMPLE["data"],
    "burner_passes": {"holdup_heat": 800, "stream_heat": 20, "fuel_heat": 1000, "shared": 0.5},
    "blender": {"first_flow": 70, "second_flow": 30, "first_fraction": 0.9, "second_fraction": 0.2},
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_every_equipment_is_a_plant_for_tuning(client: httpx.Client, kind: str) -> None:
    """Interaction within its limits; a tuning takes the plant as it stands."""
    result = client.post(PATH, json={"kind": kind, "n": 2, "data": KINDS[kind]}).json()
    if kind == "blender":
        assert result["interaction"] is result["limits"] is None
    else:
        low, high = result["limits"]
        assert low < result["interaction"] < high
    document = {
        "plant": result["plant"],
        "uncertainty": {"epsilon": 0.2, "theta": 1},
        "controller": {"kind": "PI"},
    }
    assert parse(TuningRequest, json.dumps(document)).build().plant.n == 2


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/kind", "boiler", "/kind"),
        ("/n", 0, "/n"),
        ("/data/head_per_flow", 0, "/data/head_per_flow"),
        ("/data/speed", 3, "/data/speed"),
        ("/data", {}, "/data"),
        ("/kind", "blender", "/data/head_per_speed"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    response = client.post(PATH, json=altered(EXAMPLE, pointer, value))
    assert response.status_code == 422
    assert [error["pointer"] for error in response.json()["errors"]] == [blamed]


def test_interaction_is_printed_with_its_limits() -> None:
    """On the command line."""
    done = CliRunner().invoke(app, ["physical", "-"], input=json.dumps(EXAMPLE))
    assert done.exit_code == 0
    assert "Interaction a = -0.3571; such equipment: -0.5 to 0." in done.stdout
