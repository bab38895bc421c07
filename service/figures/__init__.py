"""Plotly figures, built once for the page, the notebook and the report.

Those of one analysis alone are where that analysis is: ``service/analyses/NAME/figure.py``.
"""

from service.figures.frequency import controllers, mu, sensitivity
from service.figures.responses import step_response, tuned_response
from service.figures.search import landscape, trade_off
from service.figures.style import Theme, template
from service.figures.tuning import TuningFigures, tuning_figures

__all__ = [
    "Theme",
    "TuningFigures",
    "controllers",
    "landscape",
    "mu",
    "sensitivity",
    "step_response",
    "template",
    "trade_off",
    "tuned_response",
    "tuning_figures",
]
