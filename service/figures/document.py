"""Figures as one JSON object, with the templates of both schemes: what the service answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import plotly.graph_objects as go

from service.figures.decoupling import decoupled
from service.figures.frequency import mu
from service.figures.interaction import interaction
from service.figures.responses import drives, relay, step_response
from service.figures.search import trade_off
from service.figures.style import Theme, template
from service.figures.tuning import tuning_figures
from service.schemas.drawn import (
    Drawn,
    DrawnDecoupling,
    DrawnInteraction,
    DrawnParallelDrives,
    DrawnRelayExperiment,
    DrawnRobustness,
    DrawnStepResponse,
)
from service.schemas.trade_off import TradeOff
from service.tuned import Tuned

__all__ = ["draw", "draw_tuning", "figures_to_json", "plain"]


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


def draw_tuning(request: str, result: str, unit: str) -> dict[str, Any]:
    """Return all figures of a tuning, given as JSON texts."""
    drawn = tuning_figures(Tuned.from_json(request, result, unit))
    return figures_to_json(drawn.figures, drawn.omitted)


def draw(result: Drawn, unit: str) -> dict[str, Any]:
    """Return the figures of an analysis."""
    return _DRAWN[type(result)](result, unit)


def _robustness(result: DrawnRobustness, unit: str) -> dict[str, Any]:
    if result.curves is None or result.peaks is None:
        return figures_to_json({}, {"mu": "there are no curves: the loops are unstable"})
    figure = mu(result.curves, result.peaks, lower_bound=result.lower_bound, unit=unit)
    return figures_to_json({"mu": figure})


def _decoupling(result: DrawnDecoupling, unit: str) -> dict[str, Any]:
    if result.closed_loop is None:
        return figures_to_json({}, {"decoupled": "a loop is unbounded"})
    return figures_to_json({"decoupled": decoupled(result.closed_loop, unit)})


_DRAWN: dict[type[Drawn], Callable[[Any, str], dict[str, Any]]] = {
    DrawnRobustness: _robustness,
    DrawnInteraction: lambda result, unit: figures_to_json(interaction(result, unit)),
    DrawnStepResponse: lambda result, unit: figures_to_json(
        {"step_response": step_response(result, unit)}
    ),
    DrawnRelayExperiment: lambda result, unit: figures_to_json({"relay": relay(result, unit)}),
    DrawnParallelDrives: lambda result, unit: figures_to_json(
        {"drives": drives(result.simulation, unit)}
    ),
    DrawnDecoupling: _decoupling,
    TradeOff: lambda result, unit: figures_to_json({"trade_off": trade_off(result, unit)}),
}
