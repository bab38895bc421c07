"""What set-point steps ask of valves whose ranges the request gives."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from service import simulations
from service.analyses.step_response import StepResponseRequest, compute
from service.cli.commands import app
from service.figures.responses import step_response, tuned_response
from service.schemas import TuningResult, parse_tuning_request
from service.schemas.drawn import DrawnStepResponse
from service.schemas.fields import Instrument
from service.schemas.parsing import parse
from service.tuned import RequestedTuning
from service.valves import tuning_remarks
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.mixing import Mixing, mixed
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction

PLANT = {"kind": "first_order", "n": 2, "gain": 1.0, "time_constant": 100.0, "interaction": 0.949}
LOOPS = [{"gain": 46.3, "integral_time": 101.0}, {"gain": 22.8, "integral_time": 3.15}]
MODEL = first_order(2, 1.0, 100.0, 0.949)
SETTINGS = (Controller(46.3, 101.0), Controller(22.8, 3.15))


def steps(**extra: Any) -> list[str]:
    body = {"plant": PLANT, "loops": LOOPS, "steps": [{"kind": "setpoint", "unit": 0}],
            "duration": 100.0, **extra}  # fmt: skip
    found: list[str] = compute(parse(StepResponseRequest, json.dumps(body)))["warnings"]
    return found


def remarks(*spans: float | None, plant: Any = MODEL, loops: Any = SETTINGS) -> list[str]:
    return list(tuning_remarks([Instrument(input_span=s) for s in spans], plant, loops))


def test_a_simulated_input_beyond_its_valve_is_told() -> None:
    """More than half of the span, where neither limits nor a wide enough valve are given."""
    narrow = [{"input_span": 80.0, "input_unit": "%"}]
    assert "46.3 %, 57.9 % of the range" in steps(instruments=narrow)[0]
    assert not steps(instruments=[{"input_span": 93.0}])
    assert not steps()
    limited = [{"low": -40.0, "high": 40.0}, {"low": -40.0, "high": 40.0}]
    assert not steps(instruments=narrow, limits=limited)
    with pytest.raises(InvalidInputError) as caught:
        steps(instruments=narrow * 3)
    assert caught.value.field == "/instruments"


def test_responses_within_the_valves_stand_beside_those_beyond() -> None:
    """As with limits of half the span in the request, drawn as thin lines; else nothing."""
    body = {"plant": PLANT, "loops": LOOPS, "steps": [{"kind": "load", "unit": 0, "size": 60.0}],
            "duration": 100.0}  # fmt: skip
    narrow = [{"input_span": 80.0}]
    beside = compute(parse(StepResponseRequest, json.dumps({**body, "instruments": narrow})))
    limits = [{"low": -40.0, "high": 40.0}] * 2
    asked = compute(parse(StepResponseRequest, json.dumps({**body, "limits": limits})))
    assert beside["limited"]["responses"] == asked["responses"]
    assert beside["responses"] != asked["responses"]
    assert "limited" not in asked
    wide = compute(
        parse(StepResponseRequest, json.dumps({**body, "instruments": [{"input_span": 1e4}]}))
    )
    assert "limited" not in wide
    drawn = DrawnStepResponse.model_validate(beside)
    names = {trace.name for trace in step_response(drawn).data}
    assert any("valve at its limits" in str(name) for name in names)


def test_what_a_unit_step_asks_for_follows_from_settings_and_plant() -> None:
    """k at once for PI, k tau_D/tau_F for PID, the plant's inverse in the end; by hand."""
    assert not remarks(93.0, 93.0)
    assert not remarks(None, None)
    (said,) = remarks(91.0, 46.0)
    assert "loop 1 asks at once for 46.3" in said
    # In the end a step of output 2 takes a/(1 - a^2) = 9.55 of input 1.
    both = remarks(15.0, None)
    assert "at once for 46.3" in both[0]
    assert "loop 2 asks in the end for 9.55" in both[1]
    assert "valve of loop 1" in both[1]
    lead = remarks(100.0, plant=first_order(1, 1.0, 10.0, 0.0), loops=[Controller(6.0, 9.0, 2.0)])
    assert "at once for 60" in lead[0]
    # 20 of a plant that answers at once: (1 + 20)^-1 20, and 1 in the end.
    static = MatrixPlant([[TransferFunction((1.0,), (1.0,))]])
    assert not remarks(2.1, plant=static, loops=[Controller(20.0, 3.0)])
    assert "in the end for 1," in remarks(1.9, plant=static, loops=[Controller(20.0, 3.0)])[0]


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_shares_do_not_depend_on_units(unit: float) -> None:
    """The same share of the range, whatever the input is counted in."""
    scaled = first_order(2, 1.0 / unit, 100.0, 0.949)
    loops = [Controller(each.gain * unit, each.integral_time) for each in SETTINGS]
    (said,) = remarks(60.0 * unit, 60.0 * unit, plant=scaled, loops=loops)
    assert "77.2 % of the range" in said


def test_identical_units_are_told_together() -> None:
    """Three hundred alike are one sentence."""
    plant, loops = first_order(300, 1.0, 100.0, 0.5), [Controller(30.0, 9.0)] * 300
    (said,) = remarks(*[50.0] * 300, plant=plant, loops=loops)
    assert "loops 1-300" in said


def test_a_tuning_tells_and_draws_it(tmp_path: Any) -> None:
    """A warning of the command, and thin lines of loops at their limits, of loads too."""
    body = {"plant": PLANT, "uncertainty": {"epsilon": 0.2, "theta": 1.0}, "certificate": "none",
            "controller": {"arrangement": "identical"}, "search": {"starts": 2}}  # fmt: skip
    path = tmp_path / "request.json"
    warned, drawn = [], []
    for span in (1.0, 1e4):
        asked = {**body, "instruments": [{"input_span": span}]}
        path.write_text(json.dumps(asked), "utf-8")
        done = CliRunner().invoke(app, ["tune", str(path), "--json"])
        assert done.exit_code == 0, done.output
        result = json.loads(done.stdout)
        result.pop("request")
        warned.append([text for text in result["warnings"] if "asks at once" in text])
        request = parse_tuning_request(json.dumps(asked))
        tuned = RequestedTuning(request, TuningResult.model_validate(result))
        drawn.append([simulations.together(tuned, np.array([1.0, 0.0])),
                      simulations.loaded(tuned, 0)])  # fmt: skip
    assert "loops 1-2" in warned[0][0]
    assert not warned[1]
    for case in drawn[0]:
        assert case.limited is not None
        most = max(abs(u) for each in case.limited.responses for u in each.input if u is not None)
        assert most == pytest.approx(0.5, abs=1e-6)
        names = [trace.name for trace in tuned_response("t", "d", case).data]
        assert any("valve at its limits" in str(name) for name in names)
    assert all(case.limited is None for case in drawn[1])


def test_loops_that_share_inputs_are_told_what_these_do() -> None:
    """The moves of the inputs themselves, at once and in the end; no unit of a combination."""
    mixing = Mixing(outputs=((1.0, 1.0), (1.0, -1.0)), inputs=((1.0, 1.0), (1.0, -1.0)))
    loops = [Controller(12.0, 33.0), Controller(40.0, 66.0)]
    signals = [Instrument(input_span=s, output_unit="t/h") for s in (20.0, 1000.0)]
    said = list(tuning_remarks(signals, mixed(MODEL, mixing), loops, mixing))
    assert said[0].startswith("A set-point step of 1 on loop 1 asks at once for 12, 60 % of")
    assert said[1].startswith("A set-point step of 1 on loop 2 asks at once for 40, 200 % of")
    assert all("of the range of input 1" in each for each in said)
    matrices = {"outputs": mixing.outputs, "inputs": mixing.inputs}
    spans = [{"input_span": 20.0}, {"input_span": 1e6}]
    assert (
        "Input 1 of the plant moves by up to 46.3" in steps(instruments=spans, mixing=matrices)[0]
    )
