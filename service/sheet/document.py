"""The loop sheet of a tuning: its numbers, sentences and figures together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from service.figures.behaviour import behaviour_figures
from service.schemas.sheet import Behaviour
from service.sheet.naming import loops_name
from service.sheet.responses import Measured, Moves, Response, moves
from service.sheet.risks import Said, risks
from service.tuned import MIXED, RequestedTuning
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.measured import ADVICE, MeasuredPlant
from solver.model.neighbours import NeighbourPlant
from solver.model.plants import Plant
from solver.robustness.analysis import MANY, analyse
from solver.robustness.margins import LoopMargins, Margins, loop_margins
from solver.simulation.experiment import StepKind
from solver.stability.closed_loop import is_stable

__all__ = ["AS_FOUND", "FOUND", "IDENTICAL", "LoopSheet", "loop_sheet"]

FOUND, IDENTICAL, AS_FOUND = "found", "identical", "as found"


@dataclass(frozen=True)
class LoopSheet:
    """What `service.schemas.sheet.SheetResult` describes, figures not yet as JSON."""

    behaviour: tuple[Behaviour, ...]
    risks: tuple[Said, ...]
    figures: Mapping[str, go.Figure]
    omitted: Mapping[str, str]


def loop_sheet(tuned: RequestedTuning) -> LoopSheet:
    """Return the sheet of a tuning; an empty one where there are no stable settings."""
    if not tuned.settings:
        return LoopSheet((), (), {}, {})
    if tuned.mixes_inputs:
        return LoopSheet((), (), {}, {"set_point": MIXED, "load": MIXED})
    robustness = analyse(
        tuned.plant,
        tuned.uncertainty,
        tuned.performance,
        tuned.loops,
        model_tolerance=not tuned.result.model_tolerance,
    )
    if not robustness.nominally_stable:
        return LoopSheet(
            (), tuple(Said("note", "bad", text) for text in robustness.warnings), {}, {}
        )
    if isinstance(tuned.plant, MeasuredPlant):
        said = [*robustness.warnings, robustness.guarantee.reason if robustness.guarantee else None]
        return LoopSheet(
            (),
            tuple(Said("note", "warning", text) for text in said if text),
            {},
            {"set_point": ADVICE, "load": ADVICE},
        )
    if isinstance(tuned.plant, NeighbourPlant):
        return LoopSheet(
            (),
            tuple(Said("note", "note", text) for text in robustness.warnings),
            {},
            {"set_point": MANY, "load": MANY},
        )
    others = {IDENTICAL: tuned.identical} if tuned.identical and len(tuned.settings) > 1 else {}
    if tuned.specification.as_found is not None:
        others = {AS_FOUND: tuned.specification.as_found}
    today = tuned.result.as_found
    if today is not None and today.peaks is not None:  # else there is no analysis of them
        others[AS_FOUND] = tuned.as_found
    try:
        moved: list[Moves] = list(moves(tuned, others))
        omitted: dict[str, str] = {}
    except InvalidInputError as error:
        moved, omitted = [], {"set_point": error.message, "load": error.message}
    judged = {FOUND: _Judged(stable=True, margins=robustness.margins)}
    for name, each in others.items():
        judged[name] = _Judged.of(tuned.plant, each)
    return LoopSheet(
        tuple(_rows(tuned, moved, judged)),
        risks(tuned, robustness, moved),
        behaviour_figures(tuned, moved) if moved else {},
        omitted,
    )


@dataclass(frozen=True)
class _Judged:
    """Whether all loops are stable together, and their margins."""

    stable: bool
    margins: tuple[LoopMargins, ...]

    @classmethod
    def of(cls, plant: Plant, loops: Sequence[Controller]) -> _Judged:
        stable = is_stable(plant, loops)
        return cls(stable, loop_margins(plant, loops, stable=stable))


def _rows(
    tuned: RequestedTuning, moved: Sequence[Moves], judged: Mapping[str, _Judged]
) -> Iterator[Behaviour]:
    set_points = [move for move in moved if move.kind is StepKind.SETPOINT]
    loads = [move for move in moved if move.kind is StepKind.LOAD]
    for name, each in judged.items():
        for set_point, load in zip(set_points, loads, strict=True):
            if name != FOUND and name not in set_point.others:
                continue  # as on the loop before
            alike = name != FOUND and each.margins[0].units == tuple(range(tuned.plant.n))
            first, second = _of(set_point, name), _of(load, name)
            margins = _margins(each.margins, set_point.units[0], alone=tuned.plant.n == 1)
            yield Behaviour.model_validate(
                {
                    "loop": "all loops" if alike else loops_name(tuned, set_point.units),
                    "settings": name,
                    "stable": each.stable,
                    "set_point_step": set_point.size,
                    "settling_time": first and first.settling_time,
                    "overshoot": first and first.overshoot,
                    "input_peak": first and first.input_peak,
                    "load_step": load.size,
                    "load_error": second and second.largest_error,
                    "load_settling_time": second and second.settling_time,
                    "gain_margin": _finite(margins, "gain_increase"),
                    "phase_margin": _finite(margins, "phase_margin"),
                    "delay_margin": _finite(margins, "delay_margin"),
                }
            )


def _of(moves: Moves, name: str) -> Measured | None:
    response: Response | None = moves.given if name == FOUND else moves.others[name]
    return None if response is None else response.measured


def _margins(loops: Sequence[LoopMargins], unit: int, *, alone: bool) -> Margins | None:
    """Return the margins of one loop with all others closed."""
    for each in loops:
        if unit in each.units:
            return each.alone if alone else each.together
    return None


def _finite(margins: Margins | None, name: str) -> float | None:
    value = math.inf if margins is None else getattr(margins, name)
    return value if math.isfinite(value) else None
