"""Figures of the search: the local optima found, and what the demand costs."""

from __future__ import annotations

import math
from typing import Any

import plotly.graph_objects as go

from service.figures.panels import Panels
from service.figures.style import COLOURS, IDENTICAL, NEUTRAL, line, log_axis, numbers
from service.schemas.trade_off import TradeOff
from service.schemas.tunings import Optimum
from service.tuned import RequestedTuning
from service.wording import TIME_UNIT, number

__all__ = ["landscape", "trade_off"]

_SHOWN = 12  # optima; the worse ones interest nobody
_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "star", "hexagon", "x")


def landscape(tuned: RequestedTuning) -> go.Figure:
    """Return the local optima: value and how often each was found, and where its settings lie."""
    optima = tuned.result.search.local_optima[:_SHOWN]
    found = len(tuned.result.search.local_optima)
    ends = [optimum.count for optimum in tuned.result.search.local_optima if optimum.count]
    ended, others = sum(ends), found - len(ends)
    starts = tuned.result.search.starts
    panels = Panels(
        "Landscape: the local optima of the search",
        f"Of {starts} starts {ended} ended in {len(ends)} "
        + ("local optimum" if len(ends) == 1 else "different local optima")
        + (", the others were given up as worse" if ended < starts else "")
        + (f"; {others} more {'was' if others == 1 else 'were'} found from these" if others else "")
        + (f", the best {_SHOWN} of which are shown" if found > _SHOWN else "")
        + ". Above: their values, and how many starts ended there. Below: the settings of each; "
        "lines join the loops of one optimum.",
        rows=2,
        height=600,
        shared=False,
    )
    colours = [COLOURS[0]] + [NEUTRAL] * (len(optima) - 1)
    counts = [optimum.count for optimum in optima]
    panels.curve(
        range(1, len(optima) + 1), [optimum.value for optimum in optima], "local optima", {},
        mode="markers+text", showlegend=False, cliponaxis=False,
        text=[_starts(count) for count in counts],
        textposition="top center",
        marker={
            "color": colours,
            "opacity": 1,
            "size": [8 + 12 * math.sqrt(count / max([1, *counts])) for count in counts],
        },
        hovertemplate="optimum %{x}: %{y:.5g}, %{text}<extra></extra>",
    )  # fmt: skip
    # The best one last, so that it lies on top.
    for index in reversed(range(len(optima))):
        panels.add(_settings(index, optima[index], colours[index]), row=2)
    loops = [loop for optimum in optima for loop in optimum.loops]
    panels.x(1, "optimum, best first", dtick=1)
    panels.y(1, _tau_p(tuned.unit) if tuned.result.objective == "tau_p" else "peak of μ (1)")
    panels.x(2, "gain |k| (input/output)", **log_axis((loop.gain for loop in loops), 0.1))
    panels.y(
        2, f"integral time τ<sub>I</sub><br>({tuned.unit})",
        **log_axis((loop.integral_time for loop in loops), 0.15),
    )  # fmt: skip
    # Room for the label of the highest one.
    panels.lay_out(hovermode="closest", margin={"t": 36})
    return panels.figure()


def _starts(count: int) -> str:
    """Return how many starts ended in an optimum; none of its own where another led there."""
    return f"{count} start{'s' * (count != 1)}" if count else "from another"


def _settings(index: int, optimum: Optimum, colour: str) -> dict[str, Any]:
    loops, best = optimum.loops, index == 0
    return {
        "type": "scatter", "mode": "lines+markers+text",
        "x": numbers(abs(loop.gain) for loop in loops),
        "y": numbers(loop.integral_time for loop in loops),
        "name": f"optimum {index + 1}", "showlegend": False, "cliponaxis": False,
        "line": {"color": colour, "width": 2 if best else 1},
        "text": [str(index + 1)] * len(loops), "textposition": "top right",
        "textfont": {"color": colour},
        "marker": {
            "symbol": [_SYMBOLS[place % len(_SYMBOLS)] for place in range(len(loops))],
            "size": 12 if best else 8,
        },
        "customdata": [loop.units for loop in loops],
        "hovertemplate": f"optimum {index + 1} ({number(optimum.value)})<br>"
        "k = %{x:.5g}, τ<sub>I</sub> = %{y:.5g}, %{customdata} loop(s)<extra></extra>",
    }  # fmt: skip


# What is said of the fields that are varied most often, by the last part of their names.
_FIELDS = {
    "epsilon": ("uncertainty of the inputs", "relative error ε of the inputs (1)"),
    "max_peak": ("permitted peak", "permitted peak M of the sensitivity (1)"),
    "interaction": ("interaction", "interaction a (1)"),
    "max_load_error": ("error after a load", "greatest integrated error after a unit load"),
    "max_controller_gain": ("gain of the controllers", "greatest gain of a controller"),
    "max_sensitivity_alone": (
        "peak of each loop alone",
        "greatest peak of the sensitivity of a loop alone (1)",
    ),
}


def trade_off(sweep: TradeOff, unit: str = TIME_UNIT) -> go.Figure:
    """Return what is reached over the swept field, identical settings beside."""
    last = sweep.parameter.rsplit(".", 1)[-1]
    title, axis = _FIELDS.get(last, (sweep.parameter, sweep.parameter))
    panels = Panels(
        f"Trade-off: speed against {title}",
        "Closed-loop time constant that can be promised at each point; a gap where no settings "
        "meet the demand.",
    )
    curves = dict.fromkeys(point.by for point in sweep.points)
    for place, by in enumerate(curves):
        points = [point for point in sweep.points if point.by == by]
        swept = [point.value for point in points]
        name = "best settings" if sweep.by is None else f"{sweep.by} = {by}"
        markers: dict[str, Any] = {"mode": "lines+markers"}
        panels.curve(swept, [point.tau_p for point in points], name, line(place), **markers)
        identical = [point.identical for point in points]
        if sweep.by is None and any(value is not None for value in identical):
            markers |= {"marker": {"symbol": "square"}}
            panels.curve(swept, identical, "identical settings", IDENTICAL, **markers)
    panels.x(1, axis)
    panels.y(1, _tau_p(unit), rangemode="tozero")
    return panels.figure()


def _tau_p(unit: str) -> str:
    return f"τ<sub>P</sub> ({unit})"
