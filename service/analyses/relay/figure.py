"""Figure of a relay experiment."""

from __future__ import annotations

import plotly.graph_objects as go

from service.analyses.relay.drawn import DrawnRelayExperiment
from service.figures.panels import Panels
from service.figures.responses import INPUT, OUTPUT
from service.figures.style import line, time_title
from service.wording import TIME_UNIT, units_text

__all__ = ["relay"]


def relay(result: DrawnRelayExperiment, unit: str = TIME_UNIT) -> go.Figure:
    """Return outputs and inputs of a relay experiment."""
    count = len(result.switchings)
    panels = Panels(
        "Relay experiment",
        f"Outputs above, inputs below; the relay switched {count} time{'s' * (count != 1)}.",
        rows=2,
        height=480,
    )
    for row, signals in ((1, result.outputs), (2, result.inputs)):
        for index, (units, values) in enumerate(zip(result.units, signals, strict=False)):
            name = f"unit{'s' * (len(units) > 1)} {units_text(units)}"
            panels.curve(result.time, values, name, line(index), row=row)
    panels.shared_x(time_title(unit))
    panels.y(1, OUTPUT)
    panels.y(2, INPUT)
    return panels.figure()
