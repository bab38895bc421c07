"""Tunings in Jupyter: results that display themselves, with their figures and report.

The solver's records stay plain; this wraps them for display.

    from service import notebook

    tuning = notebook.tune({"plant": {...}, "uncertainty": {...}}, unit="min")
    tuning
    tuning.figures["mu"]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from service.figures.tuning import tuning_figures
from service.report.document import report_html
from service.report.rendering import render
from service.schemas import TuningRequest, TuningResult, parse_tuning_request
from service.tuned import RequestedTuning
from service.whole_file import replace_text
from service.wording import OBJECTIVES, TIME_UNIT, forms, headline, peak_rows
from solver.tuning import tuner

__all__ = ["TuningView", "parse", "tune"]


@dataclass(frozen=True)
class TuningView:
    """A tuning that displays itself as a table.

    Parameters
    ----------
    tuned : RequestedTuning
        Request and result.

    """

    tuned: RequestedTuning

    @property
    def result(self) -> TuningResult:
        """The result."""
        return self.tuned.result

    @cached_property
    def figures(self) -> Mapping[str, go.Figure]:
        """The figures by name; each displays itself."""
        return tuning_figures(self.tuned).figures

    def save_report(self, path: str | Path) -> Path:
        """Write the report, one HTML file, and return its path."""
        target = Path(path)
        replace_text(target, report_html(self.tuned, datetime.now(UTC)))
        return target

    def __repr__(self) -> str:
        """Return what was found, in one sentence."""
        return headline(self.tuned.result, self.tuned.unit)

    def _repr_html_(self) -> str:
        """Return the table that Jupyter shows."""
        tuned = self.tuned
        controllers = [setting.controller for setting in tuned.settings]
        return render(
            "summary.html",
            tuned=tuned,
            headline=headline(tuned.result, tuned.unit),
            objective=OBJECTIVES[tuned.result.objective],
            forms=forms(controllers)[:1],
            peaks=peak_rows(tuned.result.peaks),
        )


def parse(request: Mapping[str, Any]) -> TuningRequest:
    """Return a request, given in the form of the request files, checked.

    Raises
    ------
    RequestError
        A value that cannot be accepted, named by its place in the request.

    """
    return parse_tuning_request(json.dumps(request))


def tune(request: Mapping[str, Any], unit: str = TIME_UNIT) -> TuningView:
    """Tune a request, given in the form of the request files.

    Parameters
    ----------
    request : mapping
        As ``POST /v1/tunings`` takes it.
    unit : str
        Name of the unit of time, for tables and axes.

    Raises
    ------
    RequestError, InvalidInputError
        A value that cannot be accepted, named by its place in the request.

    """
    parsed = parse(request)
    return TuningView(RequestedTuning.of(parsed, tuner.tune(parsed.build()), unit))
