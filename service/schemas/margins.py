"""Stability margins as JSON."""

from __future__ import annotations

from pydantic import Field, JsonValue

from service.schemas.fields import ResultModel
from service.schemas.peaks import Peak

__all__ = ["Bandwidths", "LoopMargins", "Margins"]

_MARGINS: JsonValue = {
    "gain_increase": 3.39,
    "gain_decrease": 0.0,
    "phase_margin": 63.5,
    "delay_margin": 2.39,
    "sensitivity": {"value": 1.53, "omega": 1.12},
    "complementary_sensitivity": {"value": 1.0, "omega": 1e-8},
    "bandwidth": 0.335,
    "crossover": 0.463,
}


class Margins(ResultModel):
    """Classical margins of one stable loop; null stands for infinite."""

    gain_increase: float | None = Field(
        description="Factor above 1 on the gain that makes the loop unstable; null: none up to "
        "1000 does.",
        examples=[3.39, None],
    )
    gain_decrease: float | None = Field(
        description="Factor below 1 on the gain that makes the loop unstable; 0: none does.",
        examples=[0.0],
    )
    phase_margin: float | None = Field(
        description="Smallest turn of the phase that makes the loop unstable, degrees; null: the "
        "gain never crosses 1.",
        examples=[63.5],
        json_schema_extra={"x-unit": "°"},
    )
    delay_margin: float | None = Field(
        description="Smallest additional dead time that makes the loop unstable; null: none does.",
        examples=[2.39],
        json_schema_extra={"x-unit": "time"},
    )
    sensitivity: Peak = Field(
        description="Ms, the peak of |1/(1+L)|.", examples=[{"value": 1.53, "omega": 1.12}]
    )
    complementary_sensitivity: Peak = Field(
        description="Mt, the peak of |L/(1+L)|.", examples=[{"value": 1.0, "omega": 1e-8}]
    )
    bandwidth: float | None = Field(
        description="Where |1/(1+L)| first reaches 0.707, rad per time unit; null: never. What "
        "this loop sees of itself; how fast the plant follows is in bandwidths.",
        examples=[0.335],
        json_schema_extra={"x-unit": "rad/time"},
    )
    crossover: float | None = Field(
        description="Highest frequency with |L| = 1, rad per time unit; 0: there is none.",
        examples=[0.463],
        json_schema_extra={"x-unit": "rad/time"},
    )


class LoopMargins(ResultModel):
    """Margins of the loops of `units`; null where that arrangement is unstable."""

    units: list[int] = Field(
        description="Units (from 0) whose loops are alike.", examples=[[0], [1, 2]]
    )
    alone: Margins | None = Field(description="All other loops open.", examples=[_MARGINS])
    together: Margins | None = Field(
        description="All other loops closed, this one broken at its controller's output.",
        examples=[_MARGINS],
    )
    alone_factor: float | None = Field(
        default=None,
        description="Where this loop is unstable alone: stable with its gain times this factor, "
        "and below; null: none was found, or it is stable.",
        examples=[None],
    )
    together_factor: float | None = Field(
        default=None,
        description="Where the loops are unstable together: stable with the gain of this one "
        "times this factor, and below, the others as they are; null: none was found (of at most "
        "4 different loops), or they are stable.",
        examples=[None],
    )


class Bandwidths(ResultModel):
    """Where sensitivities first reach 0.707 from below; null: never, 0: always above."""

    alone: float | None = Field(
        description="Of the slowest loop, each with all others open; null: one is unstable alone.",
        examples=[0.392],
        json_schema_extra={"x-unit": "rad/time"},
    )
    worst_direction: float | None = Field(
        description="Of the largest singular value of (I + G C)^-1, all loops closed: the "
        "direction that is followed slowest.",
        examples=[0.019],
        json_schema_extra={"x-unit": "rad/time"},
    )
    best_direction: float | None = Field(
        description="Of the smallest singular value: the direction that is followed fastest.",
        examples=[0.768],
        json_schema_extra={"x-unit": "rad/time"},
    )
