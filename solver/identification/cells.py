"""What the cells of a column of text mean: gaps, numbers as files write them, time stamps.

How numbers are written is decided by the whole column, and where it leaves that open by the other
columns: `1.200` is 1200 beside `1.200,50` and 1.2 beside `0.85`.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

__all__ = ["GAPS", "Style", "is_date", "is_time_of_day", "is_value", "read_stamps", "style_of"]

# What historians and spreadsheets write where there is no reading.
GAPS = {
    "", "nan", "na", "n/a", "null", "none", "-", "--", "bad", "bad input", "no data",
    "i/o timeout", "#n/a", "#div/0!", "#value!", "#ref!", "#num!", "#name?", "#null!",
}  # fmt: skip
_GROUPS = "'\u2019 \u00a0\u2009\u202f"  # never decimal signs
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_LOOSE = re.compile(
    rf"[+\-\u2212]?(\d{{1,3}}([{_GROUPS}]\d{{3}})+([.,]\d*)?|[\d.,]*\d[.,]?)([eE][+-]?\d+)?"
)
_WHOLE = re.compile(r"\d{14}")  # 20260131134500
_DAY = 86400.0

_CLOCK = re.compile(
    r"(?P<date>.*?)[T ]?(?P<hour>\d{1,2}):(?P<minute>\d\d)(:(?P<second>\d\d)([.,](?P<part>\d+))?)?"
    r"\s*((?P<half>[AaPp])\.?[Mm]\.?)?\s*(Z|UTC|GMT|(?P<zone>[+-]\d\d:?\d\d))?"
)
_DATES = (
    "%Y-%m-%d", "%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%m/%d/%Y", "%d/%m/%Y", "%m/%d/%y", "%d/%m/%y",
    "%d-%b-%Y", "%d-%b-%y", "%d %b %Y", "%b %d %Y", "%d-%m-%Y", "%m-%d-%Y",
)  # fmt: skip
_FORMS = (None, "", *_DATES)  # ISO 8601, times of the day, date and time


@dataclass(frozen=True)
class Style:
    """How a column writes numbers.

    Attributes
    ----------
    decimal : str
        Point or comma.
    open : bool
        Whether the commas of the column may be decimal signs or part thousands.

    """

    decimal: str = "."
    open: bool = False

    def number(self, cell: str) -> float:
        """Return the number in a cell, NaN for a gap.

        Raises
        ------
        ValueError
            It is neither.

        """
        if cell.lower() in GAPS:
            return math.nan
        text = cell.replace("\u2212", "-")
        whole, decimal, part = text.partition(self.decimal)
        for sign in (",.".replace(self.decimal, ""), *_GROUPS):
            if re.fullmatch(rf"[+-]?\d{{1,3}}({re.escape(sign)}\d{{3}})+", whole):
                whole = whole.replace(sign, "")
        text = whole + ("." if decimal else "") + part
        if not _PLAIN.fullmatch(text) or (self.open and "," in cell):
            raise ValueError(cell)
        return float(text)


def style_of(columns: Sequence[Iterable[str]], *, parted_by_commas: bool) -> list[Style]:
    """Return how each column writes its numbers.

    Parameters
    ----------
    columns : sequence of iterable of str
        The cells of each.
    parted_by_commas : bool
        Whether commas part the cells; one within a cell then tells nothing by itself.

    """
    told = [_told(cells) for cells in columns]
    whole = sum(told, Counter())
    found = []
    for own in told:
        for votes in (own, whole):
            if votes["."] != votes[","]:
                found.append(Style("." if votes["."] > votes[","] else ","))
                break
        else:
            found.append(Style("." if parted_by_commas else ",", open=parted_by_commas)
                         if own["open"] else Style())  # fmt: skip
    return found


def _told(cells: Iterable[str]) -> Counter[str]:
    """Return what the cells say of the decimal sign; "open": commas that say nothing."""
    votes: Counter[str] = Counter()
    for cell in cells:
        points, commas = cell.count("."), cell.count(",")
        if not (points or commas) or not _LOOSE.fullmatch(cell):
            continue
        if points and commas:
            votes["." if cell.rindex(".") > cell.rindex(",") else ","] += 1
        elif points > 1 or commas > 1:
            votes["," if points else "."] += 1
        else:
            sign = "." if points else ","
            whole, _, part = cell.lstrip("+-\u2212").partition(sign)
            if len(part) == 3 and part.isdigit() and 1 <= len(whole) <= 3 and whole[0] != "0":
                votes["open"] += commas
            else:
                votes[sign] += 1
    return votes


def is_value(cell: str) -> bool:
    """Whether a cell is a number in any way of writing, a time stamp or a gap."""
    if cell.lower() in GAPS or _LOOSE.fullmatch(cell):
        return True
    return any(_stamp(cell, form) is not None for form in _FORMS)


def is_date(cell: str) -> bool:
    """Whether a cell is a date without a time of the day."""
    return any(_day(cell, form) is not None for form in _DATES)


def is_time_of_day(cell: str) -> bool:
    """Whether a cell is a time of the day without a date."""
    return _stamp(cell, "") is not None


def read_stamps(cells: Sequence[str]) -> NDArray[np.float64] | int | None:
    """Return time stamps in seconds from the first.

    Returns
    -------
    (k,) ndarray, int or None
        The index of the first cell that is none; None where day and month may be either way and
        the distances differ.

    """
    farthest, found = 0, []
    for form in _FORMS:
        values = []
        for cell in cells:
            value = _stamp(cell, form)
            if value is None:
                break
            values.append(value)
        if len(values) == len(cells):
            # Seconds since 1970 leave room for microseconds.
            found.append(np.round(np.array(values) - values[0], 6))
            if form is None:
                break
        farthest = max(farthest, len(values))
    if not found:
        return farthest
    # Of two orders of day and month the one in which time does not run back.
    forward = [one for one in found if np.all(np.diff(one) >= 0)] or found
    if any(not np.array_equal(forward[0], one) for one in forward):
        return None
    seconds = forward[0]
    if re.fullmatch(r"\d{1,2}:.*", cells[0]):  # times of the day: midnight may pass
        seconds = seconds + _DAY * np.cumsum(np.diff(seconds, prepend=0.0) < -_DAY / 2)
    return np.asarray(seconds)


def _stamp(cell: str, form: str | None) -> float | None:
    """Return seconds of a time stamp whose date has a form; None: of ISO 8601."""
    if form is None:
        return _iso(cell)
    match = _CLOCK.fullmatch(cell)
    if match is None:
        return None
    day = _day(match["date"].strip(" ,"), form)
    hour, half = int(match["hour"]), match["half"]
    if half:
        hour = hour % 12 + 12 * (half in "Pp")
    minute, second = int(match["minute"]), int(match["second"] or 0)
    if day is None or hour > 23 or minute > 59 or second > 60:
        return None
    ahead = 0
    if zone := match["zone"]:
        ahead = int(zone[0] + "1") * (60 * int(zone[1:3]) + int(zone[-2:]))
    return day + 3600 * hour + 60 * (minute - ahead) + second + float(f"0.{match['part'] or 0}")


def _iso(cell: str) -> float | None:
    try:
        if _WHOLE.fullmatch(cell):
            return datetime.strptime(cell, "%Y%m%d%H%M%S").replace(tzinfo=UTC).timestamp()
        if len(cell) < len("20260101"):
            return None
        value = datetime.fromisoformat(cell)
    except ValueError:
        return None
    return (value if value.tzinfo else value.replace(tzinfo=UTC)).timestamp()


@lru_cache(maxsize=1000)
def _day(date: str, form: str) -> float | None:
    """Return seconds to the begin of a day."""
    if not form:
        return None if date else 0.0
    try:
        return datetime.strptime(date, form).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return None
