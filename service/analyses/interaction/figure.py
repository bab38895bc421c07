"""Figures of interaction: the relative gain array, at steady state and over frequency.

Bristol (1966); over frequency as McAvoy has it.
"""

from __future__ import annotations

import math
from itertools import product

import plotly.graph_objects as go

from service.analyses.interaction.drawn import DrawnInteraction
from service.figures.panels import Panels
from service.figures.style import frequency_title, line, log_axis, magnitude, numbers
from service.wording import TIME_UNIT, number

__all__ = ["interaction"]

# Orange for negative, blue for positive: apart for every kind of colour vision, and light enough
# for dark figures in the cells.
_SCALE = [[0.0, "#F0A56B"], [0.5, "#F6F6F4"], [1.0, "#86BFE6"]]
_TEXT = "#1F2328"
_SAME = 1e-9  # relative: elements this near at all frequencies are one curve


def interaction(result: DrawnInteraction, unit: str = TIME_UNIT) -> dict[str, go.Figure]:
    """Return the figures of an interaction analysis: those that exist of `rga`, `rga_frequency`."""
    figures = {}
    if result.relative_gains is not None:
        figures["rga"] = _heat_map(result.relative_gains)
    if result.curves.relative_gains is not None or result.parallel is not None:
        figures["rga_frequency"] = _over_frequency(result, unit)
    return figures


def _heat_map(gains: list[list[float | None]]) -> go.Figure:
    size = len(gains)
    names = [str(index + 1) for index in range(size)]
    panels = Panels(
        "Relative gain array",
        "Gain of each pairing with all other loops open, over the same gain with them closed. "
        "Near 1: the pairing is hardly disturbed; negative (orange): never pair these.",
        height=max(240, min(110 * size + 120, 560)),
    )
    reach = max([1.0, *(abs(value) for row in gains for value in row if value is not None)])
    panels.add(
        {
            "type": "heatmap", "x": names, "y": names, "z": [numbers(row) for row in gains],
            "text": [[number(value) for value in row] for row in gains], "texttemplate": "%{text}",
            "textfont": {"color": _TEXT},
            "colorscale": _SCALE, "zmin": -reach, "zmax": reach, "xgap": 2, "ygap": 2,
            "showscale": False,
            "hovertemplate": "output %{y}, input %{x}: %{z:.5g}<extra></extra>",
        }
    )  # fmt: skip
    panels.x(1, "input", type="category", showgrid=False, constrain="domain")
    panels.y(
        1, "output", type="category", showgrid=False, constrain="domain", autorange="reversed",
        scaleanchor="x",
    )  # fmt: skip
    panels.lay_out(hovermode="closest")
    return panels.figure()


def _over_frequency(result: DrawnInteraction, unit: str) -> go.Figure:
    panels = Panels(
        "Relative gains over frequency",
        "Magnitude of the relative gains; equal ones share a curve. Interaction that matters for "
        "control is that near the bandwidth.",
    )
    curves = _distinct(result)
    for index, (name, values) in enumerate(curves):
        panels.curve(result.curves.omega, values, name, line(index))
    panels.x(1, frequency_title(unit), **log_axis(result.curves.omega))
    seen = [1.0, *(value for _, values in curves for value in values)]
    panels.y(1, "|λ(jω)| (1)", **log_axis(seen, 0.05))
    panels.level(1.0, "no interaction")
    return panels.figure()


def _distinct(result: DrawnInteraction) -> list[tuple[str, list[float | None]]]:
    """Return the different magnitudes over frequency, named by the elements that share them."""
    arrays = result.curves.relative_gains
    if arrays is None:
        parallel = result.parallel
        return [] if parallel is None else [
            ("λ, own input", [magnitude(value) for value in parallel.own_relative_gains]),
            ("λ, other inputs", [magnitude(value) for value in parallel.other_relative_gains]),
        ]  # fmt: skip
    found: list[tuple[list[str], list[float | None]]] = []
    size = len(arrays[0]) if arrays else 0
    for row, column in product(range(size), repeat=2):
        values = [magnitude(array[row][column]) for array in arrays]
        name = f"{row + 1}{column + 1}"
        for names, known in found:
            if _equal(known, values):
                names.append(name)
                break
        else:
            found.append(([name], values))
    return [(f"λ<sub>{_list(names)}</sub>", values) for names, values in found]


def _list(names: list[str]) -> str:
    shown = 3
    return ", ".join(names[:shown]) + (", …" if len(names) > shown else "")


def _equal(first: list[float | None], second: list[float | None]) -> bool:
    return all(
        a is b if a is None or b is None else math.isclose(a, b, rel_tol=_SAME, abs_tol=_SAME)
        for a, b in zip(first, second, strict=True)
    )
