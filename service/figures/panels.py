"""Panels one below the other, put together as plain values and validated by Plotly once.

Plotly's own way, a call for each trace and axis, takes ten times as long.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import plotly.graph_objects as go

from service.figures.style import NEUTRAL, THIN, Theme, numbers, template

__all__ = ["Panels"]


class Panels:
    """A figure in the making.

    Parameters
    ----------
    title, description : str
        Heading and text alternative. They go to ``layout.meta``: who shows the figure sets them
        beside it, so that they wrap and can be read aloud.
    rows : int
        Panels, counted from 1 at the top.
    height : int
        Pixels; the width is that of the place where it is shown.
    shared : bool
        Whether all panels have the same horizontal axis, labelled below the last one.

    """

    def __init__(
        self,
        title: str,
        description: str,
        *,
        rows: int = 1,
        height: int = 380,
        shared: bool = True,
    ) -> None:
        self._rows = rows
        self._traces: list[dict[str, Any]] = []
        self._named: set[str] = set()
        self._layout: dict[str, Any] = {
            "meta": {"title": title, "description": description},
            "height": height,
            "shapes": [],
            "annotations": [],
        }
        gap = 0.06 if shared else 0.2
        share = (1 - gap * (rows - 1)) / rows
        for row in range(1, rows + 1):
            top = 1 - (row - 1) * (share + gap)
            # Rounding must not take the lowest panel below zero.
            self.y(row, domain=[max(top - share, 0.0), top], anchor=_name("x", row))
            self.x(row, anchor=_name("y", row))
            if shared and row < rows:
                self.x(row, matches=_name("x", rows), showticklabels=False)

    def x(self, row: int, title: str | None = None, **axis: Any) -> None:  # noqa: ANN401 - Plotly's
        """Set properties of the horizontal axis of `row`."""
        self._axis("xaxis", row, title, axis)

    def y(self, row: int, title: str | None = None, **axis: Any) -> None:  # noqa: ANN401 - Plotly's
        """Set properties of the vertical axis of `row`."""
        self._axis("yaxis", row, title, axis)

    def shared_x(self, title: str, **axis: Any) -> None:  # noqa: ANN401 - Plotly's
        """Set properties of the horizontal axis that all panels share."""
        for row in range(1, self._rows + 1):
            self.x(row, title if row == self._rows else None, **axis)

    def curve(
        self,
        x: Iterable[float | None],
        y: Iterable[float | None],
        name: str,
        line: dict[str, Any],
        *,
        row: int = 1,
        **trace: Any,  # noqa: ANN401 - Plotly's
    ) -> None:
        """Add a curve. Those of one name form one entry of the legend."""
        self.add(
            {
                "type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y), "name": name,
                "legendgroup": name, "showlegend": name not in self._named, "line": line,
            } | trace,
            row=row,
        )  # fmt: skip
        self._named.add(name)

    def add(self, trace: dict[str, Any], *, row: int = 1) -> None:
        """Add a trace of any type."""
        self._traces.append({"xaxis": _name("x", row), "yaxis": _name("y", row)} | trace)

    def level(self, value: float, text: str, *, row: int = 1) -> None:
        """Draw a horizontal line at `value`, its meaning at its right end.

        A logarithmic axis must have been set as such before.
        """
        place = {"xref": f"{_name('x', row)} domain", "yref": _name("y", row)}
        self._layout["shapes"].append(
            {"type": "line", "x0": 0, "x1": 1, "y0": value, "y1": value, "line": THIN} | place
        )
        # Annotations, unlike shapes, stand at the exponent.
        log = self._layout[_name("yaxis", row)].get("type") == "log"
        self._layout["annotations"].append(
            {
                "text": text, "x": 1, "y": math.log10(value) if log else value,
                "showarrow": False, "xanchor": "right", "yanchor": "bottom",
                "font": {"color": NEUTRAL, "size": 12},
            } | place
        )  # fmt: skip

    def lay_out(self, **layout: Any) -> None:  # noqa: ANN401 - Plotly's
        """Set other properties of the layout."""
        self._layout |= layout

    def figure(self) -> go.Figure:
        """Return the figure, with the light template."""
        layout = self._layout | {"template": template(Theme.LIGHT)}
        return go.Figure({"data": self._traces, "layout": layout})

    def _axis(self, kind: str, row: int, title: str | None, axis: dict[str, Any]) -> None:
        named = {} if title is None else {"title": {"text": title}}
        self._layout.setdefault(_name(kind, row), {}).update(named | axis)


def _name(axis: str, row: int) -> str:
    """Return Plotly's name of the axis of a row."""
    return axis if row == 1 else f"{axis}{row}"
