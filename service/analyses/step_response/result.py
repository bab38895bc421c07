"""Step responses and their measures as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, JsonValue

from service.schemas.fields import (
    IdentifiedResult,
)

__all__ = ["StepResponseResult"]

Series = list[float | None]


class SetPointMeasures(BaseModel):
    """Response of one output to its set-point change, up to the next step of any unit."""

    rise_time: float | None = Field(
        description="From 10 to 90 per cent of the change; null: 90 were not reached.",
        examples=[8.62],
        json_schema_extra={"x-unit": "time"},
    )
    settling_time: float | None = Field(
        description="Until the error stays within 2 per cent of the change; null: it did not.",
        examples=[78.1],
        json_schema_extra={"x-unit": "time"},
    )
    overshoot: float | None = Field(
        description="Largest excess over the set point, as a fraction of the change.",
        examples=[0.19],
    )


class EventMeasures(BaseModel):
    """Measures of a closed loop from one event on any unit to the next."""

    start: float = Field(
        description="The event.", examples=[0.0], json_schema_extra={"x-unit": "time"}
    )
    end: float = Field(
        description="The next one, or the end.",
        examples=[300.0],
        json_schema_extra={"x-unit": "time"},
    )
    change: float = Field(description="Of the loop's own set point; 0: none.", examples=[1.0])
    set_point: SetPointMeasures | None = Field(
        description="The response to that change; null: there is none.", examples=[None]
    )
    error_before: float | None = Field(
        description="Set point minus output right before the event.", examples=[0.0]
    )
    error_after: float | None = Field(description="The same right after it.", examples=[1.0])
    largest_error: float | None = Field(description="Largest |error| after it.", examples=[1.0])
    absolute_error: float | None = Field(description="Integral of |error|.", examples=[15.3])
    input_variation: float | None = Field(
        description="Total variation of the input, the jump at the event included.",
        examples=[114.4],
    )


_SET_POINT: JsonValue = {"rise_time": 8.62, "settling_time": 78.1, "overshoot": 0.19}


class Measures(BaseModel):
    """Measures of a unit's response, over all time unless said otherwise."""

    set_point: SetPointMeasures | None = Field(
        description="Of its first set-point change; null: there is none, or the loop is open.",
        examples=[_SET_POINT],
    )
    events: list[EventMeasures] = Field(
        description="From each event to the next, the first hundred; empty for an open loop.",
        examples=[[]],
    )
    absolute_error: float | None = Field(
        description="Integral of |error| (IAE); null for an open loop.", examples=[15.3]
    )
    squared_error: float | None = Field(
        description="Integral of the squared error (ISE); null for an open loop.", examples=[8.6]
    )
    largest_error: float | None = Field(
        description="Largest |error|; null for an open loop.", examples=[1.22]
    )
    input_variation: float | None = Field(
        description="Total variation of the input.", examples=[114.4]
    )


class UnitTraces(BaseModel):
    """Signals and measures of units that move alike."""

    units: list[int] = Field(description="The units, from 0.", examples=[[0]])
    set_point: Series = Field(description="Set point.", examples=[[1.0, 1.0]])
    output: Series = Field(description="Output.", examples=[[0.0, 0.9]])
    input: Series = Field(
        description="Input within its limits, before a perturbation.", examples=[[40.0, 1.2]]
    )
    metrics: Measures = Field(
        description="Rise, settling, overshoot, errors, variation.",
        examples=[
            {
                "set_point": _SET_POINT,
                "events": [],
                "absolute_error": 15.3,
                "squared_error": 8.6,
                "largest_error": 1.22,
                "input_variation": 114.4,
            }
        ],
    )


class LimitedResponses(BaseModel):
    """The responses with each input kept within the range of its valve."""

    end: Literal["complete", "bound", "step_limit"] = Field(
        description="As that of the whole.", examples=["complete"]
    )
    time: list[float] = Field(description="Times.", examples=[[0.0, 10.0]])
    responses: list[UnitTraces] = Field(
        description="One entry for each kind of unit.", examples=[[]]
    )


class StepResponseResult(IdentifiedResult):
    """Time responses, right up to the last time whatever ended them; samples are right-sided."""

    end: Literal["complete", "bound", "step_limit"] = Field(
        description="complete: the whole time was simulated. bound: an output exceeded its bound, "
        "as those of an unstable loop do. step_limit: too many steps; simulate less long, or "
        "leave out a tiny dead time.",
        examples=["complete"],
    )
    time: list[float] = Field(description="Times.", examples=[[0.0, 10.0]])
    responses: list[UnitTraces] = Field(
        description="One entry for each kind of unit: those with equal loops and steps move alike.",
        examples=[[]],
    )
    warnings: list[str] = Field(
        default=[],
        description="Inputs that move further than their valves can, where instruments give spans.",
        examples=[[]],
    )
    limited: LimitedResponses | None = Field(
        default=None,
        description="The same with each input within half its span to either side of rest, where "
        "instruments give spans, an input moves further, and the request has no limits.",
        examples=[None],
    )
