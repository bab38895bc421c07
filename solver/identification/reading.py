"""Records from files of columns: text with any delimiter, decimal point or comma, time stamps.

Python's `csv` splits the lines; errors name file, line and column.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.cells import GAPS, Style, is_value, read_stamps, style_of
from solver.identification.columns import clock_of, place_of
from solver.identification.parquet import heads_of, read_columns
from solver.identification.record import Record
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["column_names", "read_record"]

_DELIMITERS = ";\t|,"  # a comma last: it may be the decimal sign of the others
_SPACES = " "  # any run of them
_LOOKED_AT = 50
_PARQUET = {".parquet", ".pq"}
_SEPARATOR = re.compile(r"sep=(.)\r?\n", re.IGNORECASE)  # a spreadsheet's first line
LARGE = 1e9  # times beyond are counted from the first: seconds and milliseconds since 1970
# Of the samples that may go before every input has been read for the first time.
BEFORE = 0.1


class _Table:
    """The cells of a file, and where each line stands in it."""

    def __init__(self, path: Path) -> None:
        self.name = path.name
        raw = path.read_bytes()
        if b"\0" in raw[:4096] and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            message = f"{self.name} is no text: export it as CSV"
            raise InvalidInputError(message)
        text = _decoded(raw)
        told = _SEPARATOR.match(text)
        self.delimiter = told[1] if told else _delimiter(text)
        self.lines: list[int] = []
        self.rows: list[list[str]] = []
        self._split(text)
        if told:
            self._drop_first()
        if not self.rows:
            message = f"{self.name} is empty"
            raise InvalidInputError(message)
        self.heads = self._take_heads()
        if not self.rows:
            message = f"{self.name} has heads and no samples"
            raise InvalidInputError(message)
        width = len(self.heads)
        for line, row in zip(self.lines, self.rows, strict=True):
            # Some loggers end each line with a delimiter.
            if len(row) < width or any(row[width:]):
                cells = f"{len(row)} cell{'s' * (len(row) != 1)}"
                message = f"{self.name}, line {line}: {cells}, {width} are needed"
                raise InvalidInputError(message)

    def _split(self, text: str) -> None:
        if self.delimiter == _SPACES:
            text = "\n".join(" ".join(line.split()) for line in text.splitlines())
        reader = csv.reader(StringIO(text, newline=""), delimiter=self.delimiter)
        try:
            for cells in reader:
                if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                    self.lines.append(reader.line_num)
                    self.rows.append([cell.strip() for cell in cells])
        except csv.Error as error:
            message = f"{self.name}, line {reader.line_num}: {error}"
            raise InvalidInputError(message) from None

    def _drop_first(self) -> None:
        self.rows.pop(0)
        self.lines.pop(0)

    def _take_heads(self) -> list[str]:
        # Titles above the heads have fewer cells than the table.
        widths = Counter(_width(row) for row in self.rows[:_LOOKED_AT])
        usual = widths.most_common(1)[0][0]
        for index, row in enumerate(self.rows[:_LOOKED_AT]):
            if all(map(is_value, row)):
                break
            if _width(row) >= usual:
                for _ in range(index):
                    self._drop_first()
                break
        first = self.rows[0]
        if all(map(is_value, first)):
            return [str(index + 1) for index in range(len(first))]
        heads = self.rows[0]
        self._drop_first()
        # A second line of words is one of units.
        while self.rows and not any(is_value(cell) for cell in self.rows[0] if cell):
            self._drop_first()
        while heads and not heads[-1]:
            heads.pop()
        return heads

    def column(self, place: int) -> list[str]:
        """Return the cells of a column."""
        return [row[place] for row in self.rows]

    def styles(self, places: Sequence[int]) -> list[Style]:
        """Return how columns write their numbers."""
        columns = [self.column(place) for place in places]
        return style_of(columns, parted_by_commas=self.delimiter == ",")

    def numbers(self, place: int, style: Style) -> NDArray[np.float64]:
        """Return a column of numbers; gaps are NaN."""
        values = np.empty(len(self.rows))
        comma = style.decimal == ","
        for index, row in enumerate(self.rows):
            cell = row[place]
            try:
                if comma and "." in cell:
                    values[index] = style.number(cell)
                else:
                    values[index] = float(cell.replace(",", ".") if comma else cell)
            except ValueError:
                values[index] = self._odd(cell, style, index, place)
        return values

    def times(self, place: int, style: Style) -> NDArray[np.float64]:
        """Return a column of times: numbers, or time stamps in seconds from the first."""
        cells = self.column(place)
        stamped = not _is_number(cells[0], style) or re.fullmatch(r"(19|20)\d{12}", cells[0])
        if stamped and cells[0].lower() not in GAPS:
            found = read_stamps(cells)
            if found is None:
                message = (
                    f"{self._where(0, place)}: {cells[0]!r} may be read with day or month first, "
                    "and the times differ: write 2026-01-31 13:45:00"
                )
                raise InvalidInputError(message)
            if not isinstance(found, int):
                return found
            index = found
        else:
            values = self.numbers(place, style)
            bad = ~np.isfinite(values)
            if not np.any(bad):
                return np.asarray(values - values[0] if abs(values[0]) > LARGE else values)
            index = int(np.argmax(bad))
        message = (
            f"{self._where(index, place)}: {cells[index]!r} is no time "
            "(numbers, 2026-01-31 13:45:00, 31.01.2026 13:45:00 or 1/31/2026 1:45:00 PM)"
        )
        raise InvalidInputError(message)

    def _odd(self, cell: str, style: Style, index: int, place: int) -> float:
        try:
            return style.number(cell)
        except ValueError:
            message = f"{self._where(index, place)}: {cell!r} is no number"
            if style.open and "," in cell:
                message += (
                    " where commas part the cells, or thousands: write decimal points and no "
                    "thousands, or part by semicolons"
                )
            raise InvalidInputError(message) from None

    def _where(self, index: int, place: int) -> str:
        return f"{self.name}, line {self.lines[index]}, column {self.heads[place]!r}"


def column_names(path: Path) -> list[str]:
    """Return the heads of a file's columns; without heads their numbers from 1.

    Raises
    ------
    InvalidInputError
        A file that is no table.

    """
    return heads_of(path) if path.suffix.lower() in _PARQUET else _Table(path).heads


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
        Heads of the columns of the signals, with or without their units; without heads their
        numbers from 1.
    time : str or None
        The same of the times. Time stamps become seconds. None: the column that is called time,
        date or the like, else the first that is no signal.

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
    signals = [*inputs, *outputs]
    table = None
    if path.suffix.lower() in _PARQUET:
        times, columns = read_columns(path, time, signals)
    else:
        table = _Table(path)
        places = [place_of(table.heads, name, table.name) for name in signals]
        clock = clock_of(table.heads, time, places, table.name)
        first, *styles = table.styles([clock, *places])
        times = table.times(clock, first)
        columns = {
            name: table.numbers(place, style)
            for name, place, style in zip(signals, places, styles, strict=True)
        }
    rows = _used(times, columns, inputs)
    try:
        return Record.with_gaps(
            times[rows],
            {name: columns[name][rows] for name in inputs},
            {name: columns[name][rows] for name in outputs},
            path.stem,
        )
    except InvalidInputError as error:
        message = f"{path.name}{_place(error.field, table, rows)}: {error.message}"
        raise InvalidInputError(message) from None


def _used(
    times: NDArray[np.float64], columns: dict[str, NDArray[np.float64]], inputs: Sequence[str]
) -> NDArray[np.intp]:
    """Return the rows of the record in the order of time."""
    rows = np.arange(times.size)
    if times.size > 1 and np.all(np.diff(times) <= 0):
        rows = rows[::-1]
    values = np.stack([times, *columns.values()])[:, rows]
    again = np.all((values[:, 1:] == values[:, :-1]) | np.isnan(values[:, 1:] + values[:, :-1]),
                   axis=0)  # fmt: skip
    rows = rows[np.r_[True, ~again]]
    known = [np.flatnonzero(~np.isnan(columns[name][rows])) for name in inputs]
    begin = max((int(at[0]) for at in known if at.size), default=0)
    return rows[begin:] if begin <= BEFORE * rows.size else rows


def _place(field: str, table: _Table | None, rows: NDArray[np.intp]) -> str:
    """Return where the sample that a fault names stands in the file."""
    parts = field.split("/")
    column = f", column {parts[2]!r}" if parts[1:2] in (["inputs"], ["outputs"]) else ""
    if not (parts[-1].isdigit() and len(parts) > 2) or int(parts[-1]) >= rows.size:
        return column
    row = int(rows[int(parts[-1])])
    return f", row {row + 1}{column}" if table is None else f", line {table.lines[row]}{column}"


def _decoded(raw: bytes) -> str:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # of degrees and micro signs; every byte is a letter there


def _delimiter(text: str) -> str:
    lines = [line for line in text.splitlines()[:_LOOKED_AT] if line.strip() and line[0] != "#"]
    best = (0, _SPACES)
    for delimiter in _DELIMITERS:
        counts = [line.count(delimiter) for line in lines]
        if counts and min(counts) > 0 and counts.count(counts[-1]) > len(counts) / 2:
            best = (1, delimiter)
            break
        if any(counts):
            best = max(best, (sum(counts), delimiter))
    return _SPACES if best[1] == "," and _spaced(lines[-1]) else best[1]


def _spaced(line: str) -> bool:
    """Whether a line of decimal commas is parted by spaces."""
    cells = line.split()
    return len(cells) > 1 and all(map(is_value, cells)) and not all(map(is_value, line.split(",")))


def _width(row: list[str]) -> int:
    """Return the number of cells, empty ones at the end aside."""
    return max((index + 1 for index, cell in enumerate(row) if cell), default=0)


def _is_number(cell: str, style: Style) -> bool:
    try:
        style.number(cell)
    except ValueError:
        return False
    return True
