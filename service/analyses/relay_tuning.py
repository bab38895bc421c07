"""Tune all loops by relay experiments, again and again.

Return the experiments in all pairs, those with the other loops closed, and whether they agree.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, JsonValue

from service.analyses.identify import identified, tuning_request
from service.analyses.identify.models import IdentificationTask
from service.analyses.relay.request import RelaySettings
from service.analyses.relay.result import UltimatePoint
from service.analysis import Analysis
from service.printing import Grid, Line, Part, warning_lines
from service.schemas.controllers import Loop
from service.schemas.encoding import encode
from service.schemas.fields import WHOLE, AnalysisRequest, IdentifiedResult, ResultModel, below
from service.schemas.plants import Plant
from service.wording import number
from solver.relay.sequential_query import MAX_LOOPS, MAX_ROUNDS, RelayTuning, Rule

__all__ = ["ANALYSIS", "RelayTuningRequest", "RelayTuningResult"]

_LAG: JsonValue = {"num": [1.0], "den": [1.0, 3.0, 3.0, 1.0]}
_PLANT: JsonValue = {
    "kind": "matrix",
    "elements": [
        [_LAG, {"num": [0.2], "den": [2.0, 1.0]}],
        [{"num": [-0.3], "den": [1.0, 2.0, 1.0]}, _LAG],
    ],
}
_RELAY: JsonValue = {"amplitude": 1.0, "hysteresis": 0.01, "sampling_period": None}
EXAMPLE: dict[str, JsonValue] = {
    "plant": _PLANT,
    "relay": _RELAY,
    "rule": "tyreus_luyben",
    "pairing": None,
    "rounds": 5,
}
_POINT: JsonValue = {"gain": 6.7, "omega": 1.62}
_FOUND: JsonValue = {
    "output": 0,
    "input": 0,
    "behaviour": "limit_cycle",
    "ultimate": _POINT,
    "loop": {"gain": 2.1, "integral_time": 8.5, "derivative_time": None},
    "remark": None,
}

InputIndex = Annotated[int, Field(ge=0, lt=MAX_LOOPS, json_schema_extra={"x-unit": "1"}), WHOLE]


class RelayTuningRequest(AnalysisRequest):
    """Ask for settings of all loops by relay experiments."""

    plant: Plant = Field(
        description=f"The process, 2 to {MAX_LOOPS} loops; dead time is exact.", examples=[_PLANT]
    )
    relay: RelaySettings = Field(
        default=RelaySettings(),
        description="The relay; its amplitude takes the sign of each process.",
        examples=[_RELAY],
    )
    rule: Literal["ziegler_nichols", "tyreus_luyben"] = Field(
        default="ziegler_nichols",
        description="From ultimate points to settings. ziegler_nichols: fast, poorly damped. "
        "tyreus_luyben: calmer, slower.",
        examples=["ziegler_nichols"],
    )
    pairing: Annotated[tuple[InputIndex, ...], Field(min_length=2, max_length=MAX_LOOPS)] | None = (
        Field(
            default=None,
            description="Input, from 0, of each output; null: as numbered.",
            examples=[None, [1, 0]],
        )
    )
    rounds: Annotated[int, Field(ge=1, le=MAX_ROUNDS, json_schema_extra={"x-unit": "1"}), WHOLE] = (
        Field(
            default=5,
            description="Most repetitions of the experiments with the other loops closed.",
            examples=[5],
        )
    )

    identify: bool = Field(
        default=False,
        description="Whether a plant is identified from the experiments in the pairs of the "
        "pairing, all other loops open.",
        examples=[False],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> RelayTuning:
        """Return what the solver takes."""
        with below("/plant"):
            plant = self.plant.build()
        with below("/relay"):
            relay = self.relay.build()
        return RelayTuning(plant, relay, Rule(self.rule), self.pairing, self.rounds)


class TunedByRelay(ResultModel):
    """A relay experiment and the settings read off it."""

    output: int = Field(description="Output of the loop, from 0.", examples=[0])
    input: int = Field(description="Input of the loop, from 0.", examples=[0])
    behaviour: str = Field(description="How it ended.", examples=["limit_cycle"])
    ultimate: UltimatePoint | None = Field(
        description="Ultimate point; null: the cycle is not at it, or there is none.",
        examples=[_POINT],
    )
    loop: Loop | None = Field(
        description="Settings by the rule.",
        examples=[{"gain": 2.1, "integral_time": 8.5, "derivative_time": None}],
    )
    remark: str | None = Field(
        description="What keeps the cycle from the ultimate point.", examples=[None]
    )


class RelayTuningResult(IdentifiedResult, ResultModel):
    """Settings of all loops by relay experiments."""

    verdict: Literal["converged", "no_cycle", "rounds"] = Field(
        description="converged: the settings of two rounds agree within 2 %. no_cycle: a loop "
        "shows no ultimate point. rounds: the settings still change.",
        examples=["converged"],
    )
    open_loops: list[TunedByRelay] = Field(
        description="Experiments in all pairs, the rest open, row by row.", examples=[[_FOUND]]
    )
    rounds: list[list[TunedByRelay]] = Field(
        description="Experiments in the loops of the pairing, the others closed, a list a round.",
        examples=[[[_FOUND]]],
    )
    loops: list[Loop] | None = Field(
        description="The last complete settings, one an output; null: none.", examples=[None]
    )
    stable: bool | None = Field(
        description="Whether these settings are stable together.", examples=[True]
    )
    model: dict[str, Any] | None = Field(
        description="A tuning request with the plant that the experiments tell and the uncertainty "
        "that covers what they do not; null unless asked for.",
        examples=[None],
    )


def compute(request: RelayTuningRequest) -> dict[str, Any]:
    """Return what the experiments of the request find."""
    from solver.relay.sequential import relay_tuning

    task = request.build()
    document: dict[str, Any] = encode(relay_tuning(task))
    document["model"] = _model(task) if request.identify else None
    for each in (*document["open_loops"], *(one for row in document["rounds"] for one in row)):
        each["loop"] = each.pop("controller")
    return document


def _model(task: RelayTuning) -> dict[str, Any]:
    from solver.identification.relay_record import relay_records

    assumed = IdentificationTask(
        used=tuple(relay_records(task)), kept_back=(), structure="matrix", order=None,
        integrating=None, drift=False,
    )  # fmt: skip
    return tuning_request(identified(assumed))


_VERDICTS = {
    "converged": "The settings of two rounds agree.",
    "no_cycle": "A loop shows no ultimate point: relay experiments loop by loop do not tune these.",
    "rounds": "The settings still change from round to round.",
}


def table(result: RelayTuningResult) -> list[Part]:
    """Return the verdict, the settings and the experiments."""
    converged = result.verdict == "converged"
    parts: list[Part] = [Line(_VERDICTS[result.verdict], "strong" if converged else "alarm")]
    if result.loops is not None:
        rows = [
            (str(output + 1), number(loop.gain), number(loop.integral_time))
            for output, loop in enumerate(result.loops)
        ]
        parts.append(Grid(("settings of output", "K", "Ti"), rows))
        together = "stable" if result.stable else "UNSTABLE"
        parts.append(Line(f"Together they are {together}.", "plain" if result.stable else "alarm"))
    steps = [("open", result.open_loops)]
    steps += [(f"round {index}", found) for index, found in enumerate(result.rounds, start=1)]
    experiments = [
        (
            name,
            f"u{each.input + 1}-y{each.output + 1}",
            each.behaviour.replace("_", " "),
            number(None if each.ultimate is None else each.ultimate.gain),
            number(None if each.ultimate is None else each.ultimate.omega),
            number(None if each.loop is None else each.loop.gain),
            number(None if each.loop is None else each.loop.integral_time),
        )
        for name, found in steps
        for each in found
    ]
    heads = ("step", "loop", "ended as", "Ku", "ωu", "K", "Ti")
    parts.append(Grid(heads, experiments, frozenset({0, 1, 2})))
    # Pairs that are not controlled need no settings.
    used = {(each.output, each.input) for found in result.rounds for each in found}
    remarks = [
        each.remark
        for _, found in steps
        for each in found
        if each.remark and not each.loop and (not used or (each.output, each.input) in used)
    ]
    if result.model is not None:
        parts.append(Line("A plant was identified: --json has it as a tuning request, in model."))
    return [*parts, *warning_lines(list(dict.fromkeys(remarks)))]


ANALYSIS = Analysis(
    name="relay_tuning",
    resource="relay-tunings",
    text=__doc__,
    outcome="The experiments and the settings.",
    request=RelayTuningRequest,
    result=RelayTuningResult,
    compute=compute,
    computes_with=("solver.relay.sequential", "solver.identification.relay_record"),
    table=table,
)
