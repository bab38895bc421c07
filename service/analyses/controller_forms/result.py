"""Controllers in their forms, and the values to type."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from service.schemas.controllers import IdealForm, Loop, ParallelForm
from service.schemas.fields import (
    IdentifiedResult,
)
from service.schemas.peaks import Guarantee, Peaks

__all__ = ["ControllerFormsResult", "HandOverResult"]


class ControllerForms(BaseModel):
    """One controller in its three forms: the same transfer function, filter included."""

    cascade: Loop = Field(
        description="Cascade form.",
        examples=[{"gain": 46.3, "integral_time": 101.0, "derivative_time": None}],
    )
    ideal: IdealForm | None = Field(
        description="Ideal form; null where none exists, see reason.",
        examples=[
            {"gain": 46.3, "integral_time": 101.0, "derivative_time": 0.0, "filter_time": 0.0}
        ],
    )
    parallel: ParallelForm | None = Field(
        description="Parallel form; null where none exists, see reason.",
        examples=[
            {
                "proportional_gain": 46.3,
                "integral_gain": 0.458,
                "derivative_gain": 0.0,
                "filter_time": 0.0,
            }
        ],
    )
    reason: str | None = Field(description="Why a form does not exist.", examples=[None])


class TypedValue(BaseModel):
    """One value to type."""

    setting: Literal["gain", "integral", "derivative", "filter"] = Field(
        description="Which setting.", examples=["integral"]
    )
    name: str = Field(description="What the system calls it.", examples=["RESET"])
    value: float | None = Field(
        description="What is typed; null: this action is off.", examples=[6060.0]
    )
    unit: str = Field(description="Its unit; empty for a pure number.", examples=["s"])


class TypedLoop(BaseModel):
    """What is typed for one loop."""

    tag: str | None = Field(description="Name of the loop.", examples=["TIC-101"])
    action: Literal["direct", "reverse"] = Field(
        description="reverse: the output falls when the measurement rises.", examples=["reverse"]
    )
    values: list[TypedValue] = Field(
        description="Values to type, rounded; empty where there are none, see reason.",
        examples=[[{"setting": "gain", "name": "GAIN", "value": 46.3, "unit": "%/%"}]],
    )
    loop: Loop | None = Field(
        description="What the typed values make, in cascade form and the units of the request.",
        examples=[{"gain": 46.3, "integral_time": 101.0}],
    )
    notes: list[str] = Field(description="What is not as it was asked.", examples=[[]])
    reason: str | None = Field(
        description="Why this system has no such controller.", examples=[None]
    )


class HandOverResult(BaseModel):
    """What is typed into a control system, and what that achieves."""

    controller: str | None = Field(
        description="The control system, where it is a known one.",
        examples=["Emerson DeltaV, PID block, FORM Standard"],
    )
    equation: str = Field(
        description="Its law, from the deviation to the output, both in per cent of span.",
        examples=["GAIN*(1 + 1/(RESET*s) + RATE*s/(1 + ALPHA*RATE*s))"],
    )
    time_unit: str = Field(description="Unit of typed times.", examples=["s"])
    filter_rule: str | None = Field(
        description="How the system filters the derivative.", examples=[None]
    )
    source: str | None = Field(description="Where its law is published.", examples=[None])
    loops: list[TypedLoop] = Field(description="One entry a loop.", examples=[[]])
    notes: list[str] = Field(description="What else has to be known or set.", examples=[[]])
    nominally_stable: bool | None = Field(
        description="Whether the loops with the typed values are stable; null without a plant.",
        examples=[True],
    )
    peaks: Peaks | None = Field(
        description="Peaks of mu with the typed values; null without a plant, or unstable.",
        examples=[None],
    )
    guarantee: Guarantee | None = Field(
        description="What is proven of them over all frequencies.", examples=[None]
    )
    demand_met: bool | None = Field(
        description="Whether the typed values meet the demand; null without a plant.",
        examples=[True],
    )


class ControllerFormsResult(IdentifiedResult):
    """Controllers in their forms."""

    forms: list[ControllerForms] = Field(
        description="One entry a controller, in the order given.", examples=[[]]
    )
    hand_over: HandOverResult | None = Field(
        default=None, description="What is typed; null without a target.", examples=[None]
    )
