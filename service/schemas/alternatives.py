"""What other kinds of controllers could do for a demand, as part of a result."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from service.schemas.complex import Complex
from service.schemas.controllers import Loop
from service.schemas.fields import ResultModel
from service.schemas.peaks import Guarantee

__all__ = ["Alternative", "Alternatives", "LowerBound"]


class LowerBound(ResultModel):
    """What no linear controller can pass."""

    value: float | None = Field(
        description="Of tau_p or mu; 0: nothing is known; null: nothing meets the demand.",
        examples=[0.62],
    )
    point: Complex | None = Field(
        description="Point of the right half plane that proves it.",
        examples=[{"re": 1.6, "im": 0.0}],
    )
    limitation: Literal["uncertainty", "dead_time", "right_half_plane_zero", "none"] = Field(
        description="What acts there.", examples=["uncertainty"]
    )


class OneInManual(ResultModel):
    """The worst unit to be put in manual, the rest of the controller going on without it."""

    unit: int = Field(description="Which one, from 0.", examples=[0])
    stable: bool = Field(description="Whether the others stay stable.", examples=[True])
    peak: float | None = Field(
        description="Peak of mu of the others, for the same demand; null: unstable.",
        examples=[1.33],
    )


class ScalarController(ResultModel):
    """A scalar controller inside of a structure."""

    acts_on: str = Field(description="What it acts on.", examples=["sum of all units"])
    gain: float = Field(
        description="Of k (1 + 1/(tau_I s)), times the structure's matrix.", examples=[46.3]
    )
    integral_time: float | None = Field(
        description="tau_I; null: gain/s times the inverse of the plant's dynamics.",
        examples=[33.1],
    )


class Alternative(ResultModel):
    """One kind of controller, made for the same demand under the same uncertainty."""

    family: Literal[
        "identical_pi", "unlike_pi", "unlike_pid", "unlike_pidf", "static_decoupling",
        "one_way_decoupling", "inverse", "mode_control", "pairs", "multivariable",
    ] = Field(description="Which kind.", examples=["mode_control"])  # fmt: skip
    title: str = Field(description="What it is called.", examples=["mode control"])
    value: float | None = Field(
        description="Its tau_p or mu; null: none was found that meets the demand.",
        examples=[13.76],
    )
    ratio: float | None = Field(
        description="Value over that of the best single loops.", examples=[0.75]
    )
    time_limit: bool = Field(
        description="Whether the time limit ended its search.", examples=[False]
    )
    states: int | None = Field(
        default=None,
        description="Of the multivariable controller that is built; null: another kind.",
        examples=[None],
    )
    manual: OneInManual | None = Field(
        description="What the worst unit in manual costs; null: one unit, or not computed.",
        examples=[{"unit": 0, "stable": True, "peak": 1.33}],
    )
    guarantee: Guarantee | None = Field(
        description="What is known of mu over all frequencies.",
        examples=[{"status": "proven", "level": 1.0001, "reason": None}],
    )
    loops: list[Loop] = Field(
        description="Settings of single loops, one entry a loop; else empty.", examples=[[]]
    )
    settings: list[ScalarController] = Field(
        description="Settings inside of a structure; else empty.", examples=[[]]
    )
    controller: dict[str, Any] | None = Field(
        description="The whole controller of a structure, as requests take it; null: single loops, "
        "or more than 20 units.",
        examples=[None],
    )


class Alternatives(ResultModel):
    """What other kinds of controllers could do."""

    status: Literal["found", "infeasible", "unlimited", "not_covered", "time_limit"] = Field(
        description="found; infeasible: no controller was found that meets the demand; unlimited: "
        "nothing in the model ends the bandwidth; not_covered: the limit is not found for such a "
        "plant, see verdict; time_limit: the time was over before, and what was found by then is "
        "there.",
        examples=["found"],
    )
    limit: float | None = Field(
        description="Least tau_p or mu found over all controllers of any order.", examples=[4.15]
    )
    lower_bound: LowerBound | None = Field(
        description="What no linear controller can pass.",
        examples=[{"value": 0.62, "point": {"re": 1.6, "im": 0.0}, "limitation": "uncertainty"}],
    )
    alternatives: list[Alternative] = Field(
        description="One entry for each kind of controller.", examples=[[]]
    )
    verdict: str = Field(
        description="All of it in words, a line for each kind of controller.",
        examples=["Single loops: τP = 18.446 (unlike PI)."],
    )
