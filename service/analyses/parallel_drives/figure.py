"""Figure of units on one load, as they are and mended."""

from __future__ import annotations

import plotly.graph_objects as go

from service.analyses.parallel_drives.drawn import DrawnDriveResponse, DrawnDriveSimulation
from service.figures.panels import Panels
from service.figures.responses import OUTPUT
from service.figures.style import IDENTICAL, THIN, line, time_title
from service.wording import TIME_UNIT

__all__ = ["drives"]


def drives(simulation: DrawnDriveSimulation, unit: str = TIME_UNIT) -> go.Figure:
    """Return the common output of units on one load, and their efforts: as they are, and mended."""
    mended = simulation.mended
    panels = Panels(
        "Units on one load: set point, load step, measurement pulse",
        "Common output with its set point, and the efforts of the units as they are"
        + ("." if mended is None else ", and with one integrator shared out."),
        rows=2 if mended is None else 3,
        height=440 if mended is None else 580,
    )
    first = simulation.original
    panels.curve(first.time, first.set_point, "set point", THIN)
    panels.curve(first.time, first.output, "output", line(0))
    panels.y(1, OUTPUT)
    _add_efforts(panels, first, 2)
    panels.y(2, "as they are<br>(input units)")
    if mended is not None:
        panels.curve(mended.time, mended.output, "output, mended", IDENTICAL)
        _add_efforts(panels, mended, 3)
        panels.y(3, "mended<br>(input units)", matches="y2")
    panels.shared_x(time_title(unit))
    return panels.figure()


def _add_efforts(panels: Panels, response: DrawnDriveResponse, row: int) -> None:
    for index, efforts in enumerate(zip(*response.efforts, strict=True)):
        panels.curve(response.time, efforts, f"unit {index + 1}", line(index + 1), row=row)
