"""Numbers as requests carry them: each range, unit and meaning stands here once.

Every numeric field names its unit in the schema extension ``x-unit``: ``time`` is the caller's
unit of time, ``rad/time`` its angular frequency, ``gain`` is output units over input units,
``1`` a pure number and ``s`` seconds of computing; any other text is itself the unit. ``x-index``
marks a number of a loop or unit, from 0 here and from 1 for people.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, JsonValue

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST, MAX_ORDER

__all__ = [
    "SMALLEST",
    "WHOLE",
    "AnalysisRequest",
    "Coefficients",
    "Frequency",
    "Gain",
    "IdentifiedResult",
    "Instrument",
    "PositiveTime",
    "Ratio",
    "RecordedRequest",
    "RequestModel",
    "ResultModel",
    "Time",
    "TimeUnit",
    "below",
]


class RequestModel(BaseModel):
    """Base of everything a caller sends: no unknown fields, no silent conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


_RECORD: dict[str, JsonValue] = {
    "x-record": True
}  # what describes the request and takes no part in computing

_Name = Annotated[str, Field(max_length=100)]
TimeUnit = Annotated[str, Field(min_length=1, max_length=20, pattern=r"^[^<>&\x00-\x1f]+$")]


class Instrument(RequestModel):
    """The signals of a loop as the plant knows them."""

    tag: _Name | None = Field(default=None, description="Name of the loop.", examples=["TIC-101"])
    output_unit: _Name | None = Field(
        default=None, description="Unit of the measured output.", examples=["degC"]
    )
    output_span: Annotated[float, Field(gt=0, le=LARGEST)] | None = Field(
        default=None,
        description="Range of the transmitter in that unit.",
        examples=[100.0],
        json_schema_extra={"x-unit": "output"},
    )
    input_unit: _Name | None = Field(
        default=None, description="Unit of the controller's output.", examples=["%"]
    )
    input_span: Annotated[float, Field(gt=0, le=LARGEST)] | None = Field(
        default=None,
        description="Range of the controller's output in that unit.",
        examples=[100.0],
        json_schema_extra={"x-unit": "input"},
    )


class RecordedRequest(RequestModel):
    """Base of requests: what says which plant, which units and whose request it is."""

    title: Annotated[str, Field(max_length=200)] | None = Field(
        default=None,
        description="What people call it.",
        examples=["Reactor train A"],
        json_schema_extra=_RECORD,
    )
    time_unit: TimeUnit | None = Field(
        default=None,
        description="Name of the unit of all times.",
        examples=["min"],
        json_schema_extra=_RECORD,
    )
    id: _Name | None = Field(
        default=None,
        description="Identifier of the caller's choice; comes back with the result.",
        examples=["R-7"],
        json_schema_extra=_RECORD,
    )
    labels: Annotated[dict[_Name, _Name], Field(max_length=20)] = Field(
        default_factory=dict,
        description="Labels of the caller's choice; come back with the result, and are columns of "
        "tables.",
        examples=[{"site": "north"}],
        json_schema_extra=_RECORD,
    )
    instruments: Annotated[tuple[Instrument, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="Tag, units and spans of each loop, or one entry for all.",
        examples=[[{"tag": "TIC-101", "output_unit": "degC", "output_span": 100.0}]],
        json_schema_extra=_RECORD,
    )

    def output_spans(self, n: int) -> tuple[float, ...] | None:
        """Return the span of each of n outputs, where the instruments tell unlike ones.

        Raises
        ------
        InvalidInputError
            Neither one instrument for all loops nor one for each.

        """
        spans = tuple(each.output_span for each in self.signals(n) if each.output_span is not None)
        return spans if len(spans) == n and len(set(spans)) > 1 else None

    def gain_ratios(self, n: int) -> tuple[float, ...] | None:
        """Return output span over input span of each of n loops, where all are told.

        Raises
        ------
        InvalidInputError
            Neither one instrument for all loops nor one for each.

        """
        ratios = tuple(
            each.output_span / each.input_span
            for each in self.signals(n)
            if each.output_span is not None and each.input_span is not None
        )
        return ratios if len(ratios) == n else None

    def signals(self, n: int) -> tuple[Instrument, ...]:
        """Return the signals of each of n loops, unknown ones where none are given.

        Raises
        ------
        InvalidInputError
            Neither one instrument for all loops nor one for each.

        """
        given = self.instruments or (Instrument(),)
        if len(given) not in {1, n}:
            message = f"{len(given)} instruments for {n} loops; give one a loop, or one for all"
            raise InvalidInputError(message, "/instruments")
        return given * n if len(given) == 1 else given

    def identity(self) -> dict[str, Any]:
        """Return what comes back with the result."""
        given = {"id": self.id, "labels": self.labels}
        return {name: value for name, value in given.items() if value}

    def record(self) -> dict[str, Any]:
        """Return what has no say in the result: title and unit of time beside the identity."""
        given = {"title": self.title, "time_unit": self.time_unit}
        return {name: value for name, value in given.items() if value} | self.identity()


class IdentifiedResult(BaseModel):
    """Base of results: the identity that the request gave them."""

    id: str | None = Field(
        default=None, description="The request's identifier.", examples=["R-7", None]
    )
    labels: dict[str, str] = Field(
        default_factory=dict, description="The request's labels.", examples=[{"site": "north"}]
    )


class AnalysisRequest(RecordedRequest, ABC):
    """Base of the requests of analyses."""

    @abstractmethod
    def build(self) -> object:
        """Return the solver's input.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """


class ResultModel(BaseModel):
    """Base of results, which are read again where a client sends one back."""

    model_config = ConfigDict(strict=True)


def _whole(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


# A whole number, however it is written: JSON knows numbers only, and many writers print 2.0.
WHOLE = BeforeValidator(_whole)

SMALLEST = 1 / LARGEST  # so that quotients of any two such numbers are in range too

Coefficient = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]

Coefficients = Annotated[
    tuple[Coefficient, ...],
    Field(min_length=1, max_length=MAX_ORDER + 1, json_schema_extra={"x-unit": "powers of time"}),
]

Gain = Annotated[float, Field(ge=-LARGEST, le=LARGEST, json_schema_extra={"x-unit": "gain"})]

Ratio = Annotated[float, Field(ge=-LARGEST, le=LARGEST, json_schema_extra={"x-unit": "1"})]

Time = Annotated[float, Field(ge=0, le=LARGEST, json_schema_extra={"x-unit": "time"})]

PositiveTime = Annotated[
    float, Field(ge=SMALLEST, le=LARGEST, json_schema_extra={"x-unit": "time"})
]

Frequency = Annotated[
    float, Field(ge=SMALLEST, le=LARGEST, json_schema_extra={"x-unit": "rad/time"})
]


@contextmanager
def below(prefix: str) -> Iterator[None]:
    """Put the pointer of an `InvalidInputError` raised inside below `prefix`."""
    try:
        yield
    except InvalidInputError as error:
        raise error.within(prefix) from None
