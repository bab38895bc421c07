"""A table of text: any delimiter, heads or not, units below them, titles above.

Python's `csv` splits the lines; errors name file, line and column.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.cells import (
    GAPS,
    Style,
    is_date,
    is_time_of_day,
    is_value,
    read_stamps,
    style_of,
)
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Table"]

_DELIMITERS = ";\t|,"  # a comma last: it may be the decimal sign of the others
_SPACES = " "  # any run of them
_LOOKED_AT = 50
_SEPARATOR = re.compile(r"sep=(.)\r?\n", re.IGNORECASE)  # a spreadsheet's first line
LARGE = 1e9  # times beyond are counted from the first: seconds and milliseconds since 1970


class Table:
    """The cells of a file, and where each line stands in it.

    Parameters
    ----------
    raw : bytes
        What the file holds.
    name : str
        Of the file, for messages.

    Attributes
    ----------
    heads : list of str
        Of the columns; their numbers from 1 where the file has none.
    units : list of str
        Of the columns, from the line below the heads; empty where there is none.
    lines : list of int
        Where each row stands in the file.

    Raises
    ------
    InvalidInputError
        The file is no table.

    """

    def __init__(self, raw: bytes, name: str) -> None:
        self.name = name
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
        self.units: list[str] = []
        self.heads = self._take_heads()
        if not self.rows:
            message = f"{self.name} has heads and no samples"
            if self.units:
                message += f": below them stands {', '.join(self.units[:3])!r}, no numbers"
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
            self.units = self.units or self.rows[0]
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
        cells = self._moments(place)
        if self.stamped(place, style):
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

    def stamped(self, place: int, style: Style) -> bool:
        """Whether a column of times has time stamps."""
        cell = self._moments(place)[0]
        number = _is_number(cell, style) and not re.fullmatch(r"(19|20)\d{12}", cell)
        return not number and cell.lower() not in GAPS

    def clock_beside(self, place: int) -> int | None:
        """Return the place of the times of the day beside a column of dates, or None."""
        if not all(map(is_date, self.column(place))):
            return None
        beside = [k for k in (place + 1, place - 1) if 0 <= k < len(self.heads)]
        return next((k for k in beside if all(map(is_time_of_day, self.column(k)))), None)

    def _moments(self, place: int) -> list[str]:
        beside = self.clock_beside(place)
        if beside is None:
            return self.column(place)
        return [f"{row[place]} {row[beside]}" for row in self.rows]

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
