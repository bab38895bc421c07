"""Plotly figures of all results, built once for the page, the notebook and the report."""

from service.figures.decoupling import decoupled
from service.figures.frequency import controllers, mu, sensitivity
from service.figures.interaction import interaction
from service.figures.responses import drives, relay, step_response, tuned_response
from service.figures.search import landscape, trade_off
from service.figures.style import Theme, template
from service.figures.tuning import TuningFigures, tuning_figures

__all__ = [
    "Theme",
    "TuningFigures",
    "controllers",
    "decoupled",
    "drives",
    "interaction",
    "landscape",
    "mu",
    "relay",
    "sensitivity",
    "step_response",
    "template",
    "trade_off",
    "tuned_response",
    "tuning_figures",
]
