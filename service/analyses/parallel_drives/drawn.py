"""What the figure shows of units on one load, as JSON."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.schemas.drawn import MAX_POINTS, MAX_TRACES, Drawn, Series, require_length

__all__ = ["DrawnDriveResponse", "DrawnDriveSimulation", "DrawnParallelDrives"]


class DrawnDriveResponse(Drawn):
    """Response of units on one load."""

    time: Series = Field(description="Times.", examples=[[0.0, 0.1]])
    set_point: Series = Field(description="Set point.", examples=[[1.0, 1.0]])
    output: Series = Field(description="Common output.", examples=[[0.0, 0.17]])
    efforts: Annotated[
        list[Annotated[list[float | None], Field(max_length=MAX_TRACES)]],
        Field(max_length=MAX_POINTS),
    ] = Field(description="Efforts of the units at each time.", examples=[[[1.0, 1.0], [0.9, 0.9]]])

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        require_length(
            self.time, set_point=self.set_point, output=self.output, efforts=self.efforts
        )
        for row in self.efforts:
            require_length(self.efforts[0], row=row)
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
