"""Figure of decoupled loops: what each set point does to its own output and to the others.

The form of Astrom and Hagglund, Advanced PID Control (2006), section 11.3.
"""

from __future__ import annotations

from itertools import product

import plotly.graph_objects as go

from service.analyses.decouple.drawn import DrawnClosedLoop
from service.figures.panels import Panels
from service.figures.style import frequency_title, line, log_axis, magnitude
from service.schemas.complex import Complex
from service.wording import TIME_UNIT

__all__ = ["decoupled"]

_FLOOR = 1e-3  # of the highest peak in a panel
_SHOWN = 6  # elements in a panel, those with the highest peaks


def decoupled(loops: DrawnClosedLoop, unit: str = TIME_UNIT) -> go.Figure:
    """Return |H-bar| and its approximation |H|: own outputs above, interaction below."""
    size = len(loops.exact[0]) if loops.exact else 0
    own = [(index, index) for index in range(size)]
    others = [(row, column) for row, column in product(range(size), repeat=2) if row != column]
    panels = Panels(
        "Decoupled loops: from set points to outputs",
        "Above: each output to its own set point. Below: to the set point of another loop, the "
        "interaction that the decoupler leaves. Thin and dotted: without products of interactions"
        + (f". Only the {_SHOWN} highest are shown." if len(others) > _SHOWN else "."),
        rows=2,
        height=520,
    )
    for row, places in ((1, own), (2, others)):
        seen: list[float] = []
        for index, place in enumerate(_highest(loops, places)):
            style = line(index + (row - 1) * len(own))
            name = f"h<sub>{place[0] + 1}{place[1] + 1}</sub>"
            exact, approximate = _sizes(loops.exact, place), _sizes(loops.approximate, place)
            panels.curve(loops.omega, exact, name, style, row=row)
            panels.curve(
                loops.omega, approximate, f"{name}, approximate",
                style | {"dash": "dot", "width": 1}, row=row, showlegend=False,
            )  # fmt: skip
            seen += [value for value in (*exact, *approximate) if value]
        top = max(seen, default=1.0)
        # Far below its peak a curve has nothing to say.
        panels.y(row, **log_axis([value for value in seen if value > _FLOOR * top], 0.05))
    panels.shared_x(frequency_title(unit), **log_axis(loops.omega))
    panels.y(1, "own output<br>(output/set point)")
    panels.y(2, "other outputs<br>(output/set point)")
    return panels.figure()


def _highest(loops: DrawnClosedLoop, places: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the places with the highest peaks, in their order."""

    def peak(place: tuple[int, int]) -> float:
        return max((value or 0.0 for value in _sizes(loops.exact, place)), default=0.0)

    chosen = sorted(places, key=peak, reverse=True)[:_SHOWN]
    return [place for place in places if place in chosen]


def _sizes(arrays: list[list[list[Complex]]], place: tuple[int, int]) -> list[float | None]:
    row, column = place
    return [magnitude(array[row][column]) for array in arrays]
