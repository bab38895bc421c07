"""The parts of results that figures show, as JSON: their base, and those that several have.

A figure is asked for with the result of an analysis as it came; only what is drawn is read and
checked, the rest is ignored. What one analysis alone draws is described where that analysis is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from service.schemas.encoding import encode
from service.schemas.fields import Frequency
from service.schemas.peaks import Curves, Peak, Peaks

__all__ = [
    "MAX_POINTS",
    "MAX_TRACES",
    "Drawn",
    "DrawnCurves",
    "DrawnRobustness",
    "DrawnStepResponse",
    "DrawnUnits",
    "Frequencies",
    "Series",
    "Traces",
    "Units",
    "require_length",
]

MAX_POINTS = 20_001
MAX_TRACES = 100

Series = Annotated[list[float | None], Field(max_length=MAX_POINTS)]
Frequencies = Annotated[list[Frequency], Field(max_length=MAX_POINTS)]
Units = Annotated[list[int], Field(min_length=1)]
Traces = Annotated[list[Series], Field(max_length=MAX_TRACES)]


class Drawn(BaseModel):
    """Base of what is drawn: unknown fields are passed over, the known ones must be right."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)

    @classmethod
    def of(cls, record: object) -> Self:
        """Return what is drawn of a record of the solver."""
        return cls.model_validate(encode(record))


def require_length(wanted: Sequence[Any], **series: Sequence[Any] | None) -> None:
    """Refuse those of the `series` that have not as many entries as `wanted`."""
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
        require_length(
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


class DrawnUnits(Drawn):
    """Signals of units that move alike."""

    units: Units = Field(description="The units, from 0.", examples=[[0]])
    set_point: Series = Field(description="Set point.", examples=[[1.0, 1.0]])
    output: Series = Field(description="Output.", examples=[[0.0, 0.9]])
    input: Series = Field(description="Input.", examples=[[40.0, 1.2]])


class DrawnTraces(Drawn):
    """Signals over time, all of one length."""

    time: Series = Field(description="Times.", examples=[[0.0, 10.0]])
    responses: Annotated[list[DrawnUnits], Field(max_length=MAX_TRACES)] = Field(
        description="One entry for each kind of unit.", examples=[[]]
    )

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        for each in self.responses:
            require_length(
                self.time, set_point=each.set_point, output=each.output, input=each.input
            )
        return self


class DrawnStepResponse(DrawnTraces):
    """Time responses."""

    limited: DrawnTraces | None = Field(
        default=None,
        description="The same with each input within the range of its valve.",
        examples=[None],
    )
