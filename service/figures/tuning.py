"""All figures of a tuning, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import plotly.graph_objects as go

from service import simulations
from service.figures.frequency import controllers, identical_curves, mu, sensitivity
from service.figures.responses import Directed, tuned_response
from service.figures.search import landscape
from service.tuned import Tuned
from solver.errors import InvalidInputError
from solver.simulation import difficult_direction, easy_direction

__all__ = ["TuningFigures", "tuning_figures"]


@dataclass(frozen=True)
class TuningFigures:
    """Figures by name, and why others could not be drawn."""

    figures: Mapping[str, go.Figure]
    omitted: Mapping[str, str]


def tuning_figures(tuned: Tuned) -> TuningFigures:
    """Draw everything that a tuning has to show.

    Parameters
    ----------
    tuned : Tuned
        Request and result. Without settings the landscape is all there is, if optima were found.

    """
    figures, omitted = {}, {}
    for name, draw in _DRAWN.items():
        if not tuned.settings:
            continue
        try:
            figures[name] = draw(tuned)
        except InvalidInputError as error:
            omitted[name] = error.message
    if tuned.result.search.local_optima:
        figures["landscape"] = landscape(tuned)
    return TuningFigures(figures, omitted)


def _mu(tuned: Tuned) -> go.Figure:
    result = tuned.result
    if result.curves is None or result.peaks is None:
        message = "the result has no curves"
        raise InvalidInputError(message)
    return mu(result.curves, result.peaks, identical=identical_curves(tuned))


def _single(tuned: Tuned) -> go.Figure:
    case = simulations.alone(tuned)
    return tuned_response(
        Directed(
            "Step responses: each loop alone",
            "Set-point step of one unit, all other loops open. " + _CAPTION,
            case.nominal,
            case.worst,
            case.identical,
        )
    )


def _easy(tuned: Tuned) -> go.Figure:
    case = simulations.together(tuned, easy_direction(tuned.plant))
    return tuned_response(
        Directed(
            "Step responses: easy direction",
            "All loops closed; the set points change in the direction that needs the least "
            "input. " + _CAPTION,
            case.nominal,
            case.worst,
            case.identical,
        )
    )


def _difficult(tuned: Tuned) -> go.Figure:
    case = simulations.together(tuned, difficult_direction(tuned.plant))
    return tuned_response(
        Directed(
            "Step responses: difficult direction",
            "All loops closed; the set points change in the direction that needs the most "
            "input. " + _CAPTION,
            case.nominal,
            case.worst,
            case.identical,
        )
    )


_CAPTION = (
    "Outputs of the model, outputs with the worst error of the inputs, and the model's inputs."
)

_DRAWN: dict[str, Callable[[Tuned], go.Figure]] = {
    "mu": _mu,
    "controllers": controllers,
    "sensitivity": sensitivity,
    "step_single": _single,
    "step_easy": _easy,
    "step_difficult": _difficult,
}
