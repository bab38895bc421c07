"""Parallel drives over HTTP, by the real solver."""

import json
from pathlib import Path

import httpx
import pytest
from samples import altered

from service.analyses.parallel_drives import ParallelDrivesResult

PATH = "/v1/parallel-drives"
EXAMPLES = Path(__file__).parents[2] / "examples"
TWO_MOTORS = json.loads((EXAMPLES / "parallel_drives_two_motors.json").read_text())


def test_two_motors(client: httpx.Client) -> None:
    """Astrom and Hagglund, section 11.4: one free mode; the pulse makes a motor brake; cured."""
    response = client.post(PATH, json=TWO_MOTORS)
    assert response.status_code == 200
    result = ParallelDrivesResult.model_validate(response.json())
    assert result.analysis.unobservable_modes == 1
    assert result.analysis.remedy is not None
    assert result.analysis.remedy.hidden_modes == 0
    assert result.simulation.original.efforts[-1][1] < 0
    assert result.simulation.mended is not None
    assert result.simulation.mended.shares_at_end == pytest.approx([0.5, 0.5], abs=1e-4)


def test_one_proportional_unit(client: httpx.Client) -> None:
    """The smallest request: no integral action, nothing to mend."""
    request = {"load": {"num": [1], "den": [1, 1]}, "drives": [{"proportional_gain": 2}]}
    result = ParallelDrivesResult.model_validate(client.post(PATH, json=request).json())
    assert result.analysis.remedy is None
    assert result.simulation.mended is None


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/load/num", [1, 1], "/load/num"),
        ("/load/dead_time", 0.5, "/load/dead_time"),
        ("/drives", [], "/drives"),
        ("/drives", [{"proportional_gain": 0}], "/drives"),
        ("/drives/1/integral_gain", -1, "/drives/1/integral_gain"),
        ("/drives/0/gain", 1, "/drives/0/gain"),
        ("/shares", [0.5, 0.6], "/shares"),
        ("/shares", [1.0], "/shares"),
        ("/scenario/pulse_unit", 2, "/scenario/pulse_unit"),
        ("/scenario/load_time", 25, "/scenario/pulse_time"),
        ("/scenario/end", 20.5, "/scenario/end"),
        ("/scenario/points", 5, "/scenario/points"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    request = altered(TWO_MOTORS, pointer, value)
    if pointer == "/drives":
        request.pop("shares")
    response = client.post(PATH, json=request)
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == blamed
