"""What the figure shows of a relay experiment, as JSON."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.schemas.complex import Complex
from service.schemas.drawn import (
    MAX_POINTS,
    MAX_TRACES,
    Drawn,
    Series,
    Traces,
    Units,
    require_length,
)

__all__ = ["DrawnRelayExperiment", "DrawnRelayTheory"]


class DrawnRelayTheory(Drawn):
    """The Nyquist curve and the describing function of the relay."""

    response: Annotated[list[Complex], Field(max_length=MAX_POINTS)] = Field(
        default=[], description="Nyquist curve.", examples=[[{"re": -0.05, "im": -0.01}]]
    )
    describing_level: float | None = Field(
        default=None, description="Imaginary part of -1/N(a).", examples=[-0.00785]
    )


class DrawnRelayExperiment(Drawn):
    """Traces of a relay experiment."""

    time: Series = Field(description="Times.", examples=[[0.0, 1.0]])
    units: Annotated[list[Units], Field(max_length=MAX_TRACES)] = Field(
        description="The units (from 0) of each row of outputs and inputs.", examples=[[[0], [1]]]
    )
    outputs: Traces = Field(description="Outputs.", examples=[[[0.0, 0.1], [0.0, 0.0]]])
    inputs: Traces = Field(description="Inputs.", examples=[[[1.0, -1.0], [0.0, 0.0]]])
    switchings: Series = Field(description="Times of the relay's switchings.", examples=[[0.33]])
    theory: DrawnRelayTheory = Field(
        default=DrawnRelayTheory(), description="What theory says.", examples=[{}]
    )

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        require_length(self.units, outputs=self.outputs, inputs=self.inputs)
        for row in (*self.outputs, *self.inputs):
            require_length(self.time, row=row)
        return self
