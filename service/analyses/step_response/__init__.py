"""Simulate responses to steps.

Return how a plant and its loops move after steps, dead time exact.
"""

from __future__ import annotations

from typing import Any

from service.analyses.step_response.request import EXAMPLE, StepResponseRequest, StepResponseTask
from service.analyses.step_response.result import StepResponseResult
from service.analysis import Analysis, Figures
from service.effort import Effort, of_different_loops
from service.printing import Grid, Line, Part, warning_lines
from service.schemas.drawn import DrawnStepResponse
from service.schemas.encoding import encode
from service.valves import limits_of, step_remarks
from service.wording import number
from solver.model.loop_names import units_text

__all__ = ["ANALYSIS", "EXAMPLE", "StepResponseRequest", "StepResponseResult"]

_ENDS = {
    "complete": "Simulated up to {}.",
    "bound": "Ended at {}: an output left its bound, the loops are unstable.",
    "step_limit": "Ended at {}: too many steps; simulate less long, or leave out a tiny dead time.",
}

# Nine columns in 80 characters: four digits, short heads.
_HEADS = ("loop", "rise", "settle", "over", "IAE", "ISE", "max |e|", "var u", "y end")


def compute(request: StepResponseRequest) -> dict[str, Any]:
    """Return the responses that the request asks for."""
    task = request.build()
    found = task.simulate()
    document: dict[str, Any] = encode(found)
    experiment = task.experiment
    n = experiment.plant.n
    limits = experiment.limits or (None,) * n
    limited = [limit is not None for limit in limits]
    signals = request.signals(n)
    document["warnings"] = list(
        step_remarks(signals, limited, found, shared=experiment.distribution is not None)
    )
    if document["warnings"] and experiment.limits is None and experiment.controller is None:
        document["limited"] = encode(task.within(limits_of(signals)).simulate())
    return document


def table(result: StepResponseResult) -> list[Part]:
    """Return how the simulation ended, and the measures of each unit."""
    rows = []
    for response in result.responses:
        metrics = response.metrics
        reached = metrics.set_point
        values = (
            None if reached is None else reached.rise_time,
            None if reached is None else reached.settling_time,
            None if reached is None else reached.overshoot,
            metrics.absolute_error,
            metrics.squared_error,
            metrics.largest_error,
            metrics.input_variation,
            response.output[-1],
        )
        rows.append((units_text(response.units), *(number(value, 4) for value in values)))
    headline = _ENDS[result.end].format(number(result.time[-1]))
    parts: list[Part] = [Line(headline, "strong"), Grid(_HEADS, rows)]
    later = [
        (
            units_text(response.units),
            number(event.start, 4),
            number(event.change, 4),
            number(event.set_point.rise_time, 4),
            number(event.set_point.settling_time, 4),
            number(event.set_point.overshoot, 4),
        )
        for response in result.responses
        for event in response.metrics.events
        if event.set_point is not None and event.set_point != response.metrics.set_point
    ]
    if later:
        heads = ("loops", "later change at", "by", "rise", "settling", "overshoot")
        parts.append(Grid(heads, later))
    return [*parts, *warning_lines(result.warnings)]


def draw(result: DrawnStepResponse, unit: str) -> dict[str, Any]:
    """Return the signals."""
    from service.figures.document import figures_to_json
    from service.figures.responses import step_response

    return figures_to_json({"step_response": step_response(result, unit)})


def _effort(task: StepResponseTask) -> Effort | None:
    if task.demand is None:
        return None
    loops = [loop for loop in task.experiment.loops if loop is not None]
    return of_different_loops(len(set(loops)))


ANALYSIS = Analysis(
    name="step_response",
    resource="step-responses",
    text=__doc__,
    outcome="The responses.",
    request=StepResponseRequest,
    result=StepResponseResult,
    compute=compute,
    computes_with=("solver.simulation.step_response", "solver.simulation.worst_actuators"),
    table=table,
    effort=_effort,
    figures=Figures(of="a step response", drawn=DrawnStepResponse, draw=draw),
)
