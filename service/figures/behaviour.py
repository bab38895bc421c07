"""How the loops behave: responses to set point and load, with a band over plants of the set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from service.figures.panels import Panels
from service.figures.style import COLOURS, IDENTICAL, THIN, line, numbers, time_title
from service.sheet.naming import instrument_of, loops_name
from service.sheet.responses import SHOWN, Moves
from service.tuned import RequestedTuning
from service.wording import number
from solver.model.subsystems import interchangeable
from solver.simulation.experiment import StepKind

__all__ = ["behaviour_figures"]

_Samples = NDArray[np.float64]

_TITLES = {
    StepKind.SETPOINT: ("set_point", "After a set-point step"),
    StepKind.LOAD: ("load", "After a load at the input"),
}
_NAMES = {"identical": "identical settings", "as found": "as found"}


def behaviour_figures(tuned: RequestedTuning, moved: Sequence[Moves]) -> dict[str, go.Figure]:
    """Return a figure for each kind of step."""
    return {
        name: _figure(tuned, title, [each for each in moved if each.kind is kind])
        for kind, (name, title) in _TITLES.items()
    }


def _figure(tuned: RequestedTuning, title: str, moved: Sequence[Moves]) -> go.Figure:
    sizes = sorted({each.size for each in moved})
    steps = " or ".join(number(size, 3) for size in sizes)
    limited = any(each.limited for each in moved)
    kinds = len(interchangeable(tuned.plant, tuned.loops))
    panels = Panels(
        title,
        f"Each loop stepped by {steps} on its own, all loops closed: its output above, its input "
        "below. Shaded: the range over plants of the set that were tried."
        + (" Thin: the input within half its span." if limited else "")
        + (f" Shown are {SHOWN} of {kinds} unlike loops." if kinds > SHOWN else ""),
        rows=2,
        height=420,
    )
    for index, each in enumerate(moved):
        name = loops_name(tuned, each.units)
        if each.band is not None:
            for row, (low, high) in ((1, each.band.output), (2, each.band.input)):
                panels.add(_band(each.band.time, low, high, index, name), row=row)
    for index, each in enumerate(moved):
        name = loops_name(tuned, each.units)
        for other, response in each.others.items():
            if response is not None:
                label = _NAMES[other]
                panels.curve(response.time, response.output, label, IDENTICAL)
                panels.curve(response.time, response.input, label, IDENTICAL, row=2)
        panels.curve(each.given.time, each.given.output, name, line(index))
        panels.curve(each.given.time, each.given.input, name, line(index), row=2)
        if each.limited is not None:
            thin = line(index) | {"width": 1}
            label = f"{name}, valve at its limits"
            panels.curve(each.limited.time, each.limited.output, label, thin)
            panels.curve(each.limited.time, each.limited.input, label, thin, row=2)
    panels.shared_x(time_title(tuned.unit))
    panels.y(1, _axis(tuned, moved, "output"))
    panels.y(2, _axis(tuned, moved, "input"))
    if moved and moved[0].kind is StepKind.SETPOINT:
        for size in sizes:
            ends = [0.0, float(moved[0].given.time[-1])]
            panels.curve(ends, [size, size], "set point", THIN, hoverinfo="skip")
    return panels.figure()


def _axis(tuned: RequestedTuning, moved: Sequence[Moves], signal: str) -> str:
    """Return the title of an axis, with the unit where all loops have the same."""
    units = {getattr(instrument_of(tuned, each.units[0]), f"{signal}_unit") for each in moved}
    unit = units.pop() if len(units) == 1 else None
    return f"{signal}<br>({unit or f'{signal} units'})"


def _band(
    time: _Samples, low: _Samples, high: _Samples, index: int, name: str
) -> dict[str, object]:
    """Return an area between two curves, of the colour of the loop's line."""
    there = numbers(time)
    colour = COLOURS[index % len(COLOURS)].lstrip("#")
    red, green, blue = (int(colour[at : at + 2], 16) for at in (0, 2, 4))
    return {
        "type": "scatter", "mode": "lines", "x": [*there, *reversed(there)],
        "y": [*numbers(high), *reversed(numbers(low))], "fill": "toself",
        "fillcolor": f"rgba({red},{green},{blue},0.16)", "line": {"width": 0},
        "name": name, "legendgroup": name, "showlegend": False, "hoverinfo": "skip",
    }  # fmt: skip
