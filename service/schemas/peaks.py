"""Curves of mu over frequency and their greatest values, as JSON."""

from __future__ import annotations

from pydantic import Field

from service.schemas.fields import ResultModel

__all__ = ["PEAK_EXAMPLE", "Curves", "Peak", "Peaks"]


class Peak(ResultModel):
    """Greatest value of a curve and where it is reached."""

    value: float | None = Field(description="Greatest value.", examples=[1.0])
    omega: float | None = Field(
        description="Frequency where it is reached, rad per time unit.",
        examples=[0.0314],
        json_schema_extra={"x-unit": "rad/time"},
    )


PEAK_EXAMPLE = {"value": 1.0, "omega": 0.0314}


class Peaks(ResultModel):
    """Peaks of the three mu curves, refined between grid points."""

    robust_performance: Peak = Field(
        description="Performance for every plant in the set: wanted at most 1.",
        examples=[PEAK_EXAMPLE],
    )
    robust_stability: Peak = Field(
        description="Stability for every plant in the set: needed at most 1.",
        examples=[PEAK_EXAMPLE],
    )
    nominal_performance: Peak = Field(
        description="Performance of the nominal plant.", examples=[PEAK_EXAMPLE]
    )


Values = list[float | None]


class Curves(ResultModel):
    """Upper bounds of mu over frequency."""

    omega: list[float] = Field(
        description="Frequencies, rad per time unit, ascending.", examples=[[0.01, 0.1]]
    )
    robust_performance: Values = Field(
        description="Bound for robust performance.", examples=[[0.8, 0.9]]
    )
    robust_stability: Values = Field(
        description="Bound for robust stability.", examples=[[0.2, 0.3]]
    )
    nominal_performance: Values = Field(
        description="Largest singular value of w_P S.", examples=[[0.5, 0.6]]
    )
