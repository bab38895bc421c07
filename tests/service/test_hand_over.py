"""Settings as they are typed into a control system, over HTTP and on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from service.cli.commands import app
from service.configuration import Configuration
from service.http.app import create_app
from solver.hand_over.known import KNOWN

PLANT: dict[str, Any] = {
    "plant": {
        "kind": "first_order", "n": 2, "gain": 1.0, "time_constant": 100.0, "interaction": 0.949,
    },
    "uncertainty": {"epsilon": 0.2, "theta": 1.0},
    "performance": {"max_peak": 2.0, "offset": 0.0, "tau_p": 19.0},
}  # fmt: skip
LOOPS = [{"gain": 46.3, "integral_time": 101.0}, {"gain": 22.8, "integral_time": 3.15}]
SPANS = [
    {"tag": "TIC-101", "output_span": 250.0, "input_span": 100.0},
    {"tag": "TIC-102", "output_span": 50.0, "input_span": 100.0},
]


@pytest.fixture(scope="module")
def http(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("service")
    configuration = Configuration(data_dir=folder, workers=1, analysis_processes=1)
    with TestClient(create_app(configuration)) as client:
        yield client


def handed_over(http: Any, **body: Any) -> dict[str, Any]:
    answer = http.post("/v1/controller-forms", json={"loops": LOOPS, **body})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()["hand_over"]
    return found


def test_values_are_in_the_units_of_the_system(http: Any) -> None:
    """Spans make the gain, the unit of time the times; tag and action stand beside them."""
    found = handed_over(
        http, time_unit="min", instruments=SPANS, target={"controller": "deltav_standard"}
    )
    first, second = found["loops"]
    assert (first["tag"], first["action"]) == ("TIC-101", "reverse")
    assert [each["value"] for each in first["values"]] == [115.8, 6060.0]  # 46.3*2.5, 101*60
    assert [each["value"] for each in second["values"]] == [11.4, 189.0]
    assert [each["name"] for each in first["values"]] == ["GAIN", "RESET"]
    assert [each["unit"] for each in first["values"]] == ["%/%", "s"]
    assert found["source"].startswith("Emerson, DeltaV")


def test_what_is_not_typed_of_the_equation_is_told(http: Any) -> None:
    """A PI has no value for the derivative of the equation: that it is 0 there is said."""
    off = "No derivative action: RATE is 0 in the equation."
    target = {"controller": "deltav_standard"}
    found = handed_over(http, time_unit="min", instruments=SPANS, target=target)
    assert off in found["notes"]
    with_derivative = {"form": "ideal", **LOOPS[0], "derivative_time": 2.0, "filter_time": 0.2}
    found = handed_over(http, loops=[with_derivative], time_unit="min", target=target)
    assert off not in found["notes"]


def test_band_and_repeats(http: Any) -> None:
    """A proportional band is 100 over the gain, repeats are one over the integral time."""
    target = {"form": "ideal", "gain": "proportional_band", "integral": "repeats", "digits": 3}
    found = handed_over(http, time_unit="s", instruments=SPANS[:1], target=target)
    assert [each["value"] for each in found["loops"][0]["values"]] == [0.864, 0.0099]
    assert [each["unit"] for each in found["loops"][0]["values"]] == ["%", "1/s"]


def test_gains_of_the_parallel_form_are_called_gains(http: Any) -> None:
    """A described parallel law has Kp, Ki and Kd, in the equation and beside the values."""
    target = {"form": "parallel", "time_unit": "s", "digits": 3}
    found = handed_over(http, time_unit="min", target=target)
    assert found["equation"].startswith("Kp + Ki/s + Kd*s")
    assert [each["name"] for each in found["loops"][0]["values"]][:2] == ["Kp", "Ki"]


def test_typed_values_are_judged_on_the_plant(http: Any) -> None:
    """Few digits miss the demand that many meet; the peak is that of the typed values."""
    peaks = []
    for digits in (1, 6):
        found = handed_over(http, **PLANT, target={"form": "ideal", "digits": digits})
        peak = found["peaks"]["robust_performance"]["value"]
        assert found["nominally_stable"]
        assert found["demand_met"] is (peak <= 1 + 1e-6)
        peaks.append(peak)
    typed = [each["loop"] for each in found["loops"]]
    answer = http.post("/v1/robustness", json={**PLANT, "loops": typed}).json()
    assert peaks[1] == pytest.approx(answer["peaks"]["robust_performance"]["value"], rel=1e-6)
    assert peaks[0] > 1.005
    assert peaks[1] < 1.002  # of the settings as given, to five digits


def test_an_unstable_loop_has_no_peak(http: Any) -> None:
    """Gains that the dead time does not bear are unstable, and say nothing else."""
    plant = {**PLANT["plant"], "dead_time": 50.0}
    found = handed_over(http, **{**PLANT, "plant": plant}, target={"form": "ideal"})
    assert (found["nominally_stable"], found["demand_met"], found["peaks"]) == (False, False, None)


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"target": {"controller": "deltav_standard"}}, "/time_unit"),
        ({"target": {"controller": "no_such"}, "time_unit": "s"}, "/target/controller"),
        ({"target": {}}, "/target"),
        ({"target": {"form": "parallel", "gain": "proportional_band"}}, "/target/gain"),
        ({"target": {"form": "ideal"}, "instruments": SPANS * 2}, "/instruments"),
        (
            {"target": {"form": "ideal"}, "instruments": [{"output_span": 5.0}]},
            "/instruments/0/input_span",
        ),
        ({**PLANT}, "/target"),
        ({"plant": PLANT["plant"], "target": {"form": "ideal"}}, "/uncertainty"),
    ],
)
def test_what_cannot_be_typed_is_refused_by_name(
    http: Any, body: dict[str, Any], pointer: str
) -> None:
    """Each fault names its field."""
    answer = http.post("/v1/controller-forms", json={"loops": LOOPS, **body})
    assert answer.status_code == 422, answer.text
    assert [each["pointer"] for each in answer.json()["errors"]] == [pointer]


def test_a_loop_without_such_a_form_says_why(http: Any) -> None:
    """One loop that the law does not have leaves the others theirs, and nothing is judged."""
    loops = [LOOPS[0], {"gain": 1.0, "integral_time": 1.0, "derivative_time": 50.0}]
    found = handed_over(http, **PLANT, loops=loops, target={"form": "ideal"})
    assert found["loops"][1]["values"] == []
    assert "no ideal form" in found["loops"][1]["reason"]
    assert found["demand_met"] is None


def test_known_controllers_are_listed(http: Any) -> None:
    """All of them, with equation and source; each can be a target."""
    items = http.get("/v1/controllers").json()["items"]
    assert [item["name"] for item in items] == [known.name for known in KNOWN]
    for item in items:
        found = handed_over(http, time_unit="h", target={"controller": item["name"]})
        assert found["equation"] == item["equation"]


def run(*arguments: str, text: str = "") -> Any:
    return CliRunner().invoke(app, [*arguments], input=text)


def test_the_command_prints_what_to_type() -> None:
    """The verdict stands first, then the equation and the values."""
    body = {**PLANT, "loops": LOOPS, "target": {"form": "ideal", "digits": 1}}
    done = run("controller-forms", "-", text=json.dumps(body))
    assert done.exit_code == 0
    assert done.stdout.startswith("With the typed values the demand is not met: mu reaches 1.")
    assert "K*(1 + 1/(Ti*s) + Td*s/(1 + Tf*Td*s))" in done.stdout


def test_examples_and_schemas_are_at_hand(tmp_path: Path) -> None:
    """An example is a request as it stands; a schema tells what a command reads."""
    assert "parallel_reactors" in run("examples").stdout
    path = tmp_path / "request.json"
    path.write_text(run("examples", "decoupling_wood_berry").stdout)
    assert run("decouple", str(path)).exit_code == 0
    assert "loops" in json.loads(run("schema", "controller-forms").stdout)["properties"]
    for command, name, meant in (
        ("examples", "paralel_reactors", "parallel_reactors"),
        ("schema", "robustnes", "robustness"),
    ):
        done = run(command, name)
        assert done.exit_code == 2
        assert f"did you mean {meant}?" in done.stderr
    items = json.loads(run("controllers", "--json").stdout)["items"]
    assert len(items) == len(KNOWN)


def test_init_writes_a_request_from_answers(tmp_path: Path) -> None:
    """Answers that cannot be read are asked again; a file that is there is never touched."""
    path = tmp_path / "plant.json"
    answers = "Reactors\nh\n3\n1,5\nfast\n10\n0\n0.5\n\n\npid\n"
    done = run("init", str(path), text=answers)
    assert done.exit_code == 0, done.output
    body = json.loads(path.read_text())
    assert (body["title"], body["time_unit"], body["plant"]["n"]) == ("Reactors", "h", 3)
    assert (body["plant"]["gain"], body["controller"]["kind"]) == (1.5, "PID")
    before = path.read_text()
    assert run("init", str(path), text=answers).exit_code == 2
    assert path.read_text() == before
    assert run("init", str(tmp_path / "other.json"), text="Reactors\n").exit_code == 130
    assert not (tmp_path / "other.json").exists()
