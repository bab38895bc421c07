"""What each loop sees, as JSON."""

from __future__ import annotations

from pydantic import BaseModel, Field

from service.schemas.complex import Complex
from service.schemas.fields import IdentifiedResult

__all__ = ["LoopResponsesResult", "RationalFunction", "SeenLoop"]

Numbers = list[float | None]


class RationalFunction(BaseModel):
    """num/den in descending powers of s, without common factors."""

    num: Numbers = Field(description="Numerator.", examples=[[1.0, 2.0, 0.2]])
    den: Numbers = Field(
        description="Denominator, its leading coefficient 1.", examples=[[1.0, 4.0, 6.8, 5.6, 1.8]]
    )


class SeenLoop(BaseModel):
    """What the loops of some units, which are alike, see."""

    units: list[int] = Field(description="The units, from 0.", examples=[[0]])
    static_open: float | None = Field(
        description="Static gain of the process, the other loops open; null: it integrates.",
        examples=[1.0],
    )
    static_closed: float | None = Field(
        description="The same, the other loops closed; null: not finite.", examples=[0.111]
    )
    function_open: RationalFunction | None = Field(
        description="The process, the other loops open; null: it has dead time.",
        examples=[{"num": [1.0], "den": [1.0, 2.0, 1.0]}],
    )
    function_closed: RationalFunction | None = Field(
        description="The process, the other loops closed; null: dead time, or more than 4 loops "
        "closed or order 30.",
        examples=[{"num": [1.0, 2.0, 0.2], "den": [1.0, 4.0, 6.8, 5.6, 1.8]}],
    )
    process_open: list[Complex] = Field(
        description="Its frequency response, the other loops open.",
        examples=[[{"re": 1.0, "im": 0.0}]],
    )
    process_closed: list[Complex] = Field(
        description="Its frequency response, the other loops closed.",
        examples=[[{"re": 0.11, "im": 0.0}]],
    )
    others_stable: bool = Field(
        description="Whether the other loops are stable by themselves; else the response with them "
        "closed is formal.",
        examples=[True],
    )
    controller: list[Complex] | None = Field(
        description="Frequency response of the loop's controller; null: open.",
        examples=[[{"re": 1.0, "im": -10.0}]],
    )
    sensitivity: Numbers | None = Field(
        description="|S| of the loop alone; null: open, or unstable alone.", examples=[[0.1]]
    )
    poles: list[Complex] | None = Field(
        default=None,
        description="Closed-loop poles of the loop alone; null: open, or dead time.",
        examples=[[{"re": -1.0, "im": 0.5}]],
    )
    damping: float | None = Field(
        default=None,
        description="Least damping of these poles; null: open, or dead time.",
        examples=[0.45],
    )


class LoopResponsesResult(IdentifiedResult):
    """What the loops of a plant see."""

    omega: list[float] = Field(
        description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]]
    )
    loops: list[SeenLoop] = Field(description="An entry for each different loop.", examples=[[]])
    stable: bool = Field(
        description="Whether all closed loops together are stable.", examples=[True]
    )
    sensitivity: Numbers | None = Field(
        description="Largest singular value of (I + G C)^-1 of the loops that are closed; null: "
        "unstable, or none is closed.",
        examples=[[0.1]],
    )
