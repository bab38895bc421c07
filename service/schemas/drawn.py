"""The parts of the analyses' results that figures show, as JSON.

A figure is asked for with the answer of an analysis as it came; only what is drawn is read and
checked, the rest is ignored.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

from service.schemas.robustness import Curves, Peak, Peaks

__all__ = [
    "DrawnInteraction",
    "DrawnRelayExperiment",
    "DrawnRobustness",
    "DrawnStepResponse",
    "DrawnUnits",
]

_MAX_POINTS = 20_001
_MAX_TRACES = 100

Series = Annotated[list[float | None], Field(max_length=_MAX_POINTS)]
Units = Annotated[list[int], Field(min_length=1)]
Matrix = Annotated[
    list[Annotated[list[float | None], Field(max_length=_MAX_TRACES)]],
    Field(max_length=_MAX_TRACES),
]


class DrawnRobustness(BaseModel):
    """Curves and peaks of mu; null where the loops are unstable."""

    peaks: Peaks | None = Field(description="Peaks of the three mu curves.", examples=[None])
    curves: Curves | None = Field(description="Upper bounds of mu.", examples=[None])
    lower_bound: Peak | None = Field(
        default=None, description="Lower bound of the robust performance peak.", examples=[None]
    )


class Complex(BaseModel):
    """A complex number; null where it does not exist."""

    re: float | None = Field(description="Real part.", examples=[1.0])
    im: float | None = Field(description="Imaginary part.", examples=[0.0])


class DrawnRelativeGains(BaseModel):
    """Relative gain array over frequency."""

    omega: Series = Field(description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]])
    relative_gains: list[list[list[Complex]]] | None = Field(
        description="The array at each of them.", examples=[None]
    )


class DrawnInteraction(BaseModel):
    """Relative gains of a plant, at steady state and over frequency."""

    relative_gains: Matrix | None = Field(
        description="Static relative gain array.", examples=[[[2.0, -1.0], [-1.0, 2.0]]]
    )
    curves: DrawnRelativeGains = Field(
        description="The array over frequency.",
        examples=[{"omega": [0.01, 0.1], "relative_gains": None}],
    )


class DrawnUnits(BaseModel):
    """Signals of units that move alike."""

    units: Units = Field(description="The units, from 0.", examples=[[0]])
    set_point: Series = Field(description="Set point.", examples=[[1.0, 1.0]])
    output: Series = Field(description="Output.", examples=[[0.0, 0.9]])
    input: Series = Field(description="Input.", examples=[[40.0, 1.2]])


class DrawnStepResponse(BaseModel):
    """Time responses."""

    time: Series = Field(description="Times.", examples=[[0.0, 10.0]])
    responses: Annotated[list[DrawnUnits], Field(max_length=_MAX_TRACES)] = Field(
        description="One entry for each kind of unit.", examples=[[]]
    )


class DrawnRelayExperiment(BaseModel):
    """Traces of a relay experiment."""

    time: Series = Field(description="Times.", examples=[[0.0, 1.0]])
    units: Annotated[list[Units], Field(max_length=_MAX_TRACES)] = Field(
        description="The units (from 0) of each row of outputs and inputs.", examples=[[[0], [1]]]
    )
    outputs: list[Series] = Field(description="Outputs.", examples=[[[0.0, 0.1], [0.0, 0.0]]])
    inputs: list[Series] = Field(description="Inputs.", examples=[[[1.0, -1.0], [0.0, 0.0]]])
    switchings: Series = Field(description="Times of the relay's switchings.", examples=[[0.33]])
