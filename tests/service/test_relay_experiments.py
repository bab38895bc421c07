"""Relay experiments over HTTP and on the command line, by the real solver."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from samples import altered

from service.analyses.relay import EXAMPLE, RelayExperimentRequest, RelayExperimentResult
from service.analyses.relay_tuning import RelayTuningRequest, compute
from service.cli.analysing import analyse_file
from service.schemas import TuningRequest
from service.schemas.parsing import parse

PATH = "/v1/relay-experiments"
REQUEST: dict[str, Any] = {**EXAMPLE, "duration": 20.0, "samples": 201}
OPEN: dict[str, Any] = {**REQUEST, "loops": []}


def carried_out(client: httpx.Client, request: dict[str, Any]) -> RelayExperimentResult:
    """Return the outcome of a request that must succeed."""
    response = client.post(PATH, json=request)
    assert response.status_code == 200, response.text
    return RelayExperimentResult.model_validate(response.json())


def test_limit_cycle_gives_settings(client: httpx.Client) -> None:
    """Johansson (1993), other loop open: h = 0.33, stable, and PI settings."""
    outcome = carried_out(client, OPEN)
    assert outcome.behaviour == "limit_cycle"
    assert outcome.cycle is not None
    assert outcome.cycle.period == pytest.approx(0.666, abs=1e-3)
    assert outcome.cycle.settings is not None
    assert outcome.cycle.settings.ziegler_nichols.gain == pytest.approx(7.204, abs=1e-3)
    (solution,) = outcome.theory.solutions
    assert solution.exists
    assert solution.stable
    assert solution.eigenvalues is not None
    assert outcome.theory.mcavoy is not None
    assert len(outcome.outputs[0]) == len(outcome.time) == 201


def test_other_loop_under_control_makes_it_unstable(client: httpx.Client) -> None:
    """Johansson (1993), fig. 8: three roots, none of them a stable oscillation."""
    outcome = carried_out(client, REQUEST)
    assert [solution.stable for solution in outcome.theory.solutions] == [False] * 3
    assert outcome.regimes[0].period == pytest.approx(0.6, abs=0.03)


def test_too_much_hysteresis_is_a_status(client: httpx.Client) -> None:
    """The output never reaches the level."""
    outcome = carried_out(client, altered(OPEN, "/relay/hysteresis", 5.0))
    assert outcome.behaviour == "no_switching"
    assert outcome.cycle is None
    assert outcome.switchings == []


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/output", 2, "/output"),
        ("/input", -1, "/input"),
        ("/relay/amplitude", 0, "/relay/amplitude"),
        ("/relay/hysteresis", -1, "/relay/hysteresis"),
        ("/relay/sampling_period", 0, "/relay/sampling_period"),
        ("/relay/sampling_period", 1e-12, "/relay/sampling_period"),
        ("/loops/0/output", 0, "/loops/0/output"),
        ("/loops/0/input", 0, "/loops/0/input"),
        ("/loops/0/loop/gain", 0, "/loops/0/loop/gain"),
        ("/duration", 0, "/duration"),
        ("/samples", 1, "/samples"),
        ("/steps", [{"kind": "load", "unit": 9}], "/steps/0/unit"),
        ("/plant/elements/0/0/den", [0.0, 0.0], "/plant/elements/0/0/den"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    response = client.post(PATH, json=altered(REQUEST, pointer, value))
    assert response.status_code == 422, response.text
    assert response.json()["errors"][0]["pointer"] == blamed


def test_a_chattering_relay_is_refused(client: httpx.Client) -> None:
    """Without hysteresis and dead time the relay would switch for ever."""
    response = client.post(PATH, json=altered(OPEN, "/relay/hysteresis", 0))
    assert response.status_code == 422
    assert "hysteresis" in response.json()["errors"][0]["detail"]


def test_command_line_prints_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], client: httpx.Client
) -> None:
    """``mutune relay --json`` prints the JSON of the service; without, tables."""
    file = tmp_path / "request.json"
    for request in (OPEN, REQUEST, {**REQUEST, "duration": 2.0}):
        file.write_text(json.dumps(request), encoding="utf-8")
        assert analyse_file("relay", file, as_json=True) == 0
        assert json.loads(capsys.readouterr().out) == client.post(PATH, json=request).json()
        assert analyse_file("relay", file, as_json=False) == 0
        assert "half period" in capsys.readouterr().out
    file.write_text("{}", encoding="utf-8")
    assert analyse_file("relay", file, as_json=True) == 2
    assert "/plant" in capsys.readouterr().err


@pytest.mark.parametrize("file", ["docs/relay.md", "examples/relay_johansson.json"])
def test_shown_requests_are_valid(file: str) -> None:
    """What the documentation and the examples show can be sent as it stands."""
    text = (Path(__file__).parents[2] / file).read_text(encoding="utf-8")
    if file.endswith(".md"):
        text = text.split("```json\n")[1].split("```")[0]
    parse(RelayExperimentRequest, text).build()


def test_sequence_of_experiments_becomes_a_tuning_request(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The plant that the tests tell, with its weight: it is taken as it stands."""
    monkeypatch.setattr("solver.identification.relay_record.SAMPLES", 61)
    lag = {"num": [1.0], "den": [4.0, 1.0], "dead_time": 1.0}
    none = {"num": [0.0], "den": [1.0]}
    request = {
        "plant": {"kind": "matrix", "elements": [[lag, none], [none, lag]]},
        "relay": {"amplitude": 1.0, "hysteresis": 0.01}, "rounds": 1, "identify": True,
    }  # fmt: skip
    model = compute(parse(RelayTuningRequest, json.dumps(request)))["model"]
    task = parse(TuningRequest, json.dumps(model)).build()
    assert task.plant.element(0, 0).static_gain == pytest.approx(1.0, rel=1e-3)
    assert task.plant.element(0, 0).dead_time == pytest.approx(1.0, rel=1e-2)
    assert [one["name"] for one in model["origin"]["records"]] == [
        "relay u1-y1", "pulse u1", "relay u2-y2", "pulse u2",
    ]  # fmt: skip
