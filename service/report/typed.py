"""Settings as they are typed where gains are in per cent of the spans."""

from __future__ import annotations

from dataclasses import dataclass

from service.analyses.controller_forms import ANALYSIS, ControllerFormsRequest
from service.sheet.naming import instrument_of, loops_name
from service.tuned import RequestedTuning
from solver.hand_over.law import Names

__all__ = ["Typed", "typed_in_per_cent"]

_FORMS = ("ideal", "cascade")  # the first that all loops have
_DIGITS = 4


@dataclass(frozen=True)
class Typed:
    """The law, and a row of values a setting, with the heads of its columns."""

    equation: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def typed_in_per_cent(tuned: RequestedTuning) -> Typed | None:
    """Return the settings in per cent of the spans; None where not all spans are known."""
    signals = [instrument_of(tuned, unit) for unit in range(tuned.plant.n)]
    if not tuned.loops or not all(each.output_span and each.input_span for each in signals):
        return None
    given = {
        "loops": [loop.model_dump(exclude_none=True) for loop in tuned.result.loops],
        "instruments": [each.model_dump(exclude_none=True) for each in signals],
    }
    for form in _FORMS:
        target = {"form": form, "digits": _DIGITS}
        request = ControllerFormsRequest.model_validate({**given, "target": target}, strict=False)
        found = ANALYSIS.compute(request)["hand_over"]
        if not any(loop["reason"] for loop in found["loops"]):
            return _as_rows(tuned, found)
    return None


def _as_rows(tuned: RequestedTuning, found: dict[str, object]) -> Typed:
    loops = found["loops"]
    assert isinstance(loops, list)  # noqa: S101 - for the type checker
    heads: dict[str, str] = {}
    for loop in loops:
        heads |= {each["name"]: each["unit"] for each in loop["values"]}
    rows = []
    for setting in tuned.settings:
        loop = loops[setting.units[0]]
        values = {each["name"]: each["value"] for each in loop["values"]}
        cells = (f"{values[name]:g}" if values.get(name) is not None else "off" for name in heads)
        rows.append((loops_name(tuned, setting.units), loop["action"], *cells))
    units = tuple(
        f"{name}, {tuned.unit if unit == 'time unit' else unit}" if unit else name
        for name, unit in heads.items()
    )
    derivative = Names().derivative
    off = "" if derivative in heads else f", {derivative} = 0"
    return Typed(f"{found['equation']}{off}", ("", "action", *units), tuple(rows))
