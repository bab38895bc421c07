"""Where a plant and its uncertainty come from: records, how well they are met, what errs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from service.schemas.fields import RequestModel

__all__ = ["MAX_ENTRIES", "Origin"]

MAX_ENTRIES = 600
_Text = Annotated[str, Field(max_length=200)]
_RECORD = {"name": "monday.csv", "digest": "0" * 64, "samples": 600, "span": 599.0, "use": "fit"}


class OriginRecord(RequestModel):
    """One record that was used."""

    name: _Text = Field(description="Its name.", examples=["monday.csv"])
    digest: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] = Field(
        description="SHA-256 of the file; of a record that came without one, of its signals.",
        examples=["0" * 64],
    )
    samples: int = Field(
        ge=1, description="How many.", examples=[600], json_schema_extra={"x-unit": "1"}
    )
    span: float = Field(
        gt=0, description="From the first to the last.", examples=[599.0],
        json_schema_extra={"x-unit": "time"},
    )  # fmt: skip
    use: Literal["fit", "validate"] = Field(
        description="validate: kept back from the fit, and predicted.", examples=["fit"]
    )


class OriginFit(RequestModel):
    """How well the plant meets one output of one record."""

    record: _Text = Field(description="Which record.", examples=["monday.csv"])
    output: _Text = Field(description="Which output.", examples=["temperature"])
    kept_back: bool = Field(description="Whether the fit has not seen it.", examples=[False])
    normalised_fit: float = Field(
        description="100 (1 - |y - y_hat| / |y - mean of y|), per cent.",
        examples=[98.0],
        json_schema_extra={"x-unit": "1"},
    )


class OriginError(RequestModel):
    """A source of error that the uncertainty covers."""

    source: _Text = Field(description="What errs.", examples=["statistical error"])
    steady_state: float | None = Field(
        description="Relative input error at the lowest frequency; null: not told.",
        examples=[0.1],
        json_schema_extra={"x-unit": "1"},
    )


class Origin(RequestModel):
    """Where a plant and its uncertainty come from."""

    records: Annotated[list[OriginRecord], Field(max_length=MAX_ENTRIES)] = Field(
        description="The records.", examples=[[_RECORD]]
    )
    fits: Annotated[list[OriginFit], Field(max_length=MAX_ENTRIES)] = Field(
        description="How well the plant meets them.", examples=[[]]
    )
    errors: Annotated[list[OriginError], Field(max_length=MAX_ENTRIES)] = Field(
        description="What the uncertainty covers.", examples=[[]]
    )
