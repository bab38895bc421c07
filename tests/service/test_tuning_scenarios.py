"""Scenarios over HTTP schemas, figures, tables and files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from samples import TUNING, altered

from service.cli.tables import tuning_table
from service.figures.frequency import tuned_mu
from service.printing import Grid, Line
from service.schemas import TuningRequest, parse
from service.schemas.parsing import RequestError
from service.tuned import RequestedTuning
from solver.model.errors import InvalidInputError
from solver.tuning.tuner import tune
from solver.workbench.documents import read, write
from solver.workbench.tuned import Tuned

EXAMPLE = Path(__file__).parents[2] / "examples" / "boilers_any_in_service.json"


def tuned(document: dict[str, Any]) -> RequestedTuning:
    """Tune a request."""
    request = parse(TuningRequest, json.dumps(document))
    return RequestedTuning.of(request, tune(request.build()))


def test_the_example_is_served_in_every_scenario() -> None:
    """Boilers, any two to four, summer and winter: each proven, each with its certificates."""
    found = tuned(json.loads(EXAMPLE.read_text()))
    result = found.result
    assert result.status == "optimal"
    assert [(each.name, each.sets) for each in result.scenarios] == [
        ("as given", 1), ("any two to four", 3), ("winter", 2),
    ]  # fmt: skip
    assert result.active in {each.name for each in result.scenarios}
    for each in result.scenarios:
        assert each.guarantee.status == "proven"
        assert len(each.certificates) == each.sets
        assert each.peaks.robust_performance.value is not None
        assert each.peaks.robust_performance.value <= 1 + 1e-7
    names = [trace.name for trace in tuned_mu(found).data]
    assert "robust performance, winter" in names
    grids = [part for part in tuning_table(result) if isinstance(part, Grid)]
    assert any(row[0] == "winter" for grid in grids for row in grid.rows)


def test_a_file_holds_the_scenarios() -> None:
    """A result written to a file and read back is the same."""
    request = altered(TUNING, "/scenarios", [{"name": "alone", "in_service": {"any": 1}}])
    task = parse(TuningRequest, json.dumps(request)).build()
    found = Tuned(task, tune(task))
    assert read(write(found)) == found


def test_a_spread_tells_its_worst_plant() -> None:
    """Over HTTP schemas, in the table, and in a file."""
    request = altered(TUNING, "/spread", {"interaction": 0.01, "gain": 0.05})
    request["controller"] = {"kind": "PI", "arrangement": "identical"}
    found = tuned(request)
    assert found.result.spread is not None
    assert set(found.result.spread.worst) == {"gain", "interaction"}
    assert found.result.spread.plants > 169
    assert found.result.active == "spread"
    assert found.result.guarantee is not None
    assert found.result.guarantee.status == "proven"
    assert found.result.spread.proof is not None
    assert found.result.spread.proof.level == pytest.approx(1.0001, abs=1e-4)
    assert found.result.spread.proof.open == 0
    lines = [part.text for part in tuning_table(found.result) if isinstance(part, Line)]
    assert any(text.startswith("Spread: worst of") for text in lines)
    assert any("for every plant of it" in text for text in lines)
    task = found.request.build()
    result = Tuned(task, tune(task))
    assert read(write(result)) == result


@pytest.mark.parametrize(
    ("scenario", "pointer"),
    [
        ({"name": "a", "in_service": [0, 2]}, "/scenarios/0/in_service"),
        ({"name": "a", "in_service": {"any": 3}}, "/scenarios/0/in_service"),
        ({"name": "a", "in_service": [1, 1]}, "/scenarios/0/in_service"),
        ({"name": "as given"}, "/scenarios/0/name"),
        ({"name": "a", "uncertainty": {"epsilon": [0.1], "theta": 1}},
         "/scenarios/0/uncertainty/epsilon"),
        ({"name": "a", "plant": {**TUNING["plant"], "n": 3}}, "/scenarios/0/plant"),
    ],
)  # fmt: skip
def test_scenarios_that_contradict_the_request_are_named(
    scenario: dict[str, Any], pointer: str
) -> None:
    """The pointer says which scenario and which of its fields."""
    request = parse(TuningRequest, json.dumps({**TUNING, "scenarios": [scenario]}))
    with pytest.raises(InvalidInputError) as caught:
        request.build()
    assert caught.value.field == pointer


def test_an_unknown_way_of_naming_units_is_refused() -> None:
    """in_service is a list of units or {"any": ...}."""
    with pytest.raises(RequestError):
        parse(TuningRequest, json.dumps({**TUNING, "scenarios": [{"name": "a", "in_service": 1}]}))
