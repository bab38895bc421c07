"""The parts of the analyses' results that figures show, as JSON.

A figure is asked for with the result of an analysis as it came; only what is drawn is read and
checked, the rest is ignored.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from service.schemas.complex import Complex
from service.schemas.encoding import encode
from service.schemas.fields import Frequency
from service.schemas.peaks import Curves, Peak, Peaks

__all__ = [
    "Complex",
    "Drawn",
    "DrawnClosedLoop",
    "DrawnCurves",
    "DrawnDecoupling",
    "DrawnDriveResponse",
    "DrawnDriveSimulation",
    "DrawnInteraction",
    "DrawnParallelDrives",
    "DrawnRelayExperiment",
    "DrawnRobustness",
    "DrawnStepResponse",
    "DrawnUnits",
]

_MAX_POINTS = 20_001
_MAX_TRACES = 100

Series = Annotated[list[float | None], Field(max_length=_MAX_POINTS)]
Frequencies = Annotated[list[Frequency], Field(max_length=_MAX_POINTS)]
Units = Annotated[list[int], Field(min_length=1)]
Traces = Annotated[list[Series], Field(max_length=_MAX_TRACES)]


class Drawn(BaseModel):
    """Base of what is drawn: unknown fields are passed over, the known ones must be right."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)

    @classmethod
    def of(cls, record: object) -> Self:
        """Return what is drawn of a record of the solver."""
        return cls.model_validate(encode(record))


def _require_length(wanted: Sequence[Any], **series: Sequence[Any] | None) -> None:
    for name, values in series.items():
        if values is not None and len(values) != len(wanted):
            message = f"{name} has {len(values)} entries, {len(wanted)} are needed"
            raise ValueError(message)


class DrawnCurves(Curves, Drawn):
    """Upper bounds of mu over frequency, all of one length."""

    omega: Frequencies = Field(
        description="Frequencies, rad per time unit, ascending.", examples=[[0.01, 0.1]]
    )

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        _require_length(
            self.omega,
            robust_performance=self.robust_performance,
            robust_stability=self.robust_stability,
            nominal_performance=self.nominal_performance,
        )
        return self


class DrawnRobustness(Drawn):
    """Curves and peaks of mu; null where the loops are unstable."""

    peaks: Peaks | None = Field(description="Peaks of the three mu curves.", examples=[None])
    curves: DrawnCurves | None = Field(description="Upper bounds of mu.", examples=[None])
    lower_bound: Peak | None = Field(
        default=None, description="Lower bound of the robust performance peak.", examples=[None]
    )


ComplexSeries = Annotated[list[Complex], Field(max_length=_MAX_POINTS)]


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
        _require_length(self.omega, relative_gains=self.relative_gains)
        for array in self.relative_gains or ():
            first = (self.relative_gains or [[]])[0]
            _require_length(first, array=array)
            for row in array:
                _require_length(first, row=row)
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
            _require_length(self.relative_gains or (), row=row)
        if self.parallel is not None:
            _require_length(
                self.curves.omega,
                own_relative_gains=self.parallel.own_relative_gains,
                other_relative_gains=self.parallel.other_relative_gains,
            )
        return self


class DrawnUnits(Drawn):
    """Signals of units that move alike."""

    units: Units = Field(description="The units, from 0.", examples=[[0]])
    set_point: Series = Field(description="Set point.", examples=[[1.0, 1.0]])
    output: Series = Field(description="Output.", examples=[[0.0, 0.9]])
    input: Series = Field(description="Input.", examples=[[40.0, 1.2]])


class DrawnStepResponse(Drawn):
    """Time responses."""

    time: Series = Field(description="Times.", examples=[[0.0, 10.0]])
    responses: Annotated[list[DrawnUnits], Field(max_length=_MAX_TRACES)] = Field(
        description="One entry for each kind of unit.", examples=[[]]
    )

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        for each in self.responses:
            _require_length(
                self.time, set_point=each.set_point, output=each.output, input=each.input
            )
        return self


class DrawnRelayExperiment(Drawn):
    """Traces of a relay experiment."""

    time: Series = Field(description="Times.", examples=[[0.0, 1.0]])
    units: Annotated[list[Units], Field(max_length=_MAX_TRACES)] = Field(
        description="The units (from 0) of each row of outputs and inputs.", examples=[[[0], [1]]]
    )
    outputs: Traces = Field(description="Outputs.", examples=[[[0.0, 0.1], [0.0, 0.0]]])
    inputs: Traces = Field(description="Inputs.", examples=[[[1.0, -1.0], [0.0, 0.0]]])
    switchings: Series = Field(description="Times of the relay's switchings.", examples=[[0.33]])

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        _require_length(self.units, outputs=self.outputs, inputs=self.inputs)
        for row in (*self.outputs, *self.inputs):
            _require_length(self.time, row=row)
        return self


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
        _require_length(self.omega, approximate=self.approximate, exact=self.exact)
        for array in (*self.approximate, *self.exact):
            _require_length(self.exact[0], array=array)
            for row in array:
                _require_length(self.exact[0], row=row)
        return self


class DrawnDecoupling(Drawn):
    """The decoupled loops together; null where one is unbounded."""

    closed_loop: DrawnClosedLoop | None = Field(description="The responses.", examples=[None])


class DrawnDriveResponse(Drawn):
    """Response of units on one load."""

    time: Series = Field(description="Times.", examples=[[0.0, 0.1]])
    set_point: Series = Field(description="Set point.", examples=[[1.0, 1.0]])
    output: Series = Field(description="Common output.", examples=[[0.0, 0.17]])
    efforts: Annotated[
        list[Annotated[list[float | None], Field(max_length=_MAX_TRACES)]],
        Field(max_length=_MAX_POINTS),
    ] = Field(description="Efforts of the units at each time.", examples=[[[1.0, 1.0], [0.9, 0.9]]])

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        _require_length(
            self.time, set_point=self.set_point, output=self.output, efforts=self.efforts
        )
        for row in self.efforts:
            _require_length(self.efforts[0], row=row)
        return self


class DrawnDriveSimulation(Drawn):
    """The units as they are, and mended."""

    original: DrawnDriveResponse = Field(description="As they are.", examples=[{"time": []}])
    mended: DrawnDriveResponse | None = Field(description="Mended.", examples=[None])


class DrawnParallelDrives(Drawn):
    """Simulation of units on one load."""

    simulation: DrawnDriveSimulation = Field(
        description="Time responses.", examples=[{"original": {"time": []}, "mended": None}]
    )
