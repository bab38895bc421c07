"""What a demand costs, as JSON: the time constants reached over a range of one field."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from service.schemas.drawn import Drawn

__all__ = ["TradeOff", "TradeOffPoint"]

MAX_POINTS = 2000


class TradeOffPoint(Drawn):
    """What is reached at one value of the field; null where no settings meet the demand."""

    value: float = Field(description="Value of the field.", examples=[0.2])
    tau_p: float | None = Field(
        description="Closed-loop time constant of the best settings.", examples=[18.45]
    )
    identical: float | None = Field(
        default=None, description="That of the best identical settings.", examples=[25.77]
    )
    by: float | str | None = Field(
        default=None, description="Value of the second field that is varied.", examples=[None]
    )


class TradeOff(Drawn):
    """What is reached over a range of one field of a tuning."""

    parameter: Annotated[str, Field(max_length=200, pattern=r"^[^<>&\x00-\x1f]+$")] = Field(
        description="Name of the field, as `uncertainty.epsilon`.",
        examples=["uncertainty.epsilon"],
    )
    by: Annotated[str, Field(max_length=200, pattern=r"^[^<>&\x00-\x1f]+$")] | None = Field(
        default=None,
        description="Name of a second field that is varied: a curve for each of its values.",
        examples=[None],
    )
    points: Annotated[list[TradeOffPoint], Field(max_length=MAX_POINTS)] = Field(
        description="The points.",
        examples=[[{"value": 0.2, "tau_p": 18.45, "identical": 25.77}]],
    )
