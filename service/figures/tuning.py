"""All figures of a tuning, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import plotly.graph_objects as go

from service import simulations
from service.figures.frequency import controllers, sensitivity, tuned_mu
from service.figures.responses import tuned_response
from service.figures.search import landscape
from service.loop_tags import figure_tagged, tags_of
from service.tuned import MIXED, RequestedTuning
from solver.model.errors import InvalidInputError
from solver.simulation.directions import difficult_direction, easy_direction

__all__ = ["TuningFigures", "tuning_figures"]


@dataclass(frozen=True)
class TuningFigures:
    """Figures by name, and why others could not be drawn."""

    figures: Mapping[str, go.Figure]
    omitted: Mapping[str, str]


def tuning_figures(tuned: RequestedTuning) -> TuningFigures:
    """Draw everything that a tuning has to show.

    Parameters
    ----------
    tuned : RequestedTuning
        Request and result. Without settings the landscape is all there is, if optima were found.

    """
    figures: dict[str, go.Figure] = {}
    omitted: dict[str, str] = {}
    tags = tags_of(tuned.request, tuned.plant.n)
    for name, draw in _DRAWN.items():
        if not tuned.settings:
            continue
        if tuned.mixes_inputs and name not in _OF_CURVES:
            omitted[name] = MIXED
            continue
        try:
            figures[name] = figure_tagged(draw(tuned), tags)
        except InvalidInputError as error:
            omitted[name] = error.message
    if tuned.result.search.local_optima:
        figures["landscape"] = landscape(tuned)
    return TuningFigures(figures, omitted)


def _single(tuned: RequestedTuning) -> go.Figure:
    return tuned_response(
        "Step responses: each loop alone",
        "Set-point step of one loop, all others open. " + _PANELS,
        simulations.alone(tuned),
        tuned.unit,
    )


def _easy(tuned: RequestedTuning) -> go.Figure:
    return tuned_response(
        "Step responses: easy direction",
        "All loops closed; the set points change in the direction that needs the least input. "
        + _PANELS,
        simulations.together(tuned, easy_direction(tuned.plant)),
        tuned.unit,
    )


def _difficult(tuned: RequestedTuning) -> go.Figure:
    return tuned_response(
        "Step responses: difficult direction",
        "All loops closed; the set points change in the direction that needs the most input. "
        + _PANELS,
        simulations.together(tuned, difficult_direction(tuned.plant)),
        tuned.unit,
    )


def _load(tuned: RequestedTuning) -> go.Figure:
    # The unit that takes longest to be rid of a load: the integrated error is tau_I/k.
    errors = [(loop.integral_time or 0.0) / abs(loop.gain) for loop in tuned.loops]
    unit = max(range(len(errors)), key=errors.__getitem__)
    return tuned_response(
        f"Load responses: unit step at the input of loop {unit + 1}",
        "All loops closed, set points constant. " + _PANELS,
        simulations.loaded(tuned, unit),
        tuned.unit,
    )


_PANELS = (
    "Outputs of the model, outputs with the worst error of the inputs, and the model's inputs."
)

_OF_CURVES = {"mu", "controllers"}
_DRAWN: dict[str, Callable[[RequestedTuning], go.Figure]] = {
    "mu": tuned_mu,
    "controllers": controllers,
    "sensitivity": sensitivity,
    "step_single": _single,
    "step_easy": _easy,
    "step_difficult": _difficult,
    "step_load": _load,
}
