"""Pairing, groups by membership, scan time and spans in requests."""

from __future__ import annotations

import json
from typing import Any

import pytest
from samples import ROBUSTNESS, TUNING

from service.analyses.integrity import IntegrityRequest
from service.analyses.robustness import RobustnessRequest, compute
from service.analyses.step_response import StepResponseRequest
from service.schemas import RequestError, TuningRequest, parse
from service.schemas.encoding import encode
from solver.model.errors import InvalidInputError, UnsupportedPlantError


def lag(gain: float, time: float, dead_time: float) -> dict[str, Any]:
    """Return a first-order lag with dead time as a request has it."""
    return {"num": [gain], "den": [time, 1], "dead_time": dead_time}


# Wood and Berry (1973), minutes and per cent.
ROWS = [
    [lag(12.8, 16.7, 1), lag(-18.9, 21, 3)],
    [lag(6.6, 10.9, 7), lag(-19.4, 14.4, 3)],
]
COLUMN = {
    "plant": {"kind": "matrix", "elements": ROWS},
    "uncertainty": {"epsilon": 0.1, "theta": 0.5},
    "performance": {"tau_p": 12},
    "loops": [{"gain": 0.5, "integral_time": 10}, {"gain": -0.08, "integral_time": 12}],
}
SWAPPED = {**COLUMN, "plant": {"kind": "matrix", "elements": [row[::-1] for row in ROWS]}}


def built(model: Any, request: dict[str, Any]) -> Any:
    """Return what a request builds, its JSON read as the service reads it."""
    return parse(model, json.dumps(request)).build()


@pytest.mark.parametrize("model", [RobustnessRequest, IntegrityRequest])
def test_pairing_of_given_loops_undoes_swapped_inputs(model: Any) -> None:
    """Analyses of given loops see the plant as it is paired."""
    errors = {"epsilon": [0.1, 0.02], "theta": 0.5}
    usual = built(model, {**COLUMN, "uncertainty": errors})
    swapped = {**SWAPPED, "uncertainty": {"epsilon": [0.02, 0.1], "theta": 0.5}}
    found = built(model, {**swapped, "pairing": [1, 0]})
    assert found.plant == usual.plant
    assert found.uncertainty == usual.uncertainty


def test_pairing_of_step_responses() -> None:
    """A step response sees the paired plant too."""
    request = {
        "plant": SWAPPED["plant"], "loops": COLUMN["loops"], "duration": 10, "pairing": [1, 0],
        "steps": [{"kind": "setpoint", "unit": 0, "time": 0, "size": 1}],
    }  # fmt: skip
    assert (
        built(StepResponseRequest, request).experiment.plant
        == built(RobustnessRequest, COLUMN).plant
    )


def test_scan_of_given_loops_is_dead_time_and_said() -> None:
    """The scan delays the plant, and a slow one is warned of."""
    request = parse(RobustnessRequest, json.dumps({**ROBUSTNESS, "scan_time": 0.5}))
    assert request.build().plant.element(0, 0).dead_time == 0.75
    found = compute(request)
    assert any("the scan time 0.5 is not small" in warning for warning in found["warnings"])


@pytest.mark.parametrize(
    ("model", "change", "pointer"),
    [
        (RobustnessRequest, {**COLUMN, "pairing": [0]}, "/pairing"),
        (RobustnessRequest, {**COLUMN, "pairing": [0, 0]}, "/pairing/1"),
        (TuningRequest, {**TUNING, "pairing": [0, 1, 2]}, "/pairing"),
        (TuningRequest, {**TUNING, "as_found": [{"gain": 1, "integral_time": 1}]}, "/as_found"),
        (TuningRequest, {**TUNING, "controller": {"groups": [[0], [1]]}}, "/controller/groups"),
        (
            TuningRequest,
            {**TUNING, "controller": {"arrangement": "grouped", "groups": [[0], [2]]}},
            "/controller/groups/1/0",
        ),
        (TuningRequest, {**TUNING, "controller": {"resolution": {}}}, "/controller/resolution"),
        (TuningRequest, {**TUNING, "instruments": [{}, {}, {}]}, "/instruments"),
    ],
)
def test_contradictions_are_refused_by_pointer(
    model: Any, change: dict[str, Any], pointer: str
) -> None:
    """What does not fit the plant is named where it stands."""
    with pytest.raises((InvalidInputError, RequestError)) as caught:
        built(model, change)
    error = caught.value
    assert getattr(error, "field", None) == pointer


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"pairing": "worst"}, "/pairing"),
        ({"pairing": ["a", 1]}, "/pairing/0"),
        ({"pairing": [-1, 0]}, "/pairing/0"),
        ({"pairing": []}, "/pairing"),
        (
            {"plant": {"kind": "state_space", "A": [["q"]], "B": [[1]], "C": [[1]], "D": [[0]]}},
            "/plant/A/0/0",
        ),
    ],
)
def test_faults_of_form_are_one_each_and_point_into_the_request(
    change: dict[str, Any], pointer: str
) -> None:
    """A union's forms leave no trace in the pointer, and one fault is one error."""
    with pytest.raises(RequestError) as caught:
        built(TuningRequest, {**TUNING, **change})
    assert [fault.pointer for fault in caught.value.faults] == [pointer]


def test_unstable_state_space_points_to_its_matrix() -> None:
    """An eigenvalue in the right half plane is a fault of A."""
    plant = {"kind": "state_space", "A": [[1]], "B": [[1]], "C": [[1]], "D": [[0]]}
    with pytest.raises(UnsupportedPlantError) as caught:
        built(TuningRequest, {**TUNING, "plant": plant})
    assert caught.value.field == "/plant/A"


def test_unlike_spans_are_the_default_of_the_permitted_errors() -> None:
    """Spans of 1 and 100 stand for permitted errors of 1 and 100; given errors stay."""
    spans = [{"output_span": 1}, {"output_span": 100}]
    task = built(TuningRequest, {**TUNING, "instruments": spans})
    assert task.performance.output_scale == (1, 100)
    given = {"output_scale": [1.0, 2.0]}
    task = built(TuningRequest, {**TUNING, "instruments": spans, "performance": given})
    assert task.performance.output_scale == (1, 2)


@pytest.mark.parametrize(
    "instruments", [None, [{"output_span": 10}], [{"output_span": 1}, {}], [{"output_span": 2}] * 2]
)
def test_like_or_unknown_spans_change_nothing(instruments: Any) -> None:
    """Without unlike spans of all outputs they are compared as they come."""
    task = built(TuningRequest, {**TUNING, "instruments": instruments})
    assert task.performance.output_scale is None


def test_spans_are_the_units_of_the_greatest_gain() -> None:
    """Where both are told of every loop, and only where they are asked for."""
    both = [{"output_span": 50, "input_span": 10}, {"output_span": 5, "input_span": 10}]
    asked = {**TUNING, "demands": {"max_controller_gain": 30.0}}

    def ratios(**more: Any) -> object:
        return parse(TuningRequest, json.dumps({**asked, **more})).build().demands.gain_ratios

    assert ratios(instruments=both) == (5.0, 0.5)
    assert ratios(instruments=both[:1]) == (5.0, 5.0)
    assert ratios(instruments=[both[0], {"output_span": 5}]) is None
    assert ratios(instruments=both, demands={"max_load_error": 3.0}) is None
    assert ratios(instruments=both, mixing={"outputs": [[1.0, 1.0], [-1.0, 1.0]]}) is None


@pytest.mark.parametrize("model", [RobustnessRequest, TuningRequest])
def test_spans_are_not_those_of_combinations(model: Any) -> None:
    """Where loops control combinations of outputs, the spans of the outputs permit no errors."""
    request = ROBUSTNESS if model is RobustnessRequest else TUNING
    spans = [{"output_span": 100.0}, {"output_span": 1.0}]
    mixed = {**request, "instruments": spans, "mixing": {"outputs": [[1, 1], [-1, 1]]}}
    assert built(model, mixed).performance.output_scale is None


def test_full_uncertainty_knows_no_spans() -> None:
    """Inputs whose errors depend on each other are compared in their own units: no spans there."""
    request = {
        **TUNING, "instruments": [{"output_span": 1}, {"output_span": 100}],
        "uncertainty": {"epsilon": 0.2, "theta": 1, "structure": "full"},
    }  # fmt: skip
    assert built(TuningRequest, request).performance.output_scale is None


def test_old_requests_mean_what_they_meant() -> None:
    """A request without the new fields builds the same task as before them."""
    task = built(TuningRequest, TUNING)
    assert (task.pairing, task.groups, task.scan_time) == (None, None, 0.0)
    assert (task.resolution, task.as_found) == (None, None)
    assert task.arranged(None) is task
    assert encode(task.plant)["n"] == 2
