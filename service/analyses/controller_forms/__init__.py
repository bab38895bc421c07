"""Convert controllers to other forms, and to what is typed into a control system.

Return the cascade, ideal and parallel forms of controllers given in any of them. With a target: the
values to type, rounded, with units and action, and mu of the typed values where a plant is given.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from service.analyses.controller_forms.printing import table
from service.analyses.controller_forms.request import ControllerFormsRequest, FormsTask, HandOver
from service.analyses.controller_forms.result import ControllerFormsResult
from service.analysis import Analysis
from service.effort import Effort, different_loops
from service.printing import ROUNDED
from service.schemas.encoding import encode
from solver.hand_over.conversion import typed
from solver.hand_over.known import KNOWN
from solver.hand_over.law import FilterEntry, Form, GainEntry, IntegralEntry
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError

__all__ = ["ANALYSIS", "ControllerFormsRequest", "ControllerFormsResult"]


def compute(request: ControllerFormsRequest) -> dict[str, Any]:
    """Return the forms of the request's controllers, and what is typed of them."""
    task = request.build()
    document: dict[str, Any] = {"forms": [_forms(loop) for loop in task.loops], "hand_over": None}
    if task.hand_over is not None and request.target is not None:
        tags = [signals.tag for signals in request.signals(len(task.loops))]
        loops, made = _typed_loops(task.loops, task.hand_over, tags)
        known = next((each for each in KNOWN if each.name == request.target.controller), None)
        document["hand_over"] = {
            "controller": None if known is None else known.title,
            "equation": task.hand_over.equation,
            "time_unit": task.hand_over.unit,
            "filter_rule": None if known is None else known.filter_rule,
            "source": None if known is None else known.source,
            "loops": loops,
            "notes": list(_notes(task, task.hand_over, None if known is None else known.remark)),
            **_judged(task, made),
        }
    return document


def _notes(task: FormsTask, hand_over: HandOver, remark: str | None) -> Iterator[str]:
    if not any(loop.derivative_time for loop in task.loops):
        yield f"No derivative action: {hand_over.law.names.derivative} is 0 in the equation."
    if not hand_over.has_spans:
        yield (
            "The spans of the signals are not given: the gain is that of the model, right where "
            "both its signals are in per cent of span."
        )
    if remark:
        yield remark


def _typed_loops(
    loops: tuple[Controller, ...], hand_over: HandOver, tags: list[str | None]
) -> tuple[list[dict[str, Any]], list[Controller] | None]:
    """Return what is typed, and the controllers that makes; None where one has no such form."""
    entries: list[dict[str, Any]] = []
    made: list[Controller] = []
    for loop, scales, tag in zip(loops, hand_over.scales, tags, strict=True):
        entry: dict[str, Any] = {
            "tag": tag,
            "action": "reverse" if loop.gain > 0 else "direct",
            "values": [],
            "loop": None,
            "notes": [],
            "reason": None,
        }
        try:
            found = typed(loop, hand_over.law, scales=scales, digits=hand_over.digits)
        except InvalidInputError as error:
            entry["reason"] = error.message
        else:
            values = found.gain, found.integral, found.derivative, found.filter
            entry["values"] = [
                {"setting": setting, "name": name, "value": value, "unit": unit}
                for (setting, name, unit), value in zip(_columns(hand_over), values, strict=True)
                if value is not None or setting == "integral"
            ]
            entry["loop"] = encode(asdict(found.controller))
            entry["notes"] = list(found.notes)
            made.append(found.controller)
        entries.append(entry)
    return entries, made if len(made) == len(loops) else None


def _columns(hand_over: HandOver) -> list[tuple[str, str, str]]:
    """Return setting, name and unit of each value that is typed."""
    law, unit = hand_over.law, hand_over.unit
    gain = "%/%" if hand_over.has_spans else ""
    if law.gain is GainEntry.PROPORTIONAL_BAND:
        gain = "%"
    inverse = law.form is Form.PARALLEL or law.integral is IntegralEntry.REPEATS
    lag = unit if law.filter in {FilterEntry.TIME, FilterEntry.MEASUREMENT} else ""
    return [
        ("gain", law.names.gain, gain),
        ("integral", law.names.integral, f"1/{unit}" if inverse else unit),
        ("derivative", law.names.derivative, unit),
        ("filter", law.names.filter, lag),
    ]


def _judged(task: FormsTask, made: list[Controller] | None) -> dict[str, Any]:
    """Return what the typed values achieve on the plant."""
    nothing = {"nominally_stable": None, "peaks": None, "guarantee": None, "demand_met": None}
    plant, uncertainty, performance = task.plant, task.uncertainty, task.performance
    if plant is None or uncertainty is None or performance is None or made is None:
        return nothing
    from solver.robustness.axis import proven_peaks
    from solver.stability.closed_loop import unstable_poles

    if unstable_poles(plant, made):
        return nothing | {"nominally_stable": False, "demand_met": False}
    found = proven_peaks(plant, uncertainty, performance, made)
    peak = found.peaks.robust_performance.value
    return {
        "nominally_stable": True,
        "peaks": encode(asdict(found.peaks)),
        "guarantee": encode(asdict(found.guarantee)),
        "demand_met": bool(peak <= 1 + ROUNDED),
    }


def _forms(loop: Controller) -> dict[str, Any]:
    ideal = parallel = reason = None
    try:
        ideal, parallel = encode(asdict(loop.to_ideal())), encode(asdict(loop.to_parallel()))
    except InvalidInputError as error:
        reason = error.message
    return {"cascade": encode(asdict(loop)), "ideal": ideal, "parallel": parallel, "reason": reason}


def _effort(task: FormsTask) -> Effort | None:
    if task.plant is None or task.uncertainty is None or task.performance is None:
        return None
    return different_loops(task.plant, task.loops, task.uncertainty, task.performance)


ANALYSIS = Analysis(
    name="controller_forms",
    resource="controller-forms",
    text=__doc__,
    outcome="The forms.",
    request=ControllerFormsRequest,
    result=ControllerFormsResult,
    compute=compute,
    computes_with=("solver.robustness.axis", "solver.stability.closed_loop"),
    table=table,
    effort=_effort,
    immediate=lambda request: request.plant is None,
)
