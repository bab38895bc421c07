"""See what each loop sees when the others close.

Return its process with the other loops open and closed, and the sensitivities of the loops.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, JsonValue

from service.analyses.loop_responses.drawn import DrawnLoopResponses
from service.analyses.loop_responses.result import (
    LoopResponsesResult,
    RationalFunction,
    SeenLoop,
)
from service.analysis import Analysis, Figures
from service.printing import Grid, Line, Part, warning_lines
from service.schemas.controllers import Loop
from service.schemas.encoding import encode
from service.schemas.fields import AnalysisRequest, below
from service.schemas.frequencies import Frequencies, ascending
from service.schemas.plants import Plant
from service.wording import number
from solver.model.loop_names import loops_text, units_text
from solver.model.plants import MAX_UNITS
from solver.robustness.loop_responses_query import LoopResponsesQuery

__all__ = ["ANALYSIS", "LoopResponsesRequest", "LoopResponsesResult"]

_LAG: JsonValue = {"num": [1.0], "den": [1.0, 2.0, 1.0]}
_PLANT: JsonValue = {
    "kind": "matrix",
    "elements": [[_LAG, {"num": [2.0], "den": [1.0, 2.0, 1.0]}], [_LAG, _LAG]],
}
_LOOPS: JsonValue = [
    {"gain": 1.0, "integral_time": 1.0},
    {"gain": 0.8, "integral_time": None},
]
EXAMPLE: dict[str, JsonValue] = {"plant": _PLANT, "loops": _LOOPS}


class LoopResponsesRequest(AnalysisRequest):
    """Ask what each loop of a plant sees."""

    plant: Plant = Field(description="The process, without unstable poles.", examples=[_PLANT])
    loops: Annotated[tuple[Loop | None, ...], Field(min_length=1, max_length=MAX_UNITS)] = Field(
        description="Settings, one entry a loop; null: the loop is open.", examples=[_LOOPS]
    )
    omega: Frequencies | None = Field(
        default=None,
        description="Frequencies of the curves, ascending; null: chosen from plant and loops.",
        examples=[None, [0.01, 0.1, 1.0]],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> LoopResponsesQuery:
        """Return what the solver takes."""
        with below("/plant"):
            plant = self.plant.build()
        loops = []
        for index, loop in enumerate(self.loops):
            with below(f"/loops/{index}"):
                loops.append(None if loop is None else loop.build())
        return LoopResponsesQuery(plant, tuple(loops), ascending(self.omega))


def compute(request: LoopResponsesRequest) -> dict[str, Any]:
    """Return what the loops of the request see."""
    from solver.robustness.loop_responses import loop_responses

    document: dict[str, Any] = encode(loop_responses(request.build()))
    return document


def table(result: LoopResponsesResult) -> list[Part]:
    """Return static gains and transfer functions, open and closed."""
    rows = [
        (
            units_text(loop.units),
            number(loop.static_open),
            number(loop.static_closed),
            number(_peak(loop.sensitivity)),
        )
        for loop in result.loops
    ]
    heads = ("loop", "static gain, others open", "others closed", "Ms alone")
    state = "stable" if result.stable else "UNSTABLE"
    parts: list[Part] = [
        Line(f"The closed loops together are {state}.", "strong" if result.stable else "alarm"),
        Grid(heads, rows),
    ]
    for loop in result.loops:
        for name, function in (
            ("others open", loop.function_open),
            ("others closed", loop.function_closed),
        ):
            if function is not None:
                whose = loops_text(loop.units).capitalize()
                parts.append(Line(f"{whose}, {name}: {_written(function)}"))
    if result.sensitivity is not None:
        highest = number(_peak(result.sensitivity))
        parts.append(Line(f"All closed, the largest singular value of S peaks at {highest}."))
    return [*parts, *warning_lines(_warnings(result.loops))]


def _warnings(loops: list[SeenLoop]) -> list[str]:
    found = []
    for loop in loops:
        name = units_text(loop.units)
        before, after = loop.static_open, loop.static_closed
        if not loop.others_stable:
            found.append(
                f"The loops other than {name} are unstable by themselves: what loop {name} sees "
                "with them closed is formal."
            )
        elif before and after is not None and before * after < 0:
            found.append(
                f"The static gain of loop {name} changes its sign when the others close: its "
                "controller then acts the wrong way."
            )
    return found


def _peak(curve: list[float | None] | None) -> float | None:
    return max((value for value in curve or () if value is not None), default=None)


def _written(function: RationalFunction) -> str:
    return f"({_polynomial(function.num)}) / ({_polynomial(function.den)})"


def _polynomial(coefficients: list[float | None]) -> str:
    """Return a polynomial as it is typed in mathematics: s^2 + 2 s + 0.2."""
    terms: list[str] = []
    for power, value in zip(range(len(coefficients) - 1, -1, -1), coefficients, strict=True):
        if value is None or (value == 0 and len(coefficients) > 1):
            continue
        factor = {0: "", 1: "s"}.get(power, f"s^{power}")
        size = "" if abs(value) == 1 and power else number(abs(value))
        sign = "-" if value < 0 else "+" if terms else ""
        terms.append(f"{sign}{' ' * bool(terms)}{' '.join(filter(None, (size, factor)))}")
    return " ".join(terms)


def draw(result: DrawnLoopResponses, unit: str) -> dict[str, Any]:
    """Return the processes and the sensitivities."""
    from service.analyses.loop_responses.figure import processes, sensitivities
    from service.figures.document import figures_to_json

    drawn = {"processes": processes(result, unit)}
    if result.sensitivity is None and all(loop.sensitivity is None for loop in result.loops):
        return figures_to_json(drawn, {"sensitivities": "no loop is closed and stable"})
    return figures_to_json(drawn | {"sensitivities": sensitivities(result, unit)})


ANALYSIS = Analysis(
    name="loop_responses",
    resource="loop-responses",
    text=__doc__,
    outcome="What each loop sees.",
    request=LoopResponsesRequest,
    result=LoopResponsesResult,
    compute=compute,
    computes_with=("solver.robustness.loop_responses",),
    table=table,
    figures=Figures(of="what loops see", drawn=DrawnLoopResponses, draw=draw),
)
