"""Figures of what loops see: the process with the others open and closed; sensitivities."""

from __future__ import annotations

import math

import plotly.graph_objects as go

from service.analyses.loop_responses.drawn import DrawnLoopResponses
from service.figures.panels import Panels
from service.figures.style import frequency_title, line, log_axis, magnitude
from service.schemas.complex import Complex
from service.wording import TIME_UNIT
from solver.model.loop_names import loops_text

__all__ = ["processes", "sensitivities"]

_FLOOR = 1e-4  # of the highest point: far below it a curve has nothing to say


def processes(result: DrawnLoopResponses, unit: str = TIME_UNIT) -> go.Figure:
    """Return gain and phase of what each loop sees, the others open (dotted) and closed."""
    panels = Panels(
        "What each loop sees",
        "Gain and phase from a loop's input to its output: dotted with the other loops open, drawn "
        "out with them closed.",
        rows=2,
        height=480,
    )
    gains: list[float] = []
    for index, loop in enumerate(result.loops):
        name, style = loops_text(loop.units), line(index)
        for text, curve, shown in (
            (f"{name}, others closed", loop.process_closed, style | {"dash": "solid"}),
            (f"{name}, others open", loop.process_open, style | {"dash": "dot"}),
        ):
            sizes = [magnitude(value) for value in curve]
            gains += [size for size in sizes if size]
            panels.curve(result.omega, sizes, text, shown)
            panels.curve(result.omega, _phase(curve), text, shown, row=2)
    top = max(gains, default=1.0)
    panels.shared_x(frequency_title(unit), **log_axis(result.omega))
    shown_gains = [gain for gain in gains if gain > _FLOOR * top]
    panels.y(1, "gain<br>(output/input)", **log_axis(shown_gains, 0.05))
    panels.y(2, "phase<br>(degrees)", dtick=90)
    return panels.figure()


def sensitivities(result: DrawnLoopResponses, unit: str = TIME_UNIT) -> go.Figure:
    """Return |S| of each loop alone, and the largest singular value of S with all closed."""
    panels = Panels(
        "Sensitivity: each loop alone, and all closed",
        "|S| of each loop with the others open, and the largest singular value of S with all "
        "closed: what lies between is the bandwidth that interaction takes.",
    )
    seen: list[float] = []
    for index, loop in enumerate(result.loops):
        if loop.sensitivity is not None:
            name = f"{loops_text(loop.units)} alone"
            panels.curve(result.omega, loop.sensitivity, name, line(index))
            seen += [value for value in loop.sensitivity if value]
    if result.sensitivity is not None:
        panels.curve(result.omega, result.sensitivity, "all closed", line(len(result.loops)))
        seen += [value for value in result.sensitivity if value]
    panels.x(1, frequency_title(unit), **log_axis(result.omega))
    panels.y(1, "|S|, σ<sub>max</sub>(S)<br>(1)", **log_axis(seen, 0.05))  # noqa: RUF001
    return panels.figure()


def _phase(curve: list[Complex]) -> list[float | None]:
    """Return the phase in degrees, without jumps of full turns."""
    found: list[float | None] = []
    last = 0.0
    for value in curve:
        if value.re is None or value.im is None or (value.re == 0 and value.im == 0):
            found.append(None)
            continue
        phase = math.degrees(math.atan2(value.im, value.re))
        phase += 360 * round((last - phase) / 360)
        found.append(phase)
        last = phase
    return found
