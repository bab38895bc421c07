"""One command after another: what tune prints is read by the analyses; times have their unit."""

from __future__ import annotations

import io
import json
import sys
from typing import Any

import pytest

from service.analyses.integrity import IntegrityRequest
from service.analyses.interaction import InteractionRequest
from service.analyses.robustness import RobustnessRequest
from service.cli.handing_on import in_unit, requested
from service.printing import Grid, Line
from service.printing import in_unit as named
from service.schemas import RequestError
from service.schemas.tunings import EXAMPLE

LOOPS: list[Any] = [
    {"gain": 47.7, "integral_time": 101.0, "derivative_time": None, "filter_time": None},
    {"gain": 18.9, "integral_time": 2.36, "derivative_time": None, "filter_time": None},
]
PRINTED = {"status": "optimal", "tau_p": 18.4, "loops": LOOPS, "request": EXAMPLE}


@pytest.mark.parametrize("model", [RobustnessRequest, IntegrityRequest])
def test_a_printed_tuning_is_the_request_of_an_analysis(model: Any) -> None:
    """Plant and weights are those of the request, settings and time constant those found."""
    request = requested(model, json.dumps(PRINTED).encode())
    assert [loop.gain for loop in request.loops] == [47.7, 18.9]
    assert request.performance.tau_p == 18.4
    assert request.plant.build().n == 2


def test_a_plant_alone_is_handed_on_too() -> None:
    """An analysis without loops takes the plant."""
    request = requested(InteractionRequest, json.dumps(PRINTED).encode())
    assert request.plant is not None


def test_other_texts_are_read_as_requests() -> None:
    """What is no printed tuning is told as what it is."""
    with pytest.raises(RequestError) as caught:
        requested(IntegrityRequest, b"{}")
    assert {fault.pointer for fault in caught.value.faults} >= {"/plant", "/loops"}


def test_tune_is_piped_into_an_analysis(
    tmp_path: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """mutune tune --json | mutune robustness - analyses the settings found, in their unit."""
    from service.cli.analysing import analyse_file  # noqa: PLC0415 - with the kernels
    from service.cli.tuning import tune_file  # noqa: PLC0415 - likewise

    path = tmp_path / "request.json"
    path.write_text(json.dumps(EXAMPLE))
    assert tune_file(path, as_json=True, time_unit="min") == 0
    text = capsys.readouterr().out
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    assert analyse_file("robustness", path.with_name("-").relative_to(tmp_path), as_json=False) == 0
    said = capsys.readouterr().out
    assert "demand met" in said
    assert "rad/min" in said


def test_a_unit_that_cannot_be_one_is_refused() -> None:
    """The name of a unit keeps the rules of a request."""
    request = requested(RobustnessRequest, json.dumps(PRINTED).encode())
    assert in_unit(request, "h").time_unit == "h"
    assert in_unit(request, None) is request
    with pytest.raises(RequestError):
        in_unit(request, "<script>")


def test_times_are_printed_with_their_unit() -> None:
    """Frequencies, times of the forms and the time constant carry the name; gains do not."""
    parts = [
        Line("Optimal: closed-loop time constant τP = 18.446", "strong"),
        Line("Infeasible: none (at 0.1 rad per time unit)"),
        Grid(("loop", "k", "τI", "Ki", "ω (rad/time)"), [("1", "1", "2", "3", "4")]),
    ]
    first, second, grid = named(parts, "min")
    assert isinstance(first, Line)
    assert first.text.endswith("τP = 18.446 min")
    assert isinstance(second, Line)
    assert "0.1 rad/min" in second.text
    assert isinstance(grid, Grid)
    assert list(grid.heads) == ["loop", "k", "τI, min", "Ki, 1/min", "ω (rad/min)"]
    assert named(parts, None) is parts


def test_durations_of_analyses_are_printed_with_their_unit() -> None:
    """Heads, parameters and ends that are times carry the name; other numbers do not."""
    parts = [
        Line("Simulated up to 40."),
        Line("All plants stay stable up to 2.8 times the uncertainty."),
        Grid(("loop", "rise", "over", "bandwidth"), [("1", "6.8", "0.02", "0.2")]),
        Grid(("element", "parameter", "value"), [("y", "dead time", "2"), ("", "gain", "1")]),
    ]
    told = named(parts, "min")
    assert [part.text for part in told[:2] if isinstance(part, Line)] == [
        "Simulated up to 40 min.",
        "All plants stay stable up to 2.8 times the uncertainty.",
    ]
    measures, estimates = told[2:]
    assert isinstance(measures, Grid)
    assert list(measures.heads) == ["loop", "rise, min", "over", "bandwidth, rad/min"]
    assert isinstance(estimates, Grid)
    assert [row[1] for row in estimates.rows] == ["dead time, min", "gain"]
