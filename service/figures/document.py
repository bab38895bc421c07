"""Figures as one JSON object, with the templates of both schemes; a figure as a file of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from service.figures.style import Theme, template

__all__ = ["figures_to_json", "page", "plain"]


def figures_to_json(
    figures: Mapping[str, go.Figure], omitted: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return figures as the JSON object that `service.schemas.figures.FiguresResult` describes."""
    return {
        "templates": {theme.value: template(theme).to_plotly_json() for theme in Theme},
        "figures": {name: plain(figure) for name, figure in figures.items()},
        "omitted": dict(omitted or {}),
    }


def plain(figure: go.Figure) -> dict[str, Any]:
    """Return a figure as JSON values, its template left to who shows it."""
    document: dict[str, Any] = figure.to_plotly_json()
    document["layout"].pop("template")
    return document


def page(figure: go.Figure) -> str:
    """Return an HTML file with one figure, its title above, that opens without network."""
    title = {"text": figure.layout.meta["title"], "y": 0.97, "yanchor": "top", "x": 0.02}
    shown = go.Figure(figure)
    margin = {"t": 100}  # the title stands above the legend
    shown.update_layout(
        template=template(Theme.LIGHT), title=title, margin=margin, height=520, width=900
    )
    return str(shown.to_html(include_plotlyjs=True))
