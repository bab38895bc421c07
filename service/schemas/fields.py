"""Numbers as requests carry them: each range, unit and meaning stands here once.

Every numeric field names its unit in the schema extension ``x-unit``: ``time`` is the caller's
unit of time, ``rad/time`` its angular frequency, ``gain`` is output units over input units,
``1`` a pure number and ``s`` seconds of computing; any other text is itself the unit.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST, MAX_ORDER

__all__ = [
    "SMALLEST",
    "WHOLE",
    "AnalysisRequest",
    "Coefficients",
    "Frequency",
    "Gain",
    "PositiveTime",
    "Ratio",
    "RequestModel",
    "ResultModel",
    "Time",
    "below",
]


class RequestModel(BaseModel):
    """Base of everything a caller sends: no unknown fields, no silent conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class AnalysisRequest(RequestModel, ABC):
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
