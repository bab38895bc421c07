"""What figures show of an interaction analysis, as JSON."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.schemas.complex import Complex
from service.schemas.drawn import MAX_POINTS, Drawn, Frequencies, Traces, require_length

__all__ = ["DrawnInteraction", "DrawnParallelGains", "DrawnRelativeGains"]

ComplexSeries = Annotated[list[Complex], Field(max_length=MAX_POINTS)]


class DrawnRelativeGains(Drawn):
    """Relative gain array over frequency."""

    omega: Frequencies = Field(
        description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]]
    )
    relative_gains: list[list[list[Complex]]] | None = Field(
        description="The square array at each of them.", examples=[None]
    )

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        require_length(self.omega, relative_gains=self.relative_gains)
        for array in self.relative_gains or ():
            first = (self.relative_gains or [[]])[0]
            require_length(first, array=array)
            for row in array:
                require_length(first, row=row)
        return self


class DrawnParallelGains(Drawn):
    """Relative gains of identical units over the same frequencies."""

    own_relative_gains: ComplexSeries = Field(
        description="Of each unit's own input.", examples=[[{"re": 2.0, "im": 0.0}]]
    )
    other_relative_gains: ComplexSeries = Field(
        description="Of each other input.", examples=[[{"re": -1.0, "im": 0.0}]]
    )


class DrawnInteraction(Drawn):
    """Relative gains of a plant, at steady state and over frequency."""

    relative_gains: Traces | None = Field(
        description="Static relative gain array.", examples=[[[2.0, -1.0], [-1.0, 2.0]]]
    )
    curves: DrawnRelativeGains = Field(
        description="The array over frequency.",
        examples=[{"omega": [0.01, 0.1], "relative_gains": None}],
    )
    parallel: DrawnParallelGains | None = Field(
        default=None, description="Closed forms of identical units.", examples=[None]
    )

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        for row in self.relative_gains or ():
            require_length(self.relative_gains or (), row=row)
        if self.parallel is not None:
            require_length(
                self.curves.omega,
                own_relative_gains=self.parallel.own_relative_gains,
                other_relative_gains=self.parallel.other_relative_gains,
            )
        return self
