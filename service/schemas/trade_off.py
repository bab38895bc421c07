"""What a demand costs, as JSON: the time constants reached over a range of one parameter."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from service.schemas.drawn import Drawn

__all__ = ["Parameter", "TradeOff", "TradeOffPoint"]

Parameter = Literal["epsilon", "max_peak"]
MAX_POINTS = 200


class TradeOffPoint(Drawn):
    """What is reached at one value of the parameter; null where no settings meet the demand."""

    value: float = Field(description="Value of the parameter.", examples=[0.2])
    tau_p: float | None = Field(
        description="Closed-loop time constant of the best settings.", examples=[18.45]
    )
    identical: float | None = Field(
        default=None, description="That of the best identical settings.", examples=[25.77]
    )


class TradeOff(Drawn):
    """What is reached over a range of one parameter."""

    parameter: Parameter = Field(
        description="epsilon: the inputs' relative error; max_peak: the permitted peak of the "
        "sensitivity.",
        examples=["epsilon"],
    )
    points: Annotated[list[TradeOffPoint], Field(max_length=MAX_POINTS)] = Field(
        description="The points, in the order of their values.",
        examples=[[{"value": 0.2, "tau_p": 18.45, "identical": 25.77}]],
    )
