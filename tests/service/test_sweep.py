"""``mutune sweep``: a grid of requests from one."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from samples import tuning
from typer.testing import CliRunner

from service.batch.sweep import MAX_POINTS, Variation, expand
from service.cli.commands import app
from service.schemas import RequestError


def requests(*variations: str) -> list[dict]:
    """Return the requests of a sweep of the sample."""
    items = expand(json.dumps(tuning()).encode(), [Variation.of(each) for each in variations])
    return [json.loads(item.request) for item in items]


def test_a_grid_has_every_combination() -> None:
    """Linear, logarithmic and listed values; the last variation changes fastest."""
    found = requests("uncertainty.epsilon=0.1:0.4:4", "controller.arrangement=identical,best")
    assert [each["uncertainty"]["epsilon"] for each in found] == [
        0.1,
        0.1,
        0.2,
        0.2,
        0.3,
        0.3,
        0.4,
        0.4,
    ]
    assert [each["controller"]["arrangement"] for each in found] == ["identical", "best"] * 4
    found = requests("uncertainty.theta=0.01:100:5:log")
    assert [each["uncertainty"]["theta"] for each in found] == [0.01, 0.1, 1.0, 10.0, 100.0]


def test_fields_left_to_their_defaults_can_be_varied() -> None:
    """A member that the request does not hold is filled in beside its neighbours' defaults."""
    found = requests("performance.max_peak=1.5,2,3")
    assert [each["performance"]["max_peak"] for each in found] == [1.5, 2.0, 3.0]
    assert {each["performance"]["offset"] for each in found} == {0.0}


def test_an_unknown_field_is_named_with_the_nearest() -> None:
    """Nothing is swept in silence over a name that means nothing."""
    with pytest.raises(RequestError, match=r"did you mean uncertainty\.epsilon"):
        requests("uncertainty.epsilom=0.1,0.2")


@pytest.mark.parametrize(
    "text", ["plant.n", "=1,2", "plant.n=", "plant.n=1:2", "plant.n=1:2:x", "plant.n=1:2:3:sqrt",
             "plant.n=-1:1:3:log", "plant.n=1:inf:3", "plant.n=1:2:-1"],
)  # fmt: skip
def test_other_forms_are_refused(text: str) -> None:
    """The message says how it is written."""
    with pytest.raises(RequestError, match="--vary"):
        Variation.of(text)


def test_a_sweep_is_bounded() -> None:
    """A grid of a million points is refused before it is made."""
    count = int(MAX_POINTS**0.5) + 1
    with pytest.raises(RequestError, match="at most"):
        requests(f"uncertainty.epsilon=0.1:0.2:{count}", f"uncertainty.theta=0.1:0.2:{count}")


@pytest.mark.usefixtures("_fake_tuner")
def test_the_command_prints_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row a point with the varied field; values that the schema refuses are errors in place."""
    monkeypatch.setenv("MUTUNE_WORKERS", "1")
    path = tmp_path / "request.json"
    path.write_text(json.dumps(tuning(seed=10)))
    command = ["sweep", str(path), "--vary", "uncertainty.epsilon=0.1,-1,0.2"]
    result = CliRunner().invoke(app, command, catch_exceptions=False)
    assert result.exit_code == 2
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [row["status"] for row in rows] == ["optimal", "error", "optimal"]
    assert [row["uncertainty.epsilon"] for row in rows] == ["0.1", "-1", "0.2"]


@pytest.mark.usefixtures("_fake_tuner")
def test_the_command_draws_what_it_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One file that opens without network; a form without a table has none."""
    monkeypatch.setenv("MUTUNE_WORKERS", "1")
    path, figure = tmp_path / "request.json", tmp_path / "figure.html"
    path.write_text(json.dumps(tuning(seed=10) | {"time_unit": "min"}))
    command = ["sweep", str(path), "--vary", "uncertainty.epsilon=0.1,0.2", "--figure", str(figure)]
    refused = CliRunner().invoke(app, [*command, "--format", "ndjson"])
    assert (refused.exit_code, figure.exists()) == (2, False)
    assert "--format csv" in refused.stderr
    result = CliRunner().invoke(app, command, catch_exceptions=False)
    assert result.exit_code == 0
    assert "Trade-off: speed against uncertainty of the inputs" in figure.read_text("utf-8")
    assert "(min)" in figure.read_text("utf-8")
