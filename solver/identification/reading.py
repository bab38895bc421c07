"""Records from files of columns: text with any delimiter, decimal point or comma, time stamps.

Python's `csv` splits the lines; what a cell means is decided here, so that an error can name file,
line and column.
"""

from __future__ import annotations

import csv
import math
import re
from datetime import UTC, datetime
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.columns import place_of
from solver.identification.parquet import read_columns
from solver.identification.record import Record
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["read_record"]

_DELIMITERS = ";\t|,"  # a comma last: it may be the decimal sign of the others
_LOOKED_AT = 50
_PARQUET = {".parquet", ".pq"}
_GAPS = {"", "nan", "na", "n/a", "null", "none", "-", "--", "bad", "#n/a"}
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d:\d\d(\.\d+)?")
_STAMPS = (
    "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M",
    "%Y/%m/%d %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S", "%Y/%m/%d %H:%M",
    "%m/%d/%Y %I:%M:%S.%f %p", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %I:%M %p",
    "%H:%M:%S.%f", "%H:%M:%S",
)  # fmt: skip
_DAY = 86400.0


class _Table:
    """The cells of a file, and where each line stands in it."""

    def __init__(self, path: Path) -> None:
        self.name = path.name
        raw = path.read_bytes()
        if b"\0" in raw[:4096] and not raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            message = f"{self.name} is no text: export it as CSV"
            raise InvalidInputError(message)
        text = _decoded(raw)
        self.delimiter = _delimiter(text)
        reader = csv.reader(StringIO(text, newline=""), delimiter=self.delimiter)
        self.lines: list[int] = []
        self.rows: list[list[str]] = []
        try:
            for cells in reader:
                if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                    self.lines.append(reader.line_num)
                    self.rows.append([cell.strip() for cell in cells])
        except csv.Error as error:
            message = f"{self.name}, line {reader.line_num}: {error}"
            raise InvalidInputError(message) from None
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
                message = f"{self.name}, line {line}: {len(row)} cells, {width} are needed"
                raise InvalidInputError(message)

    def _take_heads(self) -> list[str]:
        first = self.rows[0]
        if all(self._is_value(cell) for cell in first):
            return [str(index + 1) for index in range(len(first))]
        heads = self.rows.pop(0)
        self.lines.pop(0)
        # A second line of words is one of units.
        while self.rows and not any(self._is_value(cell) for cell in self.rows[0] if cell):
            self.rows.pop(0)
            self.lines.pop(0)
        while heads and not heads[-1]:
            heads.pop()
        return heads

    def _is_value(self, cell: str) -> bool:
        return cell.lower() in _GAPS or bool(_NUMBER.fullmatch(cell)) or _stamp(cell) is not None

    def numbers(self, place: int) -> NDArray[np.float64]:
        """Return a column of numbers; gaps are NaN."""
        values = np.empty(len(self.rows))
        for index, row in enumerate(self.rows):
            cell = row[place]
            try:
                value = float(cell)
            except ValueError:
                value = self._odd(cell, index, place)
            values[index] = value
        return values

    def times(self, place: int) -> NDArray[np.float64]:
        """Return a column of times: numbers, or time stamps in seconds from the first."""
        first = self.rows[0][place]
        if _NUMBER.fullmatch(first) or first.lower() in _GAPS:
            values = self.numbers(place)
            bad = ~np.isfinite(values)
        else:
            stamps = [_stamp(row[place]) for row in self.rows]
            values = np.array([math.nan if stamp is None else stamp for stamp in stamps])
            bad = np.isnan(values)
            values = values - values[0]
            if _TIME_OF_DAY.fullmatch(self.rows[0][place]):  # midnight may pass
                values = values + _DAY * np.cumsum(np.diff(values, prepend=0.0) < -_DAY / 2)
        if np.any(bad):
            index = int(np.argmax(bad))
            message = (
                f"{self._where(index, place)}: {self.rows[index][place]!r} is no time "
                "(numbers, 2026-01-31 13:45:00, 31.01.2026 13:45:00 or 1/31/2026 1:45:00 PM)"
            )
            raise InvalidInputError(message)
        return np.asarray(values)

    def _odd(self, cell: str, index: int, place: int) -> float:
        if cell.lower() in _GAPS:
            return math.nan
        if _NUMBER.fullmatch(cell) and self.delimiter != ",":
            return float(cell.replace(",", "."))
        message = f"{self._where(index, place)}: {cell!r} is no number"
        if _NUMBER.fullmatch(cell):  # or is it a comma of thousands?
            message += " where commas part the cells: write decimal points, or part by semicolons"
        raise InvalidInputError(message)

    def _where(self, index: int, place: int) -> str:
        return f"{self.name}, line {self.lines[index]}, column {self.heads[place]!r}"


def read_record(path: Path, *, time: str, inputs: Sequence[str], outputs: Sequence[str]) -> Record:
    """Return the record in a file.

    Parameters
    ----------
    path : Path
        The file.
    time : str
        Head of the column of times, with or without its unit; without heads its number from 1.
        Time stamps become seconds.
    inputs, outputs : sequence of str
        The same for the signals.

    Raises
    ------
    InvalidInputError
        A cell that is no number, by file, line and column; a column that is not there or twice;
        a record that cannot be used.

    """
    wanted = [time, *inputs, *outputs]
    for name in wanted:
        if wanted.count(name) > 1:
            message = f"{name!r} is named twice"
            raise InvalidInputError(message)
    table = None
    if path.suffix.lower() in _PARQUET:
        times, columns = read_columns(path, time, wanted[1:])
    else:
        table = _Table(path)
        times = table.times(place_of(table.heads, time, table.name))
        columns = {
            name: table.numbers(place_of(table.heads, name, table.name)) for name in wanted[1:]
        }
    try:
        return Record.with_gaps(
            times,
            {name: columns[name] for name in inputs},
            {name: columns[name] for name in outputs},
            path.stem,
        )
    except InvalidInputError as error:
        message = f"{path.name}{_place(error.field, table)}: {error.message}"
        raise InvalidInputError(message) from None


def _place(field: str, table: _Table | None) -> str:
    """Return where the sample that a fault names stands in the file."""
    parts = field.split("/")
    column = f", column {parts[2]!r}" if parts[1:2] in (["inputs"], ["outputs"]) else ""
    if not (parts[-1].isdigit() and len(parts) > 2):
        return column
    row = int(parts[-1])
    if table is None:
        return f", row {row + 1}{column}"
    return f", line {table.lines[row]}{column}" if row < len(table.lines) else column


def _decoded(raw: bytes) -> str:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # of degrees and micro signs; every byte is a letter there


def _delimiter(text: str) -> str:
    lines = [line for line in text.splitlines()[:_LOOKED_AT] if line and line[0] != "#"]
    best = (0, ",")
    for delimiter in _DELIMITERS:
        counts = [line.count(delimiter) for line in lines]
        if counts and min(counts) > 0 and counts.count(counts[-1]) > len(counts) / 2:
            return delimiter
        best = max(best, (sum(counts), delimiter))
    return best[1]


def _stamp(cell: str) -> float | None:
    """Return seconds of a time stamp, or None."""
    if len(cell) < len("0:00:00"):
        return None
    try:
        value = datetime.fromisoformat(cell)
    except ValueError:
        for form in _STAMPS:
            try:
                value = datetime.strptime(cell, form).replace(tzinfo=UTC)
            except ValueError:
                continue
            return value.timestamp()
        return None
    return (value if value.tzinfo else value.replace(tzinfo=UTC)).timestamp()
