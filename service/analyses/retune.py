"""Tune beside known settings.

Return the best settings near the given ones, at once and without a job: for demands that are moved
little by little. They keep the demand on the whole axis, but are the best on a grid of frequencies
only, and what a whole search finds may be better.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, JsonValue

from service.analysis import Analysis
from service.model_wording import tolerance_lines
from service.printing import Grid, Line, Part, peaks_grid, warning_lines
from service.schemas.fields import AnalysisRequest, below
from service.schemas.tunings import EXAMPLE as TUNING
from service.schemas.tunings import TuningRequest, TuningResult
from service.valves import finished
from service.wording import headline, number
from solver.model.errors import InvalidInputError
from solver.model.loop_names import units_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.tuning.specification import Specification

__all__ = ["ANALYSIS", "RetuneRequest"]

EXAMPLE: dict[str, JsonValue] = {
    **TUNING,
    "search": {
        "start": [
            {"gain": 47.7, "integral_time": 101.0, "derivative_time": None},
            {"gain": 18.9, "integral_time": 2.36, "derivative_time": None},
        ]
    },
}


class RetuneRequest(TuningRequest, AnalysisRequest):
    """Ask for the best settings beside known ones: a tuning request with search.start."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE], "x-form": False})

    def build(self) -> Specification:
        """Return the solver's specification.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """
        if self.search.start is None:
            with below("/search"):
                message = "known settings are needed, one entry a loop"
                raise InvalidInputError(message, "/start")
        return replace(super().build(), rough=True)


def compute(request: RetuneRequest) -> dict[str, Any]:
    """Return the tuning beside the settings of the request."""
    from solver.tuning.tuner import tune

    return finished(request, tune(request.build()))


def table(result: TuningResult) -> Sequence[Part]:
    """Return what was found, its settings and peaks."""
    parts: list[Part] = [Line(headline(result, None), "strong" if result.loops else "alarm")]
    rows = [
        (units_text(group), *map(number, _setting(result, group[0]))) for group in result.groups
    ]
    if rows:
        parts.append(Grid(("loop", "k", "τI", "τD", "τF"), rows))
    parts += tolerance_lines(result.model_tolerance)
    if result.peaks is not None:
        parts.append(peaks_grid(result.peaks))
    return [*parts, *warning_lines(result.warnings)]


def _setting(result: TuningResult, unit: int) -> tuple[float | None, ...]:
    loop = result.loops[unit]
    return loop.gain, loop.integral_time, loop.derivative_time, loop.filter_time


ANALYSIS = Analysis(
    name="retune",
    resource="retunings",
    text=__doc__,
    outcome="The settings.",
    request=RetuneRequest,
    result=TuningResult,
    compute=compute,
    computes_with=("solver.tuning.tuner",),
    table=table,
    fails=lambda result: not result.loops,
)
