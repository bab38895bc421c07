"""Curves of mu over frequency and their greatest values, as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.schemas.fields import ResultModel

__all__ = [
    "CURVES_EXAMPLE",
    "PEAK_EXAMPLE",
    "Curves",
    "Guarantee",
    "MarginsGuarantee",
    "Peak",
    "Peaks",
]


class Peak(ResultModel):
    """Greatest value of a curve and where it is reached."""

    value: float | None = Field(description="Greatest value.", examples=[1.0])
    omega: float | None = Field(
        description="Frequency where it is reached, rad per time unit.",
        examples=[0.0314],
        json_schema_extra={"x-unit": "rad/time"},
    )


PEAK_EXAMPLE = {"value": 1.0, "omega": 0.0314}
CURVES_EXAMPLE = {
    "omega": [0.03],
    "robust_performance": [1.0],
    "robust_stability": [0.4],
    "nominal_performance": [0.9],
}


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


class Guarantee(ResultModel):
    """What is known of mu of robust performance over all frequencies."""

    status: Literal["proven", "open"] = Field(
        description="proven: the loops are nominally stable and mu is at most `level` at every "
        "frequency, rounding included; open: no proof was found.",
        examples=["proven"],
    )
    level: float | None = Field(
        description="Level of mu, 1.0001 times the peak that was found.", examples=[1.0001]
    )
    reason: str | None = Field(description="Why it is open; else null.", examples=[None])


class MarginsGuarantee(ResultModel):
    """What is known of Ms, Mt and the bandwidths over all frequencies."""

    status: Literal["proven", "open"] = Field(
        description="proven: no frequency exceeds Ms or Mt of a loop, alone or with the others "
        "closed, and no curve reaches 0.707 before its bandwidth, by more than `within`, rounding "
        "included; open: of some there is no proof.",
        examples=["proven"],
    )
    within: float = Field(description="Relative amount.", examples=[1e-4])
    reason: str | None = Field(description="Why it is open; else null.", examples=[None])


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
