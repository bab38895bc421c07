"""From records to rows: which outputs share their elements, and how each record starts."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.fitting import TimeLimits
from solver.identification.row import Row, Segment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.record import Record

__all__ = [
    "PlantStructure",
    "Start",
    "limits",
    "matrix_rows",
    "parallel_row",
    "rows",
    "thinned",
]


class PlantStructure(StrEnum):
    """Which elements are the same.

    PARALLEL shares g and i, of UNITS each has its own two, in a MATRIX each element is its own.
    """

    PARALLEL = "parallel"
    UNITS = "units"
    MATRIX = "matrix"


class Start(StrEnum):
    """What the inputs did before the record began."""

    HELD = "held"
    """They had their first values for long: the plant rests."""
    FROM_ZERO = "from zero"
    """They were zero for long; the record begins with a step to their first values."""
    MOVING = "moving"
    """They moved before: the outputs are still on their way."""


def limits(records: Sequence[Record]) -> TimeLimits:
    """Return what the records can tell of times.

    A lag longer than half of the longest record shows as a slope alone, one shorter than a quarter
    of a sample not at all; a dead time above a tenth of the record cannot be told from a lag by
    the few moves that come early enough.
    """
    span = max(record.span for record in records)
    sample = min(record.sampling_period for record in records)
    return TimeLimits(sample / 4, span / 2, span / 10, sample)


def matrix_rows(records: Sequence[Record], begins: Sequence[Start]) -> list[Row]:
    """Return a row for each output, every input with an element of its own."""
    rows = []
    for output in range(len(records[0].outputs)):
        segments = []
        for index, (record, begin) in enumerate(zip(records, begins, strict=True)):
            inputs = list(record.inputs.values())
            segments.append(_segment(record, begin, inputs, output, index))
        rows.append(Row(tuple(segments)))
    return rows


def parallel_row(
    records: Sequence[Record], begins: Sequence[Start], units: Sequence[int] | None = None
) -> Row:
    """Return one row for g and i: each unit's own input, and the sum of the others'.

    Parameters
    ----------
    records, begins
        The data and how each begins.
    units : sequence of int or None
        The outputs used; None: all.

    """
    count = len(records[0].outputs)
    segments = []
    for index, (record, begin) in enumerate(zip(records, begins, strict=True)):
        inputs = np.array(list(record.inputs.values()))
        total = inputs.sum(axis=0)
        for unit in range(count) if units is None else units:
            pair = [inputs[unit]] if count == 1 else [inputs[unit], total - inputs[unit]]
            segments.append(_segment(record, begin, pair, unit, index))
    return Row(tuple(segments))


def rows(
    records: Sequence[Record],
    begins: Sequence[Start],
    structure: PlantStructure,
    *,
    drift: bool = False,
) -> list[Row]:
    """Return the rows: one of a parallel plant, else one for each output.

    Of units that each have their own elements a row has the own input and the sum of the others.
    """
    match structure:
        case PlantStructure.PARALLEL:
            found = [parallel_row(records, begins)]
        case PlantStructure.UNITS:
            found = [
                parallel_row(records, begins, [unit]) for unit in range(len(records[0].outputs))
            ]
        case PlantStructure.MATRIX:
            found = matrix_rows(records, begins)
    return [replace(row, drift=drift) for row in found]


def thinned(row: Row, readings: int) -> Row:
    """Return the row with about as many readings, evenly spread."""
    step = max(row.readings // readings, 1)
    return replace(row, segments=tuple(segment.thinned(step) for segment in row.segments))


def _segment(
    record: Record, begin: Start, inputs: Sequence[NDArray[np.float64]], output: int, index: int
) -> Segment:
    time = record.time - record.time[0]
    seen = record.observed[output]
    values = list(record.outputs.values())[output]
    return Segment(
        time[seen].copy(),
        values[seen].copy(),
        tuple(_changes(time, moved, begin) for moved in inputs),
        np.ones(int(np.count_nonzero(seen))),
        record=index,
        unit=output,
        moving=begin is Start.MOVING,
    )


def _changes(
    time: NDArray[np.float64], values: NDArray[np.float64], begin: Start
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return when an input changes and its deviation from the value before the record."""
    before = 0.0 if begin is Start.FROM_ZERO else values[0]
    moved = np.flatnonzero(np.diff(np.concatenate(([before], values))))
    return time[moved].copy(), values[moved] - before
