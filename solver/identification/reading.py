"""Records from files of columns: text with any delimiter, decimal point or comma, time stamps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from solver.identification import parquet
from solver.identification.columns import clock_of, name_of, place_of, split_unit
from solver.identification.record import MAX_SIGNALS, Record, checked_times
from solver.identification.table import Table
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["Column", "Columns", "column_names", "read_record", "read_table"]

_T = TypeVar("_T")
_PARQUET = {".parquet", ".pq"}
# Of the samples that may go before every input has been read for the first time.
BEFORE = 0.1
# Of a file that is read whole, to be looked at.
MOST_COLUMNS = 2 * MAX_SIGNALS + 1
MOST_CELLS = 2_000_000


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a file.

    Attributes
    ----------
    name : str
        Its head without the unit; with its number where another column has the same.
    unit : str or None
        What the head, or the line below, says.
    values : (k,) ndarray or None
        Its numbers, gaps being NaN; None where it has none or a cell is none.
    fault : str or None
        Why it has no values.

    """

    name: str
    unit: str | None
    values: NDArray[np.float64] | None
    fault: str | None


@dataclass(frozen=True, eq=False)
class Columns:
    """A file read whole.

    Attributes
    ----------
    clock : str
        Head of the column of times.
    unit : str or None
        Of the times; "s" of time stamps.
    time : (k,) ndarray
        Increasing.
    columns : tuple of Column
        The others.

    """

    clock: str
    unit: str | None
    time: NDArray[np.float64]
    columns: tuple[Column, ...]


def column_names(path: Path) -> list[str]:
    """Return the heads of a file's columns; without heads their numbers from 1.

    Raises
    ------
    InvalidInputError
        A file that is no table.

    """
    raw = path.read_bytes()
    return parquet.heads_of(raw, path.name) if _is_parquet(path) else Table(raw, path.name).heads


def read_record(
    path: Path, *, inputs: Sequence[str], outputs: Sequence[str], time: str | None = None
) -> Record:
    """Return the record in a file.

    A sample that is there twice counts once, samples from the last to the first are turned round,
    and those before every input has been read are left out (up to a tenth of the record).

    Parameters
    ----------
    path : Path
        The file.
    inputs, outputs : sequence of str
        Heads of the columns of the signals, with or without their units, or their numbers from 1.
    time : str or None
        The same of the times. Time stamps become seconds. None: the column that is called time,
        date or the like, else the first that is no signal. Times of the day beside a column of
        dates belong to them.

    Raises
    ------
    InvalidInputError
        A cell that is no number, by file, line and column; a column that is not there or twice;
        a record that cannot be used.

    """
    wanted = [*inputs, *outputs] if time is None else [time, *inputs, *outputs]
    for name in wanted:
        if wanted.count(name) > 1:
            message = f"{name!r} is named twice"
            raise InvalidInputError(message)
    signals, raw = [*inputs, *outputs], path.read_bytes()
    table = None
    if _is_parquet(path):
        times, columns = parquet.read_columns(raw, path.name, time, signals)
        called = {name: name for name in signals}
    else:
        table = Table(raw, path.name)
        places = [place_of(table.heads, name, table.name) for name in signals]
        clock = clock_of(table.heads, time, places, table.name)
        first, *styles = table.styles([clock, *places])
        times = table.times(clock, first)
        columns = {
            name: table.numbers(place, style)
            for name, place, style in zip(signals, places, styles, strict=True)
        }
        called = {
            name: name_of(table.heads, name, place)
            for name, place in zip(signals, places, strict=True)
        }
    rows = _in_order(times, columns)
    known = [np.flatnonzero(~np.isnan(columns[name][rows])) for name in inputs]
    begin = max((int(at[0]) for at in known if at.size), default=0)
    if begin <= BEFORE * rows.size:
        rows = rows[begin:]
    return _named(path.name, table, rows, lambda: Record.with_gaps(
        times[rows],
        {called[name]: columns[name][rows] for name in inputs},
        {called[name]: columns[name][rows] for name in outputs},
        path.stem,
    ))  # fmt: skip


def read_table(raw: bytes, name: str) -> Columns:
    """Return all columns of a file, to see which are signals; read as `read_record` reads them.

    Parameters
    ----------
    raw : bytes
        What the file holds.
    name : str
        Of the file: its end tells Parquet from text.

    Raises
    ------
    InvalidInputError
        The file is no table, too large to be looked at, or its times are none.

    """
    if _is_parquet(PurePath(name)):
        table, heads, units = None, parquet.heads_of(raw, name), []
    else:
        table = Table(raw, name)
        heads, units = table.heads, table.units
    if len(heads) > MOST_COLUMNS:
        message = f"{name} has {len(heads)} columns, up to {MOST_COLUMNS} can be looked at"
        raise InvalidInputError(message)
    clock = clock_of(heads, None, [], name)
    beside = None
    if table is None:
        (times, stamped), columns = _of_parquet(raw, name, heads, clock)
    else:
        beside = table.clock_beside(clock)
        (times, stamped), columns = _of_text(table, clock, beside)
    rows = _in_order(times, {str(k): c for k, c in columns.items() if not isinstance(c, str)})
    _named(name, table, rows, lambda: checked_times(times[rows]))
    split = [split_unit(head) for head in heads]
    names = [one for one, _ in split]

    def unit(place: int) -> str | None:
        return split[place][1] or next(iter(units[place : place + 1]), None) or None

    told = []
    for place, one in enumerate(names):
        if place in {clock, beside}:
            continue
        own = one if names.count(one) == 1 else f"{one} (column {place + 1})"
        values = columns[place]
        if isinstance(values, str):
            told.append(Column(own, unit(place), None, values))
        else:
            told.append(Column(own, unit(place), values[rows], None))
    return Columns(heads[clock], "s" if stamped else unit(clock), times[rows], tuple(told))


_Found = tuple[tuple["NDArray[np.float64]", bool], "dict[int, NDArray[np.float64] | str]"]


def _of_text(table: Table, clock: int, beside: int | None) -> _Found:
    """Return times, whether they are stamps, and each other column or why it is none."""
    places = [place for place in range(len(table.heads)) if place not in {clock, beside}]
    first, *styles = table.styles([clock, *places])
    columns: dict[int, NDArray[np.float64] | str] = {}
    for place, style in zip(places, styles, strict=True):
        try:
            values = table.numbers(place, style)
        except InvalidInputError as error:
            columns[place] = error.message
        else:
            columns[place] = values if np.any(np.isfinite(values)) else "no reading at all"
    return (table.times(clock, first), table.stamped(clock, first)), columns


def _of_parquet(raw: bytes, name: str, heads: list[str], clock: int) -> _Found:
    times, _ = parquet.read_columns(raw, name, heads[clock], [])
    if times.size * len(heads) > MOST_CELLS:
        message = f"{name} has {times.size * len(heads)} cells, up to {MOST_CELLS} can be looked at"
        raise InvalidInputError(message)
    columns: dict[int, NDArray[np.float64] | str] = {}
    for place, head in enumerate(heads):
        if place != clock:
            try:
                columns[place] = parquet.read_columns(raw, name, heads[clock], [head])[1][head]
            except InvalidInputError as error:
                columns[place] = error.message
    return (times, parquet.stamped(raw, heads[clock])), columns


def _is_parquet(path: PurePath) -> bool:
    return path.suffix.lower() in _PARQUET


def _in_order(
    times: NDArray[np.float64], columns: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.intp]:
    """Return the rows in the order of time, those that are there twice once."""
    rows = np.arange(times.size)
    if times.size > 1 and np.all(np.diff(times) <= 0):
        rows = rows[::-1]
    values = np.stack([times, *columns.values()])[:, rows]
    again = np.all((values[:, 1:] == values[:, :-1]) | np.isnan(values[:, 1:] + values[:, :-1]),
                   axis=0)  # fmt: skip
    return rows[np.r_[True, ~again]]


def _named(name: str, table: Table | None, rows: NDArray[np.intp], build: Callable[[], _T]) -> _T:
    """Return what `build` does; faults tell where in the file the sample stands.

    Raises
    ------
    InvalidInputError
        Of `build`, with file, line and column.

    """
    try:
        return build()
    except InvalidInputError as error:
        message = f"{name}{_place(error.field, table, rows)}: {error.message}"
        raise InvalidInputError(message) from None


def _place(field: str, table: Table | None, rows: NDArray[np.intp]) -> str:
    """Return where the sample that a fault names stands in the file."""
    parts = field.split("/")
    column = f", column {parts[2]!r}" if parts[1:2] in (["inputs"], ["outputs"]) else ""
    if not (parts[-1].isdigit() and len(parts) > 2) or int(parts[-1]) >= rows.size:
        return column
    row = int(rows[int(parts[-1])])
    return f", row {row + 1}{column}" if table is None else f", line {table.lines[row]}{column}"
