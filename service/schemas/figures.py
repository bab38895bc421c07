"""Figures as JSON: what Plotly draws, in any scheme."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

__all__ = ["FiguresResult"]

_MU = {
    "data": [{"type": "scatter", "x": [0.01, 0.1], "y": [0.8, 1.0], "name": "robust performance"}],
    "layout": {
        "meta": {"title": "Robustness: μ over frequency", "description": "Peaks at μ = 1."},
        "height": 380,
    },
}


class Templates(BaseModel):
    """Plotly templates: text, axes and grid, without background."""

    light: dict[str, Any] = Field(description="For light pages.", examples=[{"layout": {}}])
    dark: dict[str, Any] = Field(description="For dark pages.", examples=[{"layout": {}}])


class PlotlyFigure(BaseModel):
    """A figure for `Plotly.newPlot(element, data, {...layout, template})`."""

    data: list[dict[str, Any]] = Field(description="Traces; null is a gap.", examples=[_MU["data"]])
    layout: dict[str, Any] = Field(
        description="Layout; `meta` holds title and description.", examples=[_MU["layout"]]
    )


class FiguresResult(BaseModel):
    """Figures, in the order in which they are shown, and the templates to show them with."""

    templates: Templates = Field(
        description="One for each scheme; a figure itself has none.",
        examples=[{"light": {"layout": {}}, "dark": {"layout": {}}}],
    )
    figures: dict[str, PlotlyFigure] = Field(
        description="The figures by name.", examples=[{"mu": _MU}]
    )
    omitted: dict[str, str] = Field(
        description="Figures that could not be drawn, and why.", examples=[{}]
    )
