"""A figure of the gallery as a Plotly figure, and as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from service.figures.panels import Panels
from service.figures.style import (
    IDENTICAL,
    THIN,
    Theme,
    frequency_title,
    line,
    log_axis,
    template,
    time_title,
)
from service.gallery.definitions import Curve, Figure, Panel, Source
from service.gallery.runs import Runs

__all__ = ["IMAGES", "draw", "to_html", "with_title", "write_image"]

IMAGES = (".png", ".svg", ".pdf", ".webp")
_PANEL, _FRAME = 220, 110  # pixels
_FLOOR = 1e-3  # of the highest point: on a logarithmic axis a curve has nothing to say below


def draw(source: Source, figure: Figure, runs: Runs | None = None) -> go.Figure:
    """Return a figure: its runs are computed, and laid over each other.

    Parameters
    ----------
    source, figure : Source, Figure
        As `find_figure` returns them.
    runs : Runs or None
        Results that are known; None: all are computed.

    """
    runs = runs or Runs(source)
    count = len(figure.panels)
    panels = Panels(
        f"{figure.name}: {figure.title}", figure.stated, rows=count, height=_PANEL * count + _FRAME
    )
    seen: list[float] = []
    for row, panel in enumerate(figure.panels, start=1):
        for curve in panel.curves:
            x = runs.value(curve.run, curve.x)
            seen += x
            panels.curve(x, runs.value(curve.run, curve.y), curve.name, _style(curve), row=row)
        panels.y(row, panel.y, **_axis(panel, runs))
        for level in panel.levels:
            value = level.value
            if level.run is not None and level.at is not None:
                value = runs.value(level.run, level.at)
            assert value is not None  # noqa: S101 - the definitions are ours, and tested
            panels.level(value, level.text, row=row)
    panels.shared_x(**_shared(source, figure, seen))
    return panels.figure()


def _style(curve: Curve) -> dict[str, Any]:
    if curve.style == "thin":
        return THIN
    return IDENTICAL if curve.style == "dotted" else line(int(curve.style))


def _axis(panel: Panel, runs: Runs) -> dict[str, Any]:
    if panel.log:
        values = [
            value for curve in panel.curves for value in runs.value(curve.run, curve.y) if value
        ]
        top = max(values)
        return log_axis([value for value in values if value > _FLOOR * top], 0.05)
    return {} if panel.range is None else {"range": list(panel.range)}


def _shared(source: Source, figure: Figure, seen: list[float]) -> dict[str, Any]:
    if figure.axis == "frequency":
        return {"title": frequency_title(source.time_unit), **log_axis(figure.range or seen)}
    title = time_title(source.time_unit) if figure.axis == "time" else "real part (1)"
    return {"title": title, "range": list(figure.range or (min(seen), max(seen)))}


def with_title(drawn: go.Figure) -> go.Figure:
    """Return a figure that stands alone: its title above it, on white."""
    return go.Figure(drawn).update_layout(
        template=template(Theme.LIGHT),
        title={"text": drawn.layout.meta["title"], "y": 0.985, "yanchor": "top", "x": 0.02,
               "font": {"size": 15}},
        margin={"t": 70},
        paper_bgcolor="white",
        height=drawn.layout.height + 40,
        width=800,
    )  # fmt: skip


def to_html(drawn: go.Figure) -> str:
    """Return one HTML file that opens without network."""
    text: str = with_title(drawn).to_html(include_plotlyjs=True)
    return text


def write_image(drawn: go.Figure, path: Path) -> None:
    """Write a picture, by the kind that the file's name ends with.

    Raises
    ------
    ImportError
        Kaleido is not installed.

    """
    with_title(drawn).write_image(path, scale=1 if path.suffix in {".svg", ".pdf"} else 2)
