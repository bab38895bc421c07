"""Records that hold arrays compare and hash by value, like all others."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["ByValue"]


class ByValue:
    """Base of frozen dataclasses with arrays, made with ``eq=False``.

    Arrays are equal where shape and values are, NaN included; fields with ``compare=False`` do
    not count.
    """

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            _same(own, its) for own, its in zip(_compared(self), _compared(other), strict=True)
        )

    def __hash__(self) -> int:
        return hash((type(self), *(_key(value) for value in _compared(self))))


def _compared(record: Any) -> Iterator[Any]:  # noqa: ANN401 - a dataclass
    return (getattr(record, each.name) for each in dataclasses.fields(record) if each.compare)


def _same(own: Any, its: Any) -> bool:  # noqa: ANN401 - values of any kind
    if isinstance(own, np.ndarray) and isinstance(its, np.ndarray):
        return np.array_equal(own, its, equal_nan=own.dtype.kind in "fc")
    if isinstance(own, tuple) and isinstance(its, tuple):
        return len(own) == len(its) and all(map(_same, own, its))
    return type(own) is type(its) and bool(own == its)


def _key(value: Any) -> Any:  # noqa: ANN401 - values of any kind
    if isinstance(value, np.ndarray):
        return value.shape, (value + 0).tobytes()  # -0.0 equals 0.0
    return tuple(map(_key, value)) if isinstance(value, tuple) else value
