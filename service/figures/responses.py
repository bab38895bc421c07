"""Step responses of given loops, and of tuned ones.

Those to set-point steps in the form of Skogestad, Lundstrom and Hovd (1989), figs. 8 to 10.
"""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from service.figures.panels import Panels
from service.figures.style import IDENTICAL, THIN, TODAY, line, time_title
from service.schemas.drawn import DrawnStepResponse, DrawnUnits
from service.simulations import Case
from service.wording import TIME_UNIT
from solver.model.loop_names import loops_text

__all__ = ["INPUT", "OUTPUT", "step_response", "tuned_response"]

OUTPUT, INPUT = "output y<br>(output units)", "input u<br>(input units)"


def step_response(result: DrawnStepResponse, unit: str = TIME_UNIT) -> go.Figure:
    """Return the outputs with their set points, and the inputs."""
    panels = Panels(
        "Step response", "Outputs with their set points above, inputs below.", rows=2, height=480
    )
    numbered: dict[str, int] = {}
    _add_set_points(panels, result, 1)
    _add(panels, result, "output", 1, numbered)
    _add(panels, result, "input", 2, numbered)
    if result.limited is not None:
        _add_limited(panels, result.limited.time, result.limited.responses, 2, numbered)
    panels.shared_x(time_title(unit))
    panels.y(1, OUTPUT)
    panels.y(2, INPUT)
    return panels.figure()


def tuned_response(title: str, description: str, case: Case, unit: str = TIME_UNIT) -> go.Figure:
    """Return the outputs of the model, those with the worst perturbation, and the inputs."""
    nominal, worst, identical = case.nominal, case.worst, case.identical
    last = 2 if worst is None else 3
    panels = Panels(title, description, rows=last, height=160 * last + 100)
    numbered: dict[str, int] = {}
    _add_set_points(panels, nominal, 1)
    _add(panels, nominal, "output", 1, numbered)
    if worst is not None:
        _add_set_points(panels, nominal, 2)
        _add(panels, worst, "output", 2, numbered)
        panels.y(2, "y, worst case<br>(output units)", matches="y")
    _add(panels, nominal, "input", last, numbered)
    beside = (("identical settings", identical, IDENTICAL), ("today", case.today, TODAY))
    for name, other, style in beside:
        if other is None:
            continue
        for response in other.responses:
            panels.curve(other.time, response.output, name, style)
            panels.curve(other.time, response.input, name, style, row=last)
    if case.limited is not None:
        _add_limited(panels, nominal.time, case.limited.responses, last, numbered)
    panels.shared_x(time_title(unit))
    panels.y(1, "y, nominal<br>(output units)")
    panels.y(last, "u, nominal<br>(input units)")
    return panels.figure()


def _add(
    panels: Panels, result: DrawnStepResponse, signal: str, row: int, numbered: dict[str, int]
) -> None:
    """Add a signal of all units; the same units have the same style in all panels."""
    for response in result.responses:
        name = loops_text(response.units)
        style = line(numbered.setdefault(name, len(numbered)))
        panels.curve(result.time, getattr(response, signal), name, style, row=row)


def _add_limited(
    panels: Panels,
    time: Sequence[float | None],
    responses: Sequence[DrawnUnits],
    last: int,
    numbered: dict[str, int],
) -> None:
    """Add thin lines: outputs and inputs with the valve at its limits."""
    for response in responses:
        name = loops_text(response.units)
        style = line(numbered.setdefault(name, len(numbered))) | {"width": 1}
        label = f"{name}, valve at its limits"
        panels.curve(time, response.output, label, style)
        panels.curve(time, response.input, label, style, row=last)


def _add_set_points(panels: Panels, result: DrawnStepResponse, row: int) -> None:
    for response in _different(result.responses):
        panels.curve(
            result.time, response.set_point, "set point", THIN | {"shape": "hv"}, row=row,
            hoverinfo="skip",
        )  # fmt: skip


def _different(responses: list[DrawnUnits]) -> list[DrawnUnits]:
    """Return one response for each different set point that moves."""
    moving = {
        tuple(response.set_point): response for response in responses if any(response.set_point)
    }
    return list(moving.values())
