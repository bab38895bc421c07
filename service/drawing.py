"""What the processes of the pool draw beside the analyses: all of a tuning, and a trade-off.

Each function imports Plotly itself, so that the service can name it and hold none of that.
"""

# ruff: noqa: PLC0415 - for the reason above

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from service.schemas.trade_off import TradeOff
from service.tuned import RequestedTuning

__all__ = ["report", "sheet", "trade_off", "tuning"]


def tuning(request: str, result: str, unit: str) -> dict[str, Any]:
    """Return everything that the result of a tuning has to show; both are JSON text."""
    from service.figures.document import figures_to_json
    from service.figures.tuning import tuning_figures

    drawn = tuning_figures(RequestedTuning.from_json(request, result, unit))
    return figures_to_json(drawn.figures, drawn.omitted)


def sheet(request: str, result: str, unit: str) -> dict[str, Any]:
    """Return how the loops of a tuning behave and what can go wrong; both are JSON text."""
    from dataclasses import asdict

    from service.figures.document import figures_to_json
    from service.sheet.document import loop_sheet

    made = loop_sheet(RequestedTuning.from_json(request, result, unit))
    return {
        "behaviour": [row.model_dump() for row in made.behaviour],
        "risks": [asdict(risk) for risk in made.risks],
        "figures": figures_to_json(made.figures, made.omitted),
    }


def report(request: str, result: str, unit: str, job: str) -> dict[str, Any]:
    """Return the report of a tuning and the content policy that it needs."""
    from service.report.document import POLICY, report_html

    tuned = RequestedTuning.from_json(request, result, unit)
    return {"html": report_html(tuned, datetime.now(UTC), job), "policy": POLICY}


def trade_off(result: TradeOff, unit: str) -> dict[str, Any]:
    """Return the figure of a trade-off."""
    from service.figures import search
    from service.figures.document import figures_to_json

    return figures_to_json({"trade_off": search.trade_off(result, unit)})
