"""Solver records as plain JSON values: NaN and infinity become null."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np

__all__ = ["encode"]


def encode(value: Any) -> Any:  # noqa: ANN401, C901, PLR0911 - one case for each kind of value
    """Return `value` as JSON values.

    Frozen records become objects with their field names, arrays and tuples become lists, enums
    their values, complex numbers ``{"re", "im"}``, and numbers that are not finite null.

    Raises
    ------
    TypeError
        A value of any other kind.

    """
    match value:
        case None | bool() | str() if not isinstance(value, Enum):
            return value
        case Enum():
            return value.value
        case int():
            return value
        case float():
            return value if math.isfinite(value) else None
        case complex():
            return {"re": encode(value.real), "im": encode(value.imag)}
        case np.ndarray() if value.dtype == float and np.isfinite(value).all():
            return value.tolist()  # long curves: no need to look at each number
        case np.ndarray() | np.generic():
            return encode(value.tolist())
        case Mapping():
            return {str(key): encode(item) for key, item in value.items()}
        case list() | tuple():
            return [encode(item) for item in value]
    if hasattr(value, "to_document"):
        # A certificate: its document has a digest and a format of its own.
        return value.to_document()
    if dataclasses.is_dataclass(value):
        return {
            field.name: encode(getattr(value, field.name)) for field in dataclasses.fields(value)
        }
    message = f"{type(value).__name__} has no JSON form"
    raise TypeError(message)
