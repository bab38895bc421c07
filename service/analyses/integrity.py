"""Loops out of service as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, Field, JsonValue

from service.analyses.interaction.models import IntegralControllability
from service.schemas.encoding import encode
from service.schemas.fields import ResultModel
from service.schemas.given_loops import EXAMPLE, GivenLoops, LoopsTask
from service.schemas.peaks import Peak

if TYPE_CHECKING:
    from solver.robustness.integrity import Integrity

__all__ = ["IntegrityRequest", "IntegrityResult", "integrity_to_json"]

_PEAK: JsonValue = {"value": 0.54, "omega": 0.97}
_CLASS: JsonValue = {
    "in_service": [1, 0],
    "subsets": 1,
    "nominally_stable": True,
    "robust_stability": _PEAK,
    "robust_performance": {"value": 0.84, "omega": 1.2},
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


class IntegrityRequest(GivenLoops):
    """Ask what happens when loops are put in manual, or their gains are turned down."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> LoopsTask:
        """Return the arguments of the solver's analysis.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """
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


class Detuning(ResultModel):
    """Nominal stability with gains reduced independently, on a grid of factors."""

    factors: list[float] = Field(
        description="Factors tried on each gain; 0 is a loop in manual. A grid: nothing is proven "
        "between them.",
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


class IntegrityResult(ResultModel):
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


def integrity_to_json(integrity: Integrity) -> dict[str, Any]:
    """Return the result as the JSON object that `IntegrityResult` describes."""
    document: dict[str, Any] = encode(integrity)
    return {"stable": integrity.stable, "summary": integrity.summary, **document}
