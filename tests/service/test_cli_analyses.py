"""mutune interaction, decouple and parallel-drives: tables, JSON, exit codes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel
from samples import altered
from typer.testing import CliRunner, Result

from service import registry
from service.analyses.decouple import DecouplingResult
from service.analyses.interaction import InteractionRequest, InteractionResult
from service.analyses.parallel_drives import ParallelDrivesResult
from service.cli.analysing import analyse_file
from service.cli.commands import app
from service.cli.outcomes import ExitCode

EXAMPLES = Path(__file__).parents[2] / "examples"
COMMANDS: dict[str, tuple[str, type[BaseModel]]] = {
    "interaction": ("interaction_rosenbrock.json", InteractionResult),
    "decouple": ("decoupling_rosenbrock.json", DecouplingResult),
    "parallel-drives": ("parallel_drives_two_motors.json", ParallelDrivesResult),
}


def _mutune(*arguments: str, request: object = None) -> Result:
    return CliRunner().invoke(
        app, list(arguments), input=json.dumps(request), catch_exceptions=False
    )


def _example(name: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((EXAMPLES / name).read_text())
    return document


@pytest.mark.parametrize("command", COMMANDS)
def test_json_result_alone(command: str) -> None:
    """With --json standard output is the documented result on one line."""
    name, model = COMMANDS[command]
    result = _mutune(command, str(EXAMPLES / name), "--json")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert len(result.stdout.splitlines()) == 1
    model.model_validate_json(result.stdout)


def test_interaction_in_words_and_tables() -> None:
    """Sign, readings, pairings, zero with its limit and the effect asked for are printed."""
    output = _mutune("interaction", str(EXAMPLES / "interaction_rosenbrock.json")).stdout
    words = " ".join(output.split())
    assert "fight each other" in words
    assert "Loop 1 is fought" in words
    assert "Stable for gains of loop 2: 0 to no limit." in words
    assert "right half plane" in words


def test_interaction_of_parallel_units() -> None:
    """Identical units show their closed forms, however many; long lists are cut."""
    request = _example("interaction_cooled_reactors.json")
    output = _mutune("interaction", "-", request=altered(request, "/plant/n", 50)).stdout
    assert "50 identical units" in output
    assert "..." in output
    assert "No transmission zeros." in output


def test_interaction_without_relative_gains() -> None:
    """A singular gain and dependent outputs are said in words."""
    request = altered(_example("interaction_cooled_reactors.json"), "/plant/interaction", 1)
    output = _mutune("interaction", "-", request=request).stdout
    words = " ".join(output.split())
    assert "The gain is singular" in words
    assert "No pairing is recommended." in words
    assert "depend on each other at all frequencies" in words


def test_searched_zeros_say_how_far() -> None:
    """Wood and Berry's dead times do not factor out."""
    output = _mutune("interaction", str(EXAMPLES / "interaction_wood_berry.json")).stdout
    assert "within the radius searched" in output


def test_decoupling_in_tables() -> None:
    """Settings, indices, peaks and stability are printed."""
    output = _mutune("decouple", str(EXAMPLES / "decoupling_rosenbrock.json")).stdout
    assert "0.29751" in output
    assert "detuned" in output
    assert "The loops together are stable." in output


def test_unbounded_decoupling_is_warned_of() -> None:
    """Dashes in place of settings, and what to do."""
    request = altered(_example("decoupling_rosenbrock.json"), "/max_index", None)
    output = _mutune("decouple", "-", request=request).stdout
    assert "unbounded" in output
    assert "Warning: Loop 2" in output


def test_parallel_drives_in_words() -> None:
    """The cause, the remedy and the shares before and after."""
    output = _mutune("parallel-drives", str(EXAMPLES / "parallel_drives_two_motors.json")).stdout
    words = " ".join(output.split())
    assert "Units 1 and 2 integrate the same error" in words
    assert "Use one integrator with the gain 1" in words
    assert "1.1818" in words


def test_unstable_drives_are_called_unstable() -> None:
    """A lagging load under high gains."""
    request = altered(
        _example("parallel_drives_two_motors.json"), "/load/den", [1.0, 3.0, 3.0, 1.0]
    )
    request = altered(request, "/drives/0/proportional_gain", 100)
    assert "The loop is unstable." in _mutune("parallel-drives", "-", request=request).stdout


@pytest.mark.parametrize(
    ("command", "pointer", "value"),
    [
        ("interaction", "/effect/loop", 2),
        ("decouple", "/max_index", 0),
        ("parallel-drives", "/load/num", [0]),
    ],
)
def test_bad_input_exits_with_2_and_names_the_field(
    command: str, pointer: str, value: object
) -> None:
    """The message names the pointer; there is no traceback."""
    request = altered(_example(COMMANDS[command][0]), pointer, value)
    result = _mutune(command, "-", request=request)
    assert result.exit_code == 2
    assert pointer in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize("error", [OverflowError, np.linalg.LinAlgError])
def test_numbers_beyond_double_precision_are_bad_input(
    error: type[Exception],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the numbers overflow, the request is to blame, as over HTTP: exit status 2."""

    def compute(_: InteractionRequest) -> dict[str, Any]:
        raise error

    path = EXAMPLES / COMMANDS["interaction"][0]
    failing = dataclasses.replace(registry.load("interaction"), compute=compute)
    monkeypatch.setattr(registry, "load", lambda _: failing)
    assert analyse_file("interaction", path, as_json=True) is ExitCode.BAD_INPUT
    assert "too far apart" in capsys.readouterr().err


def test_unstable_loops_in_service_are_no_contradiction() -> None:
    """What the plant permits is told as such, beside settings that are unstable; exit code 3."""
    plant = {
        "kind": "parallel", "n": 2,
        "process": {"num": [1.0], "den": [100.0, 1.0], "dead_time": 1},
        "interaction": {"num": [0.5], "den": [100.0, 1.0], "dead_time": 1},
    }  # fmt: skip
    request = {
        "plant": plant,
        "uncertainty": {"structure": "diagonal", "epsilon": 0.2, "theta": 1.0},
        "performance": {"tau_p": 20.0},
        "loops": [{"gain": 1e4, "integral_time": 10.0}] * 2,
    }
    found = _mutune("robustness", "-", request=request)
    assert found.exit_code == ExitCode.INFEASIBLE
    assert found.stdout.startswith("Unstable")
    words = " ".join(_mutune("integrity", "-", request=request).stdout.split())
    assert "Of the plant alone: some other or smaller settings" in words
    assert "guaranteed" not in words
    request["loops"] = [{"gain": 20.0, "integral_time": 50.0}] * 2
    result = json.loads(_mutune("integrity", "-", "--json", request=request).stdout)
    assert {kind["guarantee"]["status"] for kind in result["classes"]} == {"proven"}
    words = " ".join(_mutune("integrity", "-", request=request).stdout.split())
    assert "Proven: no frequency exceeds these peaks by more than 0.01 %." in words
