"""What describes a request without a say in its numbers: title, unit, identifier, labels, tags."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import httpx
import pytest
from samples import altered, tuning
from typer.testing import CliRunner

from service.analyses.robustness import ANALYSIS
from service.cli.commands import app
from service.schemas import RequestError, TuningRequest, canonical, computation, parse

RECORD = {
    "title": "Reactor train A",
    "time_unit": "min",
    "id": "R-7",
    "labels": {"site": "north"},
    "instruments": [{"tag": "TIC-101", "output_unit": "degC", "output_span": 100}],
}


def test_it_has_no_say_in_the_numbers() -> None:
    """Requests that differ in it alone are one computation; they stay different requests."""
    record = {name: value for name, value in RECORD.items() if name != "instruments"}
    plain, full = (
        parse(TuningRequest, json.dumps(request)) for request in (tuning(), tuning() | record)
    )
    assert computation(plain) == computation(full)
    assert canonical(plain) != canonical(full)


@pytest.mark.parametrize(
    ("pointer", "value"),
    [
        ("/title", "x" * 201),
        ("/time_unit", "<b>"),
        ("/time_unit", ""),
        ("/id", 7),
        ("/labels/site", 7),
        ("/labels", {str(number): "x" for number in range(21)}),
        ("/instruments", []),
        ("/instruments/0/output_span", 0),
        ("/instruments/0/colour", "red"),
    ],
)
def test_faults_are_named(pointer: str, value: object) -> None:
    """As those of any other field."""
    request = altered(tuning() | {"instruments": [{}], "labels": {}}, pointer, value)
    with pytest.raises(RequestError) as caught:
        parse(TuningRequest, json.dumps(request))
    assert caught.value.faults[0].pointer == pointer


def test_a_member_that_is_there_twice_is_refused() -> None:
    """Readers do not agree which of the two counts."""
    text = json.dumps(tuning(seed=1)).replace('"seed": 1', '"seed": 1, "seed": 2')
    with pytest.raises(RequestError, match='"seed" is there twice'):
        parse(TuningRequest, text)


def test_identity_comes_back_from_an_analysis(client: httpx.Client) -> None:
    """The answer carries the identifier and the labels of its request."""
    request = ANALYSIS.request.model_config["json_schema_extra"]["examples"][0]
    answer = client.post("/v1/robustness", json=request | RECORD).json()
    assert answer["id"] == "R-7"
    assert answer["labels"] == {"site": "north"}


@pytest.mark.usefixtures("_fake_tuner")
def test_identity_is_a_column_of_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Equal requests of two owners are computed once, and each row says whose it is."""
    monkeypatch.setenv("MUTUNE_WORKERS", "1")
    path = tmp_path / "r.ndjson"
    lines = [tuning(seed=900) | {"id": name, "labels": {"site": name}} for name in ("a", "b")]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    result = CliRunner().invoke(app, ["batch", str(path)], catch_exceptions=False)
    entries = [json.loads(line) for line in result.stdout.splitlines()]
    assert [entry["result"]["id"] for entry in entries] == ["a", "b"]
    assert entries[0]["digest"] == entries[1]["digest"]
    table = CliRunner().invoke(app, ["batch", str(path), "--format", "csv"], catch_exceptions=False)
    rows = list(csv.DictReader(io.StringIO(table.stdout)))
    assert [(row["id"], row["labels.site"]) for row in rows] == [("a", "a"), ("b", "b")]
