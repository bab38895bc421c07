"""The loop sheet of a tuning as JSON: how the loops behave, and what can go wrong."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.schemas.fields import ResultModel
from service.schemas.figures import FiguresResult

__all__ = ["Behaviour", "Risk", "SheetResult", "Topic"]

Topic = Literal[
    "demand", "manual", "speed", "stability", "model", "saturation", "settings", "identical", "note"
]


class Behaviour(ResultModel):
    """One loop with one set of settings, all loops closed; null: it does not settle, or none."""

    loop: str = Field(description="Tag or number.", examples=["TIC-101"])
    settings: str = Field(description="Whose settings these are.", examples=["found", "as found"])
    stable: bool = Field(description="Whether the loops are stable.", examples=[True])
    set_point_step: float = Field(
        description="Size of the set-point step, in output units.", examples=[1.0]
    )
    settling_time: float | None = Field(
        description="After it, until within 2 per cent of it.",
        examples=[58.9],
        json_schema_extra={"x-unit": "time"},
    )
    overshoot: float | None = Field(description="Over it, as a fraction of it.", examples=[0.1])
    input_peak: float | None = Field(
        description="Largest movement of the input after it, in input units.", examples=[36.1]
    )
    load_step: float = Field(description="Size of the load, in input units.", examples=[1.0])
    load_error: float | None = Field(
        description="Largest error after the load, in output units.", examples=[0.0125]
    )
    load_settling_time: float | None = Field(
        description="Until the error is within 5 per cent of that.",
        examples=[22.9],
        json_schema_extra={"x-unit": "time"},
    )
    gain_margin: float | None = Field(
        description="Factor on this loop's gain that makes all unstable; null: none does.",
        examples=[3.39],
    )
    phase_margin: float | None = Field(
        description="Turn of its phase that does; null: none.",
        examples=[63.5],
        json_schema_extra={"x-unit": "°"},
    )
    delay_margin: float | None = Field(
        description="Additional dead time that does; null: none.",
        examples=[2.39],
        json_schema_extra={"x-unit": "time"},
    )


class Risk(ResultModel):
    """One thing that is worth knowing before the settings are typed in."""

    topic: Topic = Field(description="What it is about.", examples=["manual"])
    level: Literal["good", "note", "warning", "bad"] = Field(
        description="good: nothing to do; bad: do not use the settings before it is understood.",
        examples=["warning"],
    )
    text: str = Field(
        description="The thing in a sentence or two.",
        examples=["With loop 1 in manual the other loops stay stable for every plant of the set."],
    )


class SheetResult(ResultModel):
    """How the loops of a tuning behave, and what can go wrong with them."""

    behaviour: list[Behaviour] = Field(
        description="A row for each kind of loop and set of settings.", examples=[[]]
    )
    risks: list[Risk] = Field(description="The most serious first.", examples=[[]])
    figures: FiguresResult = Field(
        description="Responses to set point and load.",
        examples=[{"templates": {"light": {}, "dark": {}}, "figures": {}, "omitted": {}}],
    )
