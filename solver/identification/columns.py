"""Columns of a table by what they are called."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["place_of"]

_UNIT = re.compile(r"\s*[(\[][^)\]]*[)\]]\s*$")


def place_of(heads: Sequence[str], wanted: str, file: str) -> int:
    """Return the place of a column by its head, with or without unit.

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
    shown = ", ".join(map(repr, heads[:MOST_SHOWN])) + (", ..." if len(heads) > MOST_SHOWN else "")
    message = f"{file} has no column {wanted!r}; it has {shown}"
    raise InvalidInputError(message)


MOST_SHOWN = 40
