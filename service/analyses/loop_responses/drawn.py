"""What figures show of what loops see, as JSON."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.schemas.complex import Complex
from service.schemas.drawn import (
    MAX_POINTS,
    MAX_TRACES,
    Drawn,
    Frequencies,
    Series,
    Units,
    require_length,
)

__all__ = ["DrawnLoopResponses", "DrawnSeenLoop"]

ComplexSeries = Annotated[list[Complex], Field(max_length=MAX_POINTS)]


class DrawnSeenLoop(Drawn):
    """What a loop sees."""

    units: Units = Field(description="The units, from 0.", examples=[[0]])
    process_open: ComplexSeries = Field(
        description="The process, other loops open.", examples=[[{"re": 1.0, "im": 0.0}]]
    )
    process_closed: ComplexSeries = Field(
        description="The process, other loops closed.", examples=[[{"re": 1.0, "im": 0.0}]]
    )
    sensitivity: Series | None = Field(
        default=None, description="|S| of the loop alone.", examples=[[0.1]]
    )


class DrawnLoopResponses(Drawn):
    """What the loops of a plant see, over frequency."""

    omega: Frequencies = Field(
        description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]]
    )
    loops: Annotated[list[DrawnSeenLoop], Field(max_length=MAX_TRACES)] = Field(
        description="The loops.", examples=[[]]
    )
    sensitivity: Series | None = Field(
        default=None, description="Largest singular value of S, all closed.", examples=[[0.1]]
    )

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        require_length(self.omega, sensitivity=self.sensitivity)
        for loop in self.loops:
            require_length(
                self.omega,
                process_open=loop.process_open,
                process_closed=loop.process_closed,
                sensitivity=loop.sensitivity,
            )
        return self
