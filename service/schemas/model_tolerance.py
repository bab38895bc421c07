"""How wrong the parameters of a model may be, as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.schemas.fields import ResultModel

__all__ = ["ModelTolerance"]


class ModelTolerance(ResultModel):
    """Relative errors of one parameter of the model, alone, at which demand or stability is lost.

    Down and up; null where none is up to five times the value, or down to minus three times of
    gains and interaction, a hundredth of time constants, no dead time.
    """

    parameter: Literal["gain", "time_constant", "dead_time", "interaction"] = Field(
        description="What is wrong.", examples=["interaction"]
    )
    element: list[int] | None = Field(
        description="Row and column, from 0, of a matrix plant's element; null: all together.",
        examples=[None],
    )
    demand: list[float | None] | None = Field(
        description="Where the demand on the sensitivity is lost, actuators exact; null where it "
        "is not met at all.",
        examples=[[-2.0, 0.011]],
    )
    stability: list[float | None] = Field(
        description="Where nominal stability is lost.", examples=[[-2.04, 0.054]]
    )
