"""The greatest value of a curve, as JSON."""

from __future__ import annotations

from pydantic import Field

from service.schemas.fields import ResultModel

__all__ = ["Peak"]


class Peak(ResultModel):
    """Greatest value of a curve and where it is reached."""

    value: float | None = Field(description="Greatest value.", examples=[1.0])
    omega: float | None = Field(
        description="Frequency where it is reached, rad per time unit.",
        examples=[0.0314],
        json_schema_extra={"x-unit": "rad/time"},
    )
