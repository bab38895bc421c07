"""Figures of a relay experiment: its signals, the Nyquist curve with the describing function."""

from __future__ import annotations

import plotly.graph_objects as go

from service.analyses.relay.drawn import DrawnRelayExperiment, DrawnRelayTheory
from service.figures.panels import Panels
from service.figures.responses import INPUT, OUTPUT
from service.figures.style import IDENTICAL, TODAY, line, time_title
from service.wording import TIME_UNIT
from solver.model.loop_names import units_text

__all__ = ["nyquist", "relay"]

_BESIDE = 1.5  # times the farthest crossing: what is shown at first


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
            name = f"output{'s' * (len(units) > 1)} {units_text(units)}"
            panels.curve(result.time, values, name, line(index), row=row)
    panels.shared_x(time_title(unit))
    panels.y(1, OUTPUT)
    panels.y(2, INPUT)
    return panels.figure()


def nyquist(theory: DrawnRelayTheory) -> go.Figure:
    """Return the Nyquist curve near its crossings, and the describing function.

    The form of Johansson (1993), fig. 5.
    """
    panels = Panels(
        "Nyquist curve and describing function",
        "The curve of the process that the relay sees. It crosses the real axis at the ultimate "
        "point, and the line of -1/N(a) where a relay with this hysteresis oscillates.",
    )
    real = [value.re for value in theory.response]
    imaginary = [value.im for value in theory.response]
    level = theory.describing_level or 0.0
    panels.curve(real, imaginary, "process", line(0))
    points = [
        (x, y) for x, y in zip(real, imaginary, strict=True) if x is not None and y is not None
    ]
    crossings = [
        abs(x)
        for (x, after), (_, before) in zip(points[1:], points, strict=False)
        if x < 0 and (before - level) * (after - level) <= 0
    ]
    size = _BESIDE * max(crossings, default=max((abs(x) for x, _ in points), default=1))
    # In the legend, since a small hysteresis brings the lines, and words at them, together.
    panels.curve([-size, 0.0], [0.0, 0.0], "-1/N, no hysteresis", IDENTICAL)
    if level:
        panels.curve([-size, 0.0], [level, level], "-1/N", TODAY)
    panels.x(1, "real part (output/input)", range=[-size, size / 2])
    panels.y(1, "imaginary part<br>(output/input)", range=[-size, size / 2])
    return panels.figure()
