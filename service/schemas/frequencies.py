"""Frequencies that a caller may choose for the curves of an analysis."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from service.schemas.fields import Frequency
from solver.model.errors import InvalidInputError

__all__ = ["Frequencies", "ascending"]

Frequencies = Annotated[tuple[Frequency, ...], Field(min_length=1, max_length=1000)]


def ascending(omega: tuple[float, ...] | None) -> NDArray[np.float64] | None:
    """Return the frequencies as an array, or None for none.

    Raises
    ------
    InvalidInputError
        They do not ascend; the pointer is that of the request's field ``omega``.

    """
    if omega is None:
        return None
    values = np.array(omega)
    if np.any(np.diff(values) <= 0):
        index = int(np.argmax(np.diff(values) <= 0)) + 1
        message = "the frequencies must ascend"
        raise InvalidInputError(message, f"/omega/{index}")
    return values
