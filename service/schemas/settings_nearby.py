"""What a tuning tells of settings beside its own, as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.schemas.fields import ResultModel
from service.schemas.margins import LoopMargins
from service.schemas.peaks import PEAK_EXAMPLE, Peaks

__all__ = ["AsFound", "PriceOfResolution", "SettingMove", "SettingRange", "SettingsTolerance"]

ParameterName = Literal["gain", "integral_time", "derivative_time", "filter_time"]
_CURVES = ("robust_performance", "robust_stability", "nominal_performance")
_RANGE = {
    "group": 0,
    "parameter": "gain",
    "value": 47.66,
    "low": 45.38,
    "high": 47.68,
}
_MOVE = {"group": 0, "parameter": "gain", "change": 0.0004}


class AsFound(ResultModel):
    """What today's settings do, judged as those that were found."""

    tau_p: float | None = Field(
        description="Least tau_p for which they keep the demand; null: there is none, see reason.",
        examples=[26.0],
        json_schema_extra={"x-unit": "time"},
    )
    peaks: Peaks | None = Field(
        description="Peaks of mu under the demand of the result, its tau_p included; null: the "
        "loops are unstable, or mu has no bound.",
        examples=[dict.fromkeys(_CURVES, PEAK_EXAMPLE)],
    )
    nominally_stable: bool = Field(description="Whether they stabilise the model.", examples=[True])
    margins: list[LoopMargins] = Field(
        description="Stability margins, an entry for each different loop.", examples=[[]]
    )
    reason: str | None = Field(default=None, description="Why they have no tau_p.", examples=[None])
    active: str | None = Field(
        default=None,
        description="With scenarios, or a spread: the one that decides, to which tau_p, peaks and "
        "reason belong.",
        examples=["winter"],
    )


class PriceOfResolution(ResultModel):
    """What it costs that the settings are numbers which the control system accepts."""

    tau_p_exact: float = Field(
        description="tau_p of the best settings of any digits.",
        examples=[18.446],
        json_schema_extra={"x-unit": "time"},
    )
    tau_p_rounded: float = Field(
        description="tau_p of the settings as they are typed in.",
        examples=[18.453],
        json_schema_extra={"x-unit": "time"},
    )
    mu_exact: float = Field(
        description="Peak of mu of the best settings of any digits.", examples=[1.0]
    )
    mu_rounded: float = Field(
        description="Peak of mu of the settings as they are typed in.", examples=[1.0]
    )


class SettingRange(ResultModel):
    """How far one setting may be moved while all others stay."""

    group: int = Field(description="Group of loops, from 0, as in groups.", examples=[0])
    parameter: ParameterName = Field(description="Which setting.", examples=["gain"])
    value: float = Field(description="Where it is.", examples=[47.66])
    low: float | None = Field(
        description="How low it may go; null: to a tenth at least.", examples=[45.38]
    )
    high: float | None = Field(
        description="How high it may go; null: to ten times as much at least.", examples=[47.68]
    )


class SettingMove(ResultModel):
    """One setting in a joint move."""

    group: int = Field(description="Group of loops, from 0, as in groups.", examples=[0])
    parameter: ParameterName = Field(description="Which setting.", examples=["gain"])
    change: float = Field(description="Relative change; -0.03 is 3 % less.", examples=[0.0004])


class SettingsTolerance(ResultModel):
    """How far the settings may be moved before mu exceeds `mu` at `tau_p`."""

    tau_p: float = Field(
        description="Time constant of the demand: 5 % above that of the result, for the objective "
        "tau_p.",
        examples=[19.37],
        json_schema_extra={"x-unit": "time"},
    )
    mu: float = Field(
        description="Level of mu: 1; for the objective mu, 5 % above the peak where that is more.",
        examples=[1.0],
    )
    alone: list[SettingRange] = Field(
        description="Each setting, all others staying.", examples=[[_RANGE]]
    )
    together: list[SettingMove] = Field(
        description="The smallest joint change found that exceeds the level; empty: none nearby.",
        examples=[[_MOVE]],
    )
    lower_gains: float | None = Field(
        description="Peak of mu at the tau_p of the result with all gains 5 % lower; null: "
        "unstable.",
        examples=[1.042],
    )
