"""What the figure shows of decoupled loops, as JSON."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from service.schemas.complex import Complex
from service.schemas.drawn import Drawn, Frequencies, require_length

__all__ = ["DrawnClosedLoop", "DrawnDecoupling"]

Responses = list[list[list[Complex]]]


class DrawnClosedLoop(Drawn):
    """Frequency responses from set points to outputs."""

    omega: Frequencies = Field(
        description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]]
    )
    approximate: Responses = Field(
        description="H at each of them, square.", examples=[[[[{"re": 1.0, "im": 0.0}]]]]
    )
    exact: Responses = Field(
        description="H-bar at each of them, square.", examples=[[[[{"re": 1.0, "im": 0.0}]]]]
    )

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        require_length(self.omega, approximate=self.approximate, exact=self.exact)
        for array in (*self.approximate, *self.exact):
            require_length(self.exact[0], array=array)
            for row in array:
                require_length(self.exact[0], row=row)
        return self


class DrawnDecoupling(Drawn):
    """The decoupled loops together; null where one is unbounded."""

    closed_loop: DrawnClosedLoop | None = Field(description="The responses.", examples=[None])
