"""Stretches of a record between holes: what the inputs did in a hole nobody knows.

An input that is logged when it changes is held in between, and such records have samples far apart.
Where samples come regularly a step over several of them is a hole: the outputs after it follow
moves that are not in the record. So the record goes on as another one, with a start of its own.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.record import LEAST_SAMPLES, MISSING, Record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["holes", "stretches"]

# Steps from the first to the last of these shares are within the range of the median: regular.
SHARES = (0.1, 0.9)
RANGE = (0.5, 1.5)


def holes(record: Record) -> NDArray[np.intp]:
    """Return the samples, from 0, before which samples are missing; none of irregular sampling."""
    steps = np.diff(record.time)
    usual = float(np.median(steps))
    low, high = np.quantile(steps, SHARES)
    if low < RANGE[0] * usual or high > RANGE[1] * usual:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > MISSING * usual) + 1


def stretches(records: Sequence[Record]) -> list[Record]:
    """Return records without holes; parts in which an output has too few readings are left out.

    A record no part of which is long enough stays as it is.
    """
    found = []
    for record in records:
        edges = [0, *holes(record), record.time.size]
        parts = [
            record.part(slice(first, last), f"{record.name}, part {index} of {len(edges) - 1}")
            for index, (first, last) in enumerate(itertools.pairwise(edges), 1)
            if _tells(record, slice(first, last))
        ]
        found += parts if len(edges) > 2 and parts else [record]
    return found


def _tells(record: Record, rows: slice) -> bool:
    return bool(np.all(np.count_nonzero(record.observed[:, rows], axis=1) >= LEAST_SAMPLES))
