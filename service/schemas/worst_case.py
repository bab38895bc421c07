"""The worst perturbation of a loop as JSON."""

from __future__ import annotations

from pydantic import Field, JsonValue

from service.schemas.complex import Complex
from service.schemas.fields import ResultModel

__all__ = ["WorstCase"]

_VALUE: JsonValue = {"re": 0.6, "im": -0.8}
_TRANSFER: JsonValue = {"num": [-15.9, 1.0], "den": [15.9, 1.0], "dead_time": 0.0}
_ENTRY: JsonValue = {"units": [0], "value": _VALUE, "transfer": _TRANSFER}


class StableSystem(ResultModel):
    """A stable rational transfer function num(s)/den(s), in the form of a request's."""

    num: list[float] = Field(
        description="Numerator coefficients in descending powers of s.", examples=[[-15.9, 1.0]]
    )
    den: list[float] = Field(
        description="Denominator coefficients in descending powers of s.", examples=[[15.9, 1.0]]
    )
    dead_time: float = Field(description="Always zero.", examples=[0.0])


class PerturbationEntry(ResultModel):
    """One number of a perturbation, and a stable real system that has it at omega."""

    units: list[int] = Field(description="Units (from 0) that share it.", examples=[[0]])
    value: Complex = Field(description="Its value at omega.", examples=[_VALUE])
    transfer: StableSystem = Field(
        description="All-pass of the same magnitude with this value at omega.",
        examples=[_TRANSFER],
    )


class InputPerturbation(ResultModel):
    """Delta_I: diagonal (entries, actuators) or of rank one (left times right transposed)."""

    entries: list[PerturbationEntry] | None = Field(
        default=None, description="Diagonal: delta of each unit.", examples=[[_ENTRY]]
    )
    actuators: list[StableSystem | None] | None = Field(
        default=None,
        description="Diagonal: 1 + w_I delta of each entry, ready to be the actuators of a step "
        "response; null where its order is too high.",
        examples=[[{"num": [1.0, 1.2], "den": [1.0, 1.0], "dead_time": 0.0}]],
    )
    left: list[PerturbationEntry] | None = Field(
        default=None, description="Rank one: the column.", examples=[None]
    )
    right: list[PerturbationEntry] | None = Field(
        default=None, description="Rank one: the row.", examples=[None]
    )


class OutputPerturbation(ResultModel):
    """Delta_O, diagonal."""

    entries: list[PerturbationEntry] = Field(
        description="delta of each unit's output.", examples=[[_ENTRY]]
    )
    actuators: list[StableSystem | None] = Field(
        description="1 + w_O delta of each entry, what multiplies that output; null where its "
        "order is too high.",
        examples=[[{"num": [1.0, 1.2], "den": [1.0, 1.0], "dead_time": 0.0}]],
    )


class PerformancePerturbation(ResultModel):
    """The full block that closes the loop over the performance: left times right transposed."""

    left: list[PerturbationEntry] = Field(description="The column.", examples=[[_ENTRY]])
    right: list[PerturbationEntry] = Field(description="The row.", examples=[[_ENTRY]])


class WorstCase(ResultModel):
    """The perturbation that attains the lower bound of the robust performance peak."""

    omega: float = Field(
        description="Frequency, rad per time unit.",
        examples=[0.0314],
        json_schema_extra={"x-unit": "rad/time"},
    )
    mu: float | None = Field(
        description="Lower bound of mu there; the perturbation has the size 1/mu.", examples=[1.0]
    )
    upper_bound: float | None = Field(description="Upper bound of mu there.", examples=[1.0])
    gap: float | None = Field(
        description="Relative distance of the two bounds; 0: this is mu.", examples=[0.0]
    )
    uncertainty: InputPerturbation = Field(
        description="Perturbation of the inputs.",
        examples=[{"entries": [_ENTRY], "actuators": [None]}],
    )
    performance: PerformancePerturbation = Field(
        description="Perturbation of the performance block.",
        examples=[{"left": [_ENTRY], "right": [_ENTRY]}],
    )
    outputs: OutputPerturbation | None = Field(
        default=None,
        description="Perturbation of the outputs; null where they are known.",
        examples=[{"entries": [_ENTRY], "actuators": [None]}],
    )
