"""Columns of a table by what they are called."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["MOST_SHOWN", "clock_of", "name_of", "place_of", "split_unit"]

MOST_SHOWN = 40  # columns that a message lists

_UNIT = re.compile(r"\s*[(\[]([^)\]]*)[)\]]\s*$")


_CLOCKS = {
    "time", "t", "timestamp", "time stamp", "date", "datetime", "date time", "date/time", "clock",
    "seconds", "elapsed", "elapsed time", "zeit", "zeitstempel", "uhrzeit", "datum", "temps", "sec",
}  # fmt: skip


def split_unit(head: str) -> tuple[str, str | None]:
    """Return the name and the unit that a head tells."""
    found = _UNIT.search(head)
    return (_UNIT.sub("", head), found[1].strip() or None) if found else (head, None)


def name_of(heads: Sequence[str], wanted: str, place: int) -> str:
    """Return what a signal is called: as it was asked for, its head where that was its number."""
    if not wanted.isdecimal() or wanted in heads:
        return wanted
    names = [split_unit(head)[0] for head in heads]
    own = names[place]
    return own if own and names.count(own) == 1 else f"{own} (column {wanted})".lstrip()


def clock_of(heads: Sequence[str], wanted: str | None, signals: Sequence[int], file: str) -> int:
    """Return the place of the column of times.

    Parameters
    ----------
    heads : sequence of str
        Of all columns.
    wanted : str or None
        Its head. None: the column that is called time or the like, else the first that is no
        signal.
    signals : sequence of int
        Places of the signals.
    file : str
        For messages.

    Raises
    ------
    InvalidInputError
        As `place_of`; every column is a signal.

    """
    if wanted is not None:
        return place_of(heads, wanted, file)
    others = [place for place in range(len(heads)) if place not in signals]
    named = [
        place
        for place in others
        if _UNIT.sub("", heads[place]).casefold().replace("_", " ").strip() in _CLOCKS
    ]
    if not others:
        message = f"{file} has no column of times beside the signals"
        raise InvalidInputError(message)
    return (named or others)[0]


def place_of(heads: Sequence[str], wanted: str, file: str) -> int:
    """Return the place of a column by its head, with or without unit, or by its number from 1.

    Raises
    ------
    InvalidInputError
        No such column, or several.

    """
    plain = [_UNIT.sub("", head) for head in heads]
    folded = [name.casefold() for name in plain]
    for names, key in ((heads, wanted), (plain, wanted), (folded, wanted.casefold())):
        found = [index for index, name in enumerate(names) if name == key]
        if len(found) > 1:
            places = ", ".join(str(index + 1) for index in found)
            message = f"{file}: {wanted!r} names the columns {places}; rename one"
            raise InvalidInputError(message)
        if found:
            return found[0]
    if wanted.isdecimal() and 1 <= int(wanted) <= len(heads):
        return int(wanted) - 1
    shown = ", ".join(map(repr, heads[:MOST_SHOWN])) + (", ..." if len(heads) > MOST_SHOWN else "")
    message = f"{file} has no column {wanted!r}; it has {shown}"
    raise InvalidInputError(message)
