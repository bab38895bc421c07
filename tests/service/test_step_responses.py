"""Step responses over HTTP and on the command line, by the real solver."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from samples import altered

from service.analyses.step_response import EXAMPLE, StepResponseRequest, StepResponseResult
from service.cli.analysing import analyse_file
from service.schemas.parsing import parse

PATH = "/v1/step-responses"
REQUEST: dict[str, Any] = {**EXAMPLE, "duration": 120.0, "samples": 121}


def simulated(client: httpx.Client, request: dict[str, Any]) -> StepResponseResult:
    """Return the result of a request that must succeed."""
    response = client.post(PATH, json=request)
    assert response.status_code == 200, response.text
    return StepResponseResult.model_validate(response.json())


def test_difficult_direction_and_load_step(client: httpx.Client) -> None:
    """The example: opposite set points, then a load on the first unit."""
    result = simulated(client, REQUEST)
    assert result.end == "complete"
    assert [each.units for each in result.responses] == [[0], [1]]
    first, second = result.responses
    assert (first.set_point[-1], second.set_point[-1]) == (-1.0, 1.0)
    assert first.metrics.set_point is not None
    assert second.metrics.set_point is not None
    # Skogestad, Lundstrom and Hovd (1989), fig. 10: loop 2, with its higher gain, is faster.
    assert second.metrics.set_point.rise_time is not None
    assert first.metrics.set_point.rise_time is not None
    assert second.metrics.set_point.rise_time < first.metrics.set_point.rise_time


def test_worst_case_is_not_the_nominal_response(client: httpx.Client) -> None:
    """The worst perturbation moves the response; equal units need not move alike under it."""
    request = {
        **REQUEST,
        "plant": {**REQUEST["plant"], "dead_time": 0.0},
        "direction": {"kind": "easy"},
        "steps": [],
    }
    nominal = simulated(client, request)
    perturbation = {
        "kind": "worst_case",
        "uncertainty": {"epsilon": 0.2, "theta": 1.0},
        "performance": {"tau_p": 19.0},
    }
    worst = simulated(client, {**request, "perturbation": perturbation})
    overshoots = []
    for result in (nominal, worst):
        measured = result.responses[0].metrics.set_point
        assert measured is not None
        overshoots.append(measured.overshoot)
    assert overshoots[1] > overshoots[0] + 0.05


def test_given_actuators_limits_and_distribution_are_taken(client: httpx.Client) -> None:
    """Halved actuators double the input that the loops find; limits hold; shares distribute."""
    motor = {"num": [1.0], "den": [1.0, 1.0]}
    request = {
        "plant": {"kind": "matrix", "elements": [[motor, motor], [motor, motor]]},
        "loops": [{"gain": 2.0, "integral_time": 1.0}, None],
        "steps": [{"kind": "setpoint", "unit": 0, "time": 0.0, "size": 1.0}],
        "duration": 40.0,
        "perturbation": {
            "kind": "actuators",
            "functions": [{"num": [0.5], "den": [1.0]}, {"num": [0.5], "den": [1.0]}],
        },
        "limits": [{"low": -1.0, "high": 1.5}, None],
        "distribution": [[0.5, 0.0], [0.5, 0.0]],
    }
    result = simulated(client, request)
    assert [each.input[-1] for each in result.responses] == pytest.approx([1.0, 1.0], abs=1e-6)
    assert result.responses[0].output[-1] == pytest.approx(1.0, abs=1e-6)


def test_coupled_actuators_are_taken(client: httpx.Client) -> None:
    """A coupled perturbation of weight zero gain changes nothing."""
    one = {"num": [1.0], "den": [1.0]}
    perturbation = {
        "kind": "coupled",
        "weight": {"num": [0.0], "den": [1.0]},
        "left": [one, one],
        "right": [one, one],
    }
    plain, coupled = (
        simulated(client, REQUEST),
        simulated(client, {**REQUEST, "perturbation": perturbation}),
    )
    assert coupled.responses[0].output == pytest.approx(plain.responses[0].output, abs=1e-9)


def test_unstable_loops_are_answered_up_to_the_bound(client: httpx.Client) -> None:
    """Flagged, and no number is missing."""
    request = {**REQUEST, "loops": [{"gain": -50.0, "integral_time": 10.0}] * 2, "bound": 100.0}
    result = simulated(client, request)
    assert result.end == "bound"
    assert None not in result.responses[0].output
    assert result.time[-1] < 120


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/loops", [None], "/loops"),
        ("/loops/0/gain", 0, "/loops/0/gain"),
        ("/loops/0/setpoint_weight", 2, "/loops/0/setpoint_weight"),
        ("/steps/0/unit", 2, "/steps/0/unit"),
        ("/steps/0/size", 0, "/steps/0/size"),
        ("/steps/0/kind", "push", "/steps/0/kind"),
        ("/direction", None, None),
        ("/direction/size", 0, "/direction/size"),
        ("/duration", 0, "/duration"),
        ("/duration", 1e6, "/duration"),
        ("/samples", 1, "/samples"),
        ("/samples", 10**9, "/samples"),
        ("/bound", 0, "/bound"),
        ("/plant/interaction", "much", "/plant/interaction"),
        ("/limits", [{"low": 1.0, "high": 2.0}, None], "/limits/0/low"),
        ("/limits", [{"low": 0.0, "high": 0.0}, None], "/limits/0/low"),
        ("/limits", [None], "/limits"),
        ("/distribution", [[1.0, 0.0], [0.0]], "/distribution/1"),
        ("/distribution", [[1.0]], "/distribution"),
        ("/perturbation", {"kind": "guess"}, "/perturbation/kind"),
        (
            "/perturbation",
            {"kind": "actuators", "functions": [{"num": [1.0], "den": [1.0]}]},
            "/perturbation",
        ),
        (
            "/perturbation",
            {"kind": "actuators", "functions": [{"num": [1.0], "den": [1.0, -1.0]}] * 2},
            "/perturbation/functions/0/den",
        ),
        (
            "/perturbation",
            {"kind": "actuators", "functions": [{"num": [1.0], "den": [0.0, 0.0]}] * 2},
            "/perturbation/functions/0/den",
        ),
        (
            "/perturbation",
            {"kind": "worst_case", "uncertainty": {"epsilon": 0.2, "theta": 1}, "performance": {}},
            "/perturbation/performance/tau_p",
        ),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str | None
) -> None:
    """Bad input is a 422 problem that names the field."""
    response = client.post(PATH, json=altered(REQUEST, pointer, value))
    if blamed is None:
        assert response.status_code == 200
        return
    assert response.status_code == 422, response.text
    assert response.json()["errors"][0]["pointer"] == blamed


@pytest.mark.parametrize(
    "loops",
    [[None, {"gain": 1.0, "integral_time": 10.0}], [{"gain": -50.0, "integral_time": 10.0}] * 2],
)
def test_worst_case_needs_stable_closed_loops(
    client: httpx.Client, loops: list[dict[str, Any]]
) -> None:
    """An open loop, or unstable ones, have no worst case."""
    perturbation = {
        "kind": "worst_case",
        "uncertainty": {"epsilon": 0.2, "theta": 1.0},
        "performance": {"tau_p": 19.0},
    }
    load = {"kind": "load", "unit": 0, "time": 0.0, "size": 1.0}
    request = {
        **REQUEST,
        "loops": loops,
        "steps": [load],
        "direction": None,
        "perturbation": perturbation,
    }
    response = client.post(PATH, json=request)
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == "/perturbation/kind"


def test_a_direction_needs_every_loop_closed(client: httpx.Client) -> None:
    """An open loop has no set point to move along it."""
    loops = [{"gain": 1.0, "integral_time": 10.0}, None]
    response = client.post(PATH, json={**REQUEST, "loops": loops})
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == "/direction"


@pytest.mark.parametrize(
    ("step", "blamed"),
    [
        ({"kind": "setpoint", "unit": 1, "time": 0.0, "size": 1.0}, "/steps/0/kind"),
        ({"kind": "measurement", "unit": 1, "time": 0.0, "size": 1.0}, "/steps/0/kind"),
        ({"kind": "load", "unit": 1, "time": 1e9, "size": 1.0}, "/steps/0/time"),
    ],
)
def test_a_step_that_moves_nothing_is_refused(
    client: httpx.Client, step: dict[str, Any], blamed: str
) -> None:
    """An open loop has no set point and does not measure; after the end nothing happens."""
    loops = [{"gain": 1.0, "integral_time": 10.0}, None]
    response = client.post(
        PATH, json={**REQUEST, "loops": loops, "steps": [step], "direction": None}
    )
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == blamed


def test_command_line_prints_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], client: httpx.Client
) -> None:
    """``mutune step-response --json`` prints the JSON of the service; without, a table."""
    file = tmp_path / "request.json"
    file.write_text(json.dumps(REQUEST), encoding="utf-8")
    assert analyse_file("step_response", file, as_json=True) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == client.post(PATH, json=REQUEST).json()
    assert analyse_file("step_response", file, as_json=False) == 0
    assert "settle" in capsys.readouterr().out
    file.write_text(json.dumps(altered(REQUEST, "/duration", 0)), encoding="utf-8")
    assert analyse_file("step_response", file, as_json=True) == 2
    assert "/duration" in capsys.readouterr().err


@pytest.mark.parametrize(
    "file", ["docs/simulation.md", "examples/step_response_parallel_reactors.json"]
)
def test_shown_requests_are_valid(file: str) -> None:
    """What the documentation and the examples show can be sent as it stands."""
    text = (Path(__file__).parents[2] / file).read_text(encoding="utf-8")
    if file.endswith(".md"):
        text = text.split("```json\n")[1].split("```")[0]
    parse(StepResponseRequest, text).build()


def test_every_event_is_measured(client: httpx.Client) -> None:
    """Two moments give two events for each loop, the load without a set-point change."""
    result = simulated(client, REQUEST)
    for response in result.responses:
        first, second = response.metrics.events
        assert first.set_point == response.metrics.set_point
        assert (first.end, second.change) == (second.start, 0.0)
        assert second.set_point is None
