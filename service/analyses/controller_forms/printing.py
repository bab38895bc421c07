"""Controllers in their forms, and the values to type, as lines and grids."""

from __future__ import annotations

from collections.abc import Iterator

from service.analyses.controller_forms.result import ControllerFormsResult, HandOverResult
from service.printing import Grid, Line, Part, form_parts
from service.wording import number
from solver.hand_over.conversion import MAX_DIGITS

__all__ = ["table"]


def table(result: ControllerFormsResult) -> list[Part]:
    """Return what is typed; without a target, the controllers in each form."""
    if result.hand_over is not None:
        return list(_hand_over_parts(result.hand_over))
    loops = [(str(index + 1), each.cascade.build()) for index, each in enumerate(result.forms)]
    return list(form_parts(loops))


def _hand_over_parts(found: HandOverResult) -> Iterator[Part]:
    """Yield the verdict, the equation and the values to type."""
    if found.nominally_stable is False:
        yield Line("With the typed values the loops are unstable.", "alarm")
    elif found.peaks is not None:
        peak = number(found.peaks.robust_performance.value)
        if found.demand_met:
            yield Line(f"With the typed values the demand is met: mu is at most {peak}.", "strong")
        else:
            yield Line(f"With the typed values the demand is not met: mu reaches {peak}.", "alarm")
    if found.controller is not None:
        yield Line(found.controller, "strong")
    yield Line(f"Equation, signals in per cent of span, times in {found.time_unit}:")
    yield Line(f"  {found.equation}")
    columns = list(
        dict.fromkeys((each.name, each.unit) for loop in found.loops for each in loop.values)
    )
    rows = []
    for index, loop in enumerate(found.loops):
        values = {(each.name, each.unit): each.value for each in loop.values}
        shown = [number(values.get(column), MAX_DIGITS) for column in columns]
        if loop.reason is not None:
            shown = [loop.reason, *[""] * (len(columns) - 1)][: len(columns)]
        rows.append([loop.tag or str(index + 1), loop.action, *shown])
    heads = [f"{name} ({unit})" if unit else name for name, unit in columns]
    yield Grid(["loop", "action", *heads], rows, frozenset({0, 1}))
    for index, loop in enumerate(found.loops):
        for text in [*loop.notes, *filter(None, [loop.reason])]:
            yield Line(f"Loop {loop.tag or index + 1}: {text}.", "warning")
    yield from (Line(text) for text in found.notes)
    if found.source is not None:
        yield Line(f"Source: {found.source}.")
