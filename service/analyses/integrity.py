"""Analyse loops out of service.

Return stability and robustness with every set of loops in service, others in manual.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, Field, JsonValue

from service.analysis import Analysis
from service.printing import Grid, Line, Part
from service.schemas.encoding import encode
from service.schemas.fields import IdentifiedResult, ResultModel
from service.schemas.given_loops import EXAMPLE, GivenLoops, LoopsTask
from service.schemas.integral_controllability import IntegralControllability
from service.schemas.peaks import Guarantee, Peak
from service.wording import number
from solver.model.loop_names import loops_text

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["ANALYSIS", "IntegrityRequest", "IntegrityResult"]

_PEAK: JsonValue = {"value": 0.54, "omega": 0.97}
_GUARANTEE: JsonValue = {"status": "proven", "level": 0.840084, "reason": None}
_CLASS: JsonValue = {
    "in_service": [1, 0],
    "subsets": 1,
    "nominally_stable": True,
    "robust_stability": _PEAK,
    "robust_performance": {"value": 0.84, "omega": 1.2},
    "guarantee": _GUARANTEE,
}
_DETUNING: JsonValue = {
    "factors": [0.0, 0.25, 0.5, 0.75, 1.0],
    "by_group": False,
    "combinations": 24,
    "unstable": 0,
    "example": None,
}
_SUMMARY = (
    "loops out of service: of 3 sets of loops in service all stable, all robustly stable, "
    "1 with robust performance"
)


_CONTROLLABLE = {
    "guaranteed": "Of the plant alone: some other or smaller settings with integral action would "
    "be stable with any loops in manual and any gains reduced.",
    "impossible": "Of the plant alone: no settings with integral action are stable with any loops "
    "in manual and any gains reduced.",
    "undecided": "Of the plant alone: whether settings with integral action can be stable with any "
    "loops in manual and any gains reduced is not decided.",
}
_SHOWN = 15  # kinds of sets worth a line; all of them are in the JSON result


class IntegrityRequest(GivenLoops):
    """Ask what happens when loops are put in manual, or their gains are turned down."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> LoopsTask:
        """Return the arguments of the solver's analysis."""
        return self.parts()


class ServiceClass(ResultModel):
    """Sets of loops in service that symmetry makes equal."""

    in_service: list[int] = Field(
        description="How many loops of each group are in service; all others are in manual.",
        examples=[[1, 0]],
    )
    subsets: int = Field(
        description="How many sets of loops this stands for; exact, possibly above 2^53.",
        examples=[1],
    )
    nominally_stable: bool = Field(
        description="Whether the loops in service are stable.", examples=[True]
    )
    robust_stability: Peak | None = Field(
        description="Peak of mu for their robust stability; null where they are unstable.",
        examples=[_PEAK],
    )
    robust_performance: Peak | None = Field(
        description="Peak of mu for their robust performance; null where they are unstable.",
        examples=[_PEAK],
    )
    guarantee: Guarantee | None = Field(
        default=None,
        description="What is proven of that peak over all frequencies; null where they are "
        "unstable.",
        examples=[_GUARANTEE],
    )


class ReducedGains(ResultModel):
    """Nominal stability with gains times any factors from `least` to 1."""

    proven: bool = Field(
        description="Whether no combination of factors is unstable, at every frequency looked at.",
        examples=[True],
    )
    least: float = Field(description="Lower end of the factors.", examples=[1e-4])
    frequencies: int = Field(description="How many frequencies were looked at.", examples=[567])
    boxes: int = Field(description="Boxes of factors that it took.", examples=[5])


class Detuning(ResultModel):
    """Nominal stability with gains reduced independently, on a grid of factors and between."""

    factors: list[float] = Field(
        description="Factors tried on each gain; 0 is a loop in manual.",
        examples=[[0.0, 0.25, 0.5, 0.75, 1.0]],
    )
    by_group: bool = Field(
        description="Whether the loops of a group were reduced alike, there being too many "
        "combinations.",
        examples=[False],
    )
    combinations: int = Field(
        description="Combinations tried, interchangeable ones once.", examples=[24]
    )
    unstable: int = Field(description="Combinations that are unstable.", examples=[0])
    example: list[float] | None = Field(
        description="Factor of each unit in one of them.", examples=[None]
    )
    between: ReducedGains | None = Field(
        default=None,
        description="What holds for all factors; null: more than 5 loops, one without integral "
        "action, or a combination is unstable.",
        examples=[{"proven": True, "least": 1e-4, "frequencies": 567, "boxes": 5}],
    )


class IntegrityResult(IdentifiedResult, ResultModel):
    """What happens with loops out of service."""

    stable: bool = Field(
        description="Whether the loops stay stable whichever of them are in manual.",
        examples=[True],
    )
    summary: str = Field(description="The result in one line.", examples=[_SUMMARY])
    groups: list[list[int]] = Field(
        description="Units (from 0) whose loops are interchangeable.", examples=[[[0], [1]]]
    )
    classes: list[ServiceClass] = Field(
        description="All kinds of sets of loops in service, those with the most loops first.",
        examples=[[_CLASS]],
    )
    detuning: Detuning | None = Field(
        description="Reduced gains; null where even the coarsest grid is too large.",
        examples=[_DETUNING],
    )
    controllability: IntegralControllability | None = Field(
        description="Conditions on the plant for any controllers; null for an integrating plant.",
        examples=[None],
    )


def compute(request: IntegrityRequest) -> dict[str, Any]:
    """Return the integrity of the request's loops."""
    from solver.robustness.integrity import integrity

    task = request.build()
    found = integrity(task.plant, task.uncertainty, task.performance, task.loops)
    document: dict[str, Any] = encode(found)
    return {"stable": found.stable, "summary": found.summary, **document}


def table(result: IntegrityResult) -> list[Part]:
    """Return the kinds of sets of loops in service, and what detuning does."""
    heads = [
        *(f"in auto: {loops_text(group)}" for group in result.groups),
        "sets",
        "stable",
        "robust stability",
        "robust performance",
    ]
    rows = [
        (
            *map(str, kind.in_service),
            f"{kind.subsets:,}" if kind.subsets < 10**9 else f"{float(kind.subsets):.2g}",
            "yes" if kind.nominally_stable else "no",
            _peak(kind.robust_stability),
            _peak(kind.robust_performance),
        )
        for kind in result.classes[:_SHOWN]
    ]
    parts: list[Part] = [
        Line(result.summary.capitalize() + ".", "strong" if result.stable else "alarm"),
        Grid(heads, rows, frozenset()),
    ]
    hidden = len(result.classes) - _SHOWN
    if hidden > 0:
        parts.append(Line(f"{hidden} more kinds of sets are in the JSON result (--json)."))
    parts += [Line(text) for text in _proven(result.classes)]
    if result.detuning is not None:
        parts.append(Line(_detuned(result.detuning)))
        parts += [Line(text) for text in _between(result)]
    if result.controllability is not None:
        verdict = result.controllability.verdict
        parts.append(Line(_CONTROLLABLE[verdict]))
    return parts


def _proven(classes: Sequence[ServiceClass]) -> list[str]:
    """Say of how many kinds the peaks are proven over all frequencies, and why not of others."""
    known = [kind.guarantee for kind in classes if kind.guarantee is not None]
    if not known:
        return []
    proven = sum(guarantee.status == "proven" for guarantee in known)
    if proven == len(known):
        return ["Proven: no frequency exceeds these peaks by more than 0.01 %."]
    reason = next(guarantee.reason for guarantee in known if guarantee.status != "proven")
    return [f"Proven over all frequencies: {proven} of {len(known)} kinds; else {reason}."]


def _between(result: IntegrityResult) -> list[str]:
    """Say what holds for all factors, and what of those next to zero."""
    between = None if result.detuning is None else result.detuning.between
    if between is None:
        return []
    if not between.proven:
        return ["For factors between these nothing is proven."]
    limit = (
        "Towards zero the plant's integral controllability says that they stay so."
        if result.controllability is not None and result.controllability.verdict == "guaranteed"
        else "Of smaller factors nothing is proven but a loop in manual."
    )
    text = (
        f"Stable with gains times any factors from {between.least:g} to 1, independently: no point "
        f"of that box is on the limit at any of {between.frequencies} frequencies. {limit}"
    )
    return [text]


def _peak(peak: Peak | None) -> str:
    return number(None if peak is None else peak.value)


def _detuned(detuning: Detuning) -> str:
    factors = ", ".join(f"{factor:g}" for factor in detuning.factors)
    alike = ", the loops of a group alike" if detuning.by_group else ""
    found = "none" if detuning.unstable == 0 else str(detuning.unstable)
    text = (
        f"Gains times {factors}{alike}: of {detuning.combinations} combinations {found} unstable."
    )
    if detuning.example is not None:
        text += f" One is ({', '.join(f'{factor:g}' for factor in detuning.example)})."
    return text


ANALYSIS = Analysis(
    name="integrity",
    resource="integrity",
    text=__doc__,
    outcome="The analysis.",
    request=IntegrityRequest,
    result=IntegrityResult,
    compute=compute,
    computes_with=("solver.robustness.integrity",),
    table=table,
)
