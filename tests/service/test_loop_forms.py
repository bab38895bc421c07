"""Settings in requests in the form that a controller has: cascade, ideal or parallel."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from service.analyses.controller_forms import ControllerFormsRequest, compute
from service.analyses.robustness import RobustnessRequest
from service.analyses.step_response.request import StepResponseRequest
from service.cli.commands import app
from service.schemas.parsing import RequestError, parse, parse_tuning_request
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError

CASCADE = {"gain": 2.0, "integral_time": 20.0, "derivative_time": 3.0, "filter_time": 0.7}
PLANT = {"kind": "first_order", "n": 2, "gain": 1.0, "time_constant": 100.0, "interaction": 0.5}
WEIGHTS = {"uncertainty": {"epsilon": 0.2, "theta": 1.0}, "performance": {"tau_p": 30.0}}
OMEGA = np.geomspace(1e-4, 1e4, 50)


def forms(loop: dict[str, Any]) -> dict[str, Any]:
    request = parse(ControllerFormsRequest, json.dumps({"loops": [loop]}))
    found: dict[str, Any] = compute(request)["forms"][0]
    return found


@given(
    gain=st.floats(0.01, 1e4),
    sign=st.sampled_from([1.0, -1.0]),
    integral_time=st.none() | st.floats(1e-3, 1e5),
    ratio=st.none() | st.floats(1e-3, 0.9),
)
def test_every_form_converts_into_every_other(
    gain: float, sign: float, integral_time: float | None, ratio: float | None
) -> None:
    """Each form, given back, is the same controller at all frequencies."""
    lead = None if ratio is None else ratio * (integral_time or 1.0)
    cascade = {"gain": sign * gain, "integral_time": integral_time, "derivative_time": lead}
    found = forms(cascade)
    exact = Controller(sign * gain, integral_time, lead).response(OMEGA)
    for name in ("ideal", "parallel"):
        again = forms({"form": name, **found[name]})
        loop = again["cascade"]
        response = Controller(**loop).response(OMEGA)
        assert np.abs(response / exact - 1).max() < 1e-6


@pytest.mark.parametrize("name", ["ideal", "parallel"])
def test_all_requests_take_all_forms(name: str) -> None:
    """Robustness, simulation, today's settings and starts read the same controller."""
    other = {"form": name, **forms(CASCADE)[name]}
    exact = Controller(**CASCADE).response(OMEGA)
    body = {"plant": PLANT, **WEIGHTS, "loops": [other, CASCADE]}
    loops = parse(RobustnessRequest, json.dumps(body)).build().loops
    simulated = {"plant": PLANT, "loops": [other, {**CASCADE, "setpoint_weight": 0.5}],
                 "steps": [{"kind": "load", "unit": 0}], "duration": 10.0}  # fmt: skip
    experiment = parse(StepResponseRequest, json.dumps(simulated)).build().experiment
    assert experiment.loops[1].setpoint_weight == 0.5
    tuning = {"plant": PLANT, "uncertainty": WEIGHTS["uncertainty"], "as_found": [other, CASCADE],
              "controller": {"kind": "PIDF"}, "search": {"start": [CASCADE, other]}}  # fmt: skip
    task = parse_tuning_request(json.dumps(tuning)).build()
    assert task.as_found is not None
    assert task.start is not None
    given = [*loops, *task.as_found, *task.start]
    given += [loop.controller for loop in experiment.loops if loop is not None]
    for controller in given:
        assert np.abs(controller.response(OMEGA) / exact - 1).max() < 1e-9


@pytest.mark.parametrize(
    ("loop", "pointer", "words"),
    [
        ({"form": "series", "gain": 1.0}, "/form", "cascade, ideal or parallel"),
        ({"form": "ideal", "gain": 1.0, "integral_tim": 2.0}, "/integral_tim", "integral_time"),
        ({"form": "parallel", "proportional_gain": 1.0, "integral_gain": 1.0, "gain": 2.0},
         "/gain", "no such field"),
        ({"form": "ideal", "proportional_gain": 1.0, "integral_time": None}, "/gain", "required"),
    ],
)  # fmt: skip
def test_faults_of_a_form_are_named(loop: dict[str, Any], pointer: str, words: str) -> None:
    """An unknown form, and a field of another one, by their place in the request."""
    with pytest.raises(RequestError) as caught:
        forms(loop)
    faults = {fault.pointer: fault.detail for fault in caught.value.faults}
    assert words in faults[f"/loops/0{pointer}"]


@pytest.mark.parametrize(
    ("loop", "field"),
    [
        ({"form": "ideal", "gain": 1.0, "integral_time": 2.0, "derivative_time": 1.0},
         "derivative_time"),
        ({"form": "parallel", "proportional_gain": 1.0, "integral_gain": 1.0,
          "derivative_gain": 5.0, "filter_time": 0.1}, "derivative_gain"),
        ({"form": "parallel", "proportional_gain": 0.0, "integral_gain": 1.0},
         "proportional_gain"),
        ({"form": "parallel", "proportional_gain": 1.0, "integral_gain": -1.0},
         "proportional_gain"),
        ({"form": "parallel", "proportional_gain": 1e12, "integral_gain": 1e-12}, "integral_gain"),
    ],
)  # fmt: skip
def test_settings_without_a_cascade_form_are_refused(loop: dict[str, Any], field: str) -> None:
    """Complex zeros, no proportional part, and gains that fight, by the field that was given."""
    with pytest.raises(InvalidInputError) as caught:
        forms(loop)
    assert caught.value.field == f"/loops/0/{field}"


def test_the_command_takes_them(tmp_path: Any) -> None:
    """The same peak of mu on the command line, whatever the form."""
    peaks = []
    for loop in (CASCADE, {"form": "parallel", **forms(CASCADE)["parallel"]}):
        path = tmp_path / "request.json"
        body = {"plant": PLANT, **WEIGHTS, "loops": [loop] * 2, "certificate": "none"}
        path.write_text(json.dumps(body), "utf-8")
        done = CliRunner().invoke(app, ["robustness", str(path), "--json"])
        assert done.exit_code == 0, done.output
        peaks.append(json.loads(done.stdout)["peaks"]["robust_performance"]["value"])
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-9)
