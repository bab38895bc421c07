"""Integrity over HTTP and on the command line, by the real solver."""

import json

import httpx
import pytest
from samples import ROBUSTNESS, altered
from typer.testing import CliRunner

from service.analyses.integrity import IntegrityResult
from service.cli.commands import app

PATH = "/v1/integrity"


def test_published_settings(client: httpx.Client) -> None:
    """Two loops: three sets in service, all stable and robustly stable."""
    response = client.post(PATH, json=ROBUSTNESS)
    assert response.status_code == 200
    result = IntegrityResult.model_validate(response.json())
    assert result.stable
    assert result.groups == [[0], [1]]
    assert [kind.in_service for kind in result.classes] == [[1, 1], [1, 0], [0, 1]]
    both = result.classes[0].robust_performance
    assert both is not None
    assert both.value == pytest.approx(1.0003484, rel=1e-6)
    assert result.detuning is not None
    assert (result.detuning.combinations, result.detuning.unstable) == (24, 0)
    assert result.controllability is not None
    assert result.controllability.verdict == "guaranteed"


def test_counts_are_exact_integers(client: httpx.Client) -> None:
    """A hundred equal loops: the number of sets is beyond 2^53 and still exact."""
    request = {
        **altered(ROBUSTNESS, "/plant/n", 100),
        "loops": [{"gain": 5, "integral_time": 100}] * 100,
    }
    request["plant"]["interaction"] = 0.001
    classes = json.loads(client.post(PATH, json=request).content)["classes"]
    assert sum(kind["subsets"] for kind in classes) == 2**100 - 1


def test_unstable_sets_have_no_peaks(client: httpx.Client) -> None:
    """Where the loops in service are unstable there is no mu: null."""
    result = client.post(PATH, json=altered(ROBUSTNESS, "/loops/0/gain", -46.3)).json()
    assert result["stable"] is False
    unstable = [kind for kind in result["classes"] if not kind["nominally_stable"]]
    assert unstable
    assert all(kind["robust_performance"] is None for kind in unstable)


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/performance", {}, "/performance/tau_p"),
        ("/loops", [ROBUSTNESS["loops"][0]], "/loops"),
        ("/loops/1/gain", 0, "/loops/1/gain"),
        ("/omega", [1.0], "/omega"),
        ("/plant/n", 0, "/plant/n"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    response = client.post(PATH, json=altered(ROBUSTNESS, pointer, value))
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == blamed


def test_too_many_kinds_of_sets_are_refused(client: httpx.Client) -> None:
    """Eleven different loops: a 422 problem that says how many are possible."""
    request = {
        **altered(ROBUSTNESS, "/plant/n", 11),
        "loops": [{"gain": 5 + unit, "integral_time": 100} for unit in range(11)],
    }
    response = client.post(PATH, json=request)
    assert response.status_code == 422
    error = response.json()["errors"][0]
    assert error["pointer"] == "/loops"
    assert "1023" in error["detail"]


def test_command_prints_the_classes_and_the_summary() -> None:
    """``mutune integrity`` shows a line a kind of set."""
    result = CliRunner().invoke(app, ["integrity", "-"], input=json.dumps(ROBUSTNESS))
    assert result.exit_code == 0
    for text in ("Loops out of service: of 3 sets", "0.84242", "24 combinations none unstable"):
        assert text in result.stdout


def test_command_names_a_combination_that_is_unstable() -> None:
    """The factors of one unstable combination are printed."""
    request = altered(ROBUSTNESS, "/plant/dead_time", 10)
    output = CliRunner().invoke(app, ["integrity", "-"], input=json.dumps(request)).stdout
    assert "One is (" in output


def test_command_prints_the_json_result_alone() -> None:
    """With ``--json`` nothing else is on standard output."""
    result = CliRunner().invoke(app, ["integrity", "-", "--json"], input=json.dumps(ROBUSTNESS))
    assert IntegrityResult.model_validate(json.loads(result.stdout)).stable


def test_command_refuses_bad_input() -> None:
    """A missing loop is bad input: exit status 2, and the field is named."""
    request = altered(ROBUSTNESS, "/plant/n", 3)
    result = CliRunner().invoke(app, ["integrity", "-"], input=json.dumps(request))
    assert result.exit_code == 2
    assert "/loops" in result.output
