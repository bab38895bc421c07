"""Records against the plant that they tell, and the errors below their weight."""

from __future__ import annotations

import plotly.graph_objects as go

from service.analyses.identify.models import DrawnIdentification, DrawnPrediction
from service.figures.panels import Panels
from service.figures.style import frequency_title, line, log_axis, time_title
from service.wording import TIME_UNIT

__all__ = ["identification"]

_MOST_PANELS = 12  # outputs drawn; a page of more shows nothing


def identification(result: DrawnIdentification, unit: str = TIME_UNIT) -> dict[str, go.Figure]:
    """Return the figures: each record's data, fit and residual, and the errors."""
    figures = {}
    records = list(dict.fromkeys(one.record for one in result.predictions))
    for index, record in enumerate(records):
        outputs = [one for one in result.predictions if one.record == record][:_MOST_PANELS]
        figures[f"record_{index + 1}"] = _record(record, outputs, unit)
    figures["errors"] = _errors(result, unit)
    return figures


def _record(name: str, outputs: list[DrawnPrediction], unit: str) -> go.Figure:
    kept = " kept back from the fit" if outputs[0].kept_back else ""
    fits = ", ".join(f"{one.output} {one.normalised_fit:.0f} %" for one in outputs)
    panels = Panels(
        f"Record {name}{kept}",
        f"Readings and what the plant makes of the inputs; residuals below. Fit: {fits}.",
        rows=2 * len(outputs),
        height=120 + 220 * len(outputs),
    )
    for index, one in enumerate(outputs):
        row = 2 * index + 1
        left = [y - p for y, p in zip(one.measured, one.predicted, strict=True)]
        panels.curve(one.time, one.measured, "reading", line(0), row=row)
        panels.curve(one.time, one.predicted, "plant", line(1), row=row)
        panels.curve(one.time, left, "residual", line(2), row=row + 1)
        panels.y(row, one.output)
        panels.y(row + 1, "residual")
    panels.shared_x(time_title(unit))
    return panels.figure()


def _errors(result: DrawnIdentification, unit: str) -> go.Figure:
    panels = Panels(
        "Relative errors of the plant, and the weight above them",
        "The largest relative input error of every source, and the magnitude of the weight.",
    )
    values: list[float | None] = list(result.weight_magnitude)
    panels.curve(result.omega, result.weight_magnitude, "weight", line(0))
    for index, error in enumerate(result.errors):
        size = [v or None for v in error.size]
        values += size
        panels.curve(result.omega, size, error.source, line(index + 1))
    panels.shared_x(frequency_title(unit), **log_axis(result.omega))
    panels.y(1, "relative error", **log_axis(values))
    return panels.figure()
