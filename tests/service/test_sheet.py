"""The loop sheet: how loops behave and what can go wrong, said from numbers that hold."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service import drawing
from service.schemas import parse_tuning_request
from service.schemas.sheet import SheetResult
from service.sheet.document import FOUND, loop_sheet
from service.sheet.responses import moves
from service.tuned import RequestedTuning
from service.wording import in_symbols
from solver.model.controllers import Controller
from solver.simulation.experiment import StepKind
from solver.tuning.tuner import tune

EXAMPLES = Path(__file__).parents[2] / "examples"


@cache
def tuned(name: str, changes: str = "{}") -> RequestedTuning:
    """Return the tuning of an example, some fields of it changed."""
    document = {**json.loads((EXAMPLES / f"{name}.json").read_text()), **json.loads(changes)}
    request = parse_tuning_request(json.dumps(document).encode())
    return RequestedTuning.of(request, tune(request.build()), "min")


def changed(**fields: Any) -> str:
    """Return fields as the text that `tuned` takes."""
    return json.dumps(fields)


def said(record: RequestedTuning, topic: str) -> list[str]:
    """Return the sentences about a topic."""
    return [risk.text for risk in loop_sheet(record).risks if risk.topic == topic]


def test_measures_are_those_of_the_curves() -> None:
    """Settling, overshoot and peaks of the table can be read from the responses themselves."""
    record = tuned("parallel_reactors")
    rows = [row for row in loop_sheet(record).behaviour if row.settings == FOUND]
    found = list(moves(record, {}))
    assert [row.loop for row in rows] == ["loop 1", "loop 2"]
    for row, step in zip(rows, found[:2], strict=True):
        assert step.kind is StepKind.SETPOINT
        output, time = step.given.output, step.given.time
        assert row.input_peak == pytest.approx(np.abs(step.given.input).max())
        assert row.overshoot == pytest.approx(max(output.max() - 1, 0))
        after = time >= row.settling_time
        assert np.all(np.abs(output[after] - 1) <= 0.02)
        assert np.abs(output[time < row.settling_time][-1] - 1) > 0.02
    # A load is gone where its effect on the output is, and integral action leaves none.
    assert abs(found[2].given.output[-1]) < 0.05 * rows[0].load_error
    assert found[2].given.input[-1] == pytest.approx(-1, abs=0.05)


@pytest.mark.parametrize(
    "more",
    [
        {"spread": {"gain": 0.3}},
        {"uncertainty": {"epsilon": 0.1, "theta": 0.1, "outputs": {"epsilon": 0.2, "theta": 0.1}}},
    ],
)
def test_the_band_holds_plants_of_a_spread_and_sensors_that_are_off(more: dict[str, Any]) -> None:
    """It is wider than that of the inputs' errors alone, of the same settings."""
    one = {
        "plant": {"kind": "first_order", "n": 1, "gain": 1.0, "time_constant": 10.0,
                  "dead_time": 1.0, "interaction": 0.0},
        "uncertainty": {"epsilon": 0.1, "theta": 0.1},
        "search": {"starts": 2},
    }  # fmt: skip
    request = parse_tuning_request(json.dumps({**one, **more}).encode())
    record = RequestedTuning.of(request, tune(request.build()), "min")
    plain = RequestedTuning(parse_tuning_request(json.dumps(one).encode()), record.result, "min")
    wide, narrow = (next(moves(each, {})).band for each in (record, plain))
    assert wide is not None
    assert narrow is not None
    time = narrow.time[: wide.time.size]
    for index, sign in ((0, -1), (1, 1)):
        outer = np.interp(time, wide.time, wide.output[index])
        assert (sign * (outer - narrow.output[index][: time.size])).max() > 0.01


def test_the_band_holds_every_plant_that_was_tried() -> None:
    """The nominal response of identical loops lies between those with the inputs off both ways."""
    step = next(moves(tuned("boilers"), {}))
    assert step.units == (0, 1, 2, 3)
    assert step.band is not None
    low, high = step.band.output
    assert np.all(low <= high)
    given = np.interp(step.band.time, step.given.time, step.given.output)
    inside = (given >= low - 1e-3) & (given <= high + 1e-3)
    assert inside.mean() > 0.9
    assert step.band.time[-1] == pytest.approx(step.given.time[-1], rel=0.02)


def test_steps_are_a_tenth_of_the_spans_and_valves_have_limits() -> None:
    """With spans a step that asks for more than half the valve is shown at the limits too."""
    signals = [{"tag": tag, "output_span": 250, "input_span": 100} for tag in ("TIC-1", "TIC-2")]
    record = tuned("parallel_reactors", changed(instruments=signals))
    step = next(moves(record, {}))
    assert step.size == 25
    assert step.limited is not None
    assert step.limited.measured.input_peak <= 50 + 1e-9
    texts = said(record, "saturation")
    assert texts[0].startswith("A set-point step of 25 on TIC-")
    assert "% of the range of its valve" in texts[0]
    # From mid range a step of that size uses half the range, and no more.
    share = step.given.measured.input_peak / 100
    assert f"up to {25 * 0.5 / share:.3g}" in " ".join(texts)


def test_a_loop_in_manual_that_others_need_is_said_first() -> None:
    """Loops that are unstable without one of them are the first thing on the sheet."""
    plant = {
        "kind": "matrix",
        "elements": [
            [{"num": [1], "den": [10, 1]}, {"num": [3], "den": [10, 1]}],
            [{"num": [2], "den": [10, 1]}, {"num": [1], "den": [10, 1]}],
        ],
    }
    changes = changed(plant=plant, controller={"kind": "PI", "arrangement": "independent",
                                               "signs": "any"})  # fmt: skip
    record = tuned("parallel_reactors", changes)
    assert record.loops, record.result.reason
    risk = loop_sheet(record).risks[0]
    assert (risk.level, risk.topic) == ("bad", "manual")
    assert "unstable" in risk.text


def test_manual_says_what_the_rest_does() -> None:
    """Of two unlike loops, one alone keeps the demand and the other does not."""
    texts = said(tuned("parallel_reactors"), "manual")
    assert len(texts) == 2
    assert any("slower than the demand" in text and "overshoots" in text for text in texts)
    assert any("keeps the demand" in text for text in texts)


def test_loops_with_errors_of_their_own_are_told_one_by_one() -> None:
    """Six unlike loops, each with its own error, are shown, and each is looked at in manual."""
    six = tuned(
        "parallel_reactors",
        changed(
            plant={"kind": "first_order", "n": 6, "gain": 1, "time_constant": 20,
                   "interaction": 0.01},
            uncertainty={"epsilon": [0.1, 0.15, 0.2, 0.25, 0.3, 0.35], "theta": 1},
            search={"starts": 1},
        ),
    )  # fmt: skip
    sheet = loop_sheet(six)
    names = [f"loop {unit}" for unit in range(1, 7)]
    assert [row.loop for row in sheet.behaviour if row.settings == FOUND] == names
    assert len([text for text in said(six, "manual") if text.startswith("With loop")]) == 6
    lines = {
        trace.name: (trace.line.color, trace.line.dash)
        for trace in sheet.figures["set_point"].data
        if trace.name in names and not trace.fill
    }
    assert len(set(lines.values())) == 6


def test_an_unmet_demand_stands_first() -> None:
    """The least mu above 1 is the first thing that is said, with its value."""
    record = tuned("distillation_column")
    first = loop_sheet(record).risks[0]
    peak = record.result.peaks.robust_performance.value
    assert first.topic == "demand"
    assert f"{peak:.5g}" in first.text


def test_loops_are_called_by_their_tags_everywhere() -> None:
    """Tags stand in rows and sentences, those of many loops in a row from the first to the last."""
    signals = [{"tag": f"TIC-{number}"} for number in range(101, 105)]
    found = loop_sheet(tuned("boilers", changed(instruments=signals)))
    assert {row.loop for row in found.behaviour} == {"TIC-101 to TIC-104"}
    assert any("one of TIC-101 to TIC-104 in manual" in risk.text for risk in found.risks)
    assert not [risk.text for risk in found.risks if re.search(r"\bloops? \d", risk.text)]


def test_sentences_of_the_solver_have_symbols_and_units() -> None:
    """Of tau_P and frequencies the unit is said; a full stop is no digit."""
    told = "from tau_P = 1.634 on, mu = 1.5 near omega = 2 rad per time unit, not at tau_P = 4."
    said = "from τP = 1.634 h on, μ = 1.5 near ω = 2 rad/h, not at τP = 4 h."
    assert in_symbols(told, "h") == said


def test_identical_settings_that_would_do_are_named() -> None:
    """A gain of less than two per cent is told as a reason for identical settings."""
    record = tuned("boilers", changed(controller={"kind": "PI", "arrangement": "independent"}))
    percent = record.result.comparison.gain_percent
    texts = said(record, "identical")
    assert percent < 2
    assert len(record.settings) > 1
    assert texts[0].startswith("Identical settings would do")
    assert ("no more" in texts[0]) == (percent < 1e-4)


@pytest.mark.parametrize("name", ["parallel_reactors", "boilers"])
def test_digits_that_are_said_to_be_enough_are(name: str) -> None:
    """mu of the settings so rounded is what the sheet says."""
    record = tuned(name)
    text = said(record, "settings")[0]
    digits = 2 + ("Two", "Three", "Four", "Five").index(text.split()[0])
    from solver.robustness.axis import proven_peaks  # noqa: PLC0415 - brings the kernels

    loops = tuple(
        Controller(*(float(f"{value:.{digits}g}") for value in (loop.gain, loop.integral_time)))
        for loop in record.loops
    )
    found = proven_peaks(record.plant, record.uncertainty, record.performance, loops).peaks
    assert f"{found.robust_performance.value:.4g}" in text


def test_the_sheet_does_not_depend_on_units_of_time() -> None:
    """In seconds the same plant settles in sixty times the number, and all else is equal."""
    base = json.loads((EXAMPLES / "parallel_reactors.json").read_text())
    plant = {**base["plant"], "time_constant": 60 * base["plant"]["time_constant"]}
    weight = {**base["uncertainty"], "theta": 60 * base["uncertainty"]["theta"]}
    minutes = loop_sheet(tuned("parallel_reactors")).behaviour
    seconds = loop_sheet(tuned("parallel_reactors", changed(plant=plant, uncertainty=weight)))
    for one, other in zip(minutes, seconds.behaviour, strict=True):
        assert other.settling_time == pytest.approx(60 * one.settling_time, rel=2e-2)
        assert other.overshoot == pytest.approx(one.overshoot, abs=2e-3)
        assert other.phase_margin == pytest.approx(one.phase_margin, rel=1e-3)


def test_the_document_is_as_described() -> None:
    """What the service returns is what its schema says, without settings too."""
    record = tuned("parallel_reactors")
    document = drawing.sheet(record.request.model_dump_json(), record.result.model_dump_json(), "h")
    found = SheetResult.model_validate(document)
    assert list(found.figures.figures) == ["set_point", "load"]
    singular = {"kind": "first_order", "n": 2, "gain": 1, "time_constant": 1, "interaction": 1}
    none = loop_sheet(tuned("parallel_reactors", changed(plant=singular)))
    assert (none.behaviour, none.risks, none.figures) == ((), (), {})


def test_todays_settings_stand_beside_those_found() -> None:
    """Settings as found have their row, their curve and, where they do not work, a warning."""
    today = [{"gain": 20, "integral_time": 100, "derivative_time": None}] * 2
    made = loop_sheet(tuned("parallel_reactors", changed(as_found=today)))
    rows = [row for row in made.behaviour if row.settings == "as found"]
    assert [row.loop for row in rows] == ["all loops"]
    assert rows[0].input_peak == pytest.approx(20)
    assert "as found" in {trace.name for trace in made.figures["load"].data}
    wild = [{"gain": -20, "integral_time": 100, "derivative_time": None}] * 2
    made = loop_sheet(tuned("parallel_reactors", changed(as_found=wild)))
    rows = [row for row in made.behaviour if row.settings == "as found"]
    assert not any(row.stable for row in rows)
    assert any("is it right?" in risk.text for risk in made.risks)


def test_a_short_dead_time_is_simulated_within_reason() -> None:
    """Where steps as short as a dead time were too many the figures say so; the rest is there."""
    plant = {
        "kind": "first_order", "n": 2, "gain": 1, "time_constant": 100, "interaction": 0.5,
        "dead_time": 1e-4,
    }  # fmt: skip
    made = loop_sheet(tuned("parallel_reactors", changed(plant=plant)))
    assert set(made.omitted) == {"set_point", "load"}
    assert "dead time" in made.omitted["load"]
    assert not made.figures
    assert any(risk.topic == "manual" for risk in made.risks)
