"""Loops by the tags of their instruments, in texts that count them from 1."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from solver.model.loop_names import loops_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from service.schemas.fields import RecordedRequest

__all__ = ["Tags", "called", "cell_tagged", "figure_tagged", "tagged", "tags_of"]

Tags = Sequence[str | None]  # one entry a loop; empty: loops have numbers only

_LISTED = 3  # tags that are told one by one
_NUMBERS = r"\d+(?:-\d+)?(?:(?:, | and )\d+(?:-\d+)?)*"
# Not within quotes, where a name of the caller's stands; not where the list goes on.
_COUNTED = re.compile(
    r"(?<!['\w])(?<!\d )[Ll]oop(?: (?P<one>\d+)"
    rf"|s (?P<many>{_NUMBERS})(?!(?:, | and )\d+(?![\d ]*%)))"
    r"(?![\d-]|\.\d| %|,? \.\.\.)"
)
_CELL = re.compile(_NUMBERS)


def tags_of(request: RecordedRequest, n: int) -> Tags:
    """Return the tag of each of n loops, None where it has none; one entry for several has none."""
    given = request.instruments or ()
    return tuple(each.tag for each in given) if len(given) == n else ()


def called(units: Sequence[int], tags: Tags) -> str:
    """Return ``TIC-101, TIC-103``, ``TIC-101 to TIC-106`` or, without tags, ``loops 1-6``."""
    names = [tag for unit in units if unit < len(tags) and (tag := tags[unit])]
    if not units or len(names) < len(units):
        return loops_text(units)
    together = list(units) == list(range(units[0], units[0] + len(units)))
    return f"{names[0]} to {names[-1]}" if len(names) > _LISTED and together else ", ".join(names)


def tagged(text: str, tags: Tags) -> str:
    """Return a text with ``loop 2`` and ``loops 1, 3`` by their tags, where all have one."""
    return _COUNTED.sub(lambda found: _named(found, tags), text) if tags else text


def cell_tagged(text: str, tags: Tags) -> str:
    """Return the tags of loops that a cell gives by their numbers alone."""
    whole = _CELL.fullmatch(text)
    units = _units(text) if whole and tags else []
    return called(units, tags) if units and _all_tagged(units, tags) else text


def figure_tagged(figure: go.Figure, tags: Tags) -> go.Figure:
    """Return the same figure, loops in its legend and heading by their tags."""
    if not tags:
        return figure
    for trace in figure.data:
        for place in ("name", "legendgroup"):
            if trace[place]:
                trace[place] = tagged(trace[place], tags)
    figure.layout.meta = {key: tagged(text, tags) for key, text in figure.layout.meta.items()}
    return figure


def _named(found: re.Match[str], tags: Tags) -> str:
    units = _units(found["one"] or found["many"])
    return called(units, tags) if _all_tagged(units, tags) else found[0]


def _all_tagged(units: Sequence[int], tags: Tags) -> bool:
    return all(0 <= unit < len(tags) and tags[unit] for unit in units)


def _units(numbers: str) -> list[int]:
    """Return the units (from 0) that a list of numbers and ranges names."""
    found: list[int] = []
    for part in re.split(r", | and ", numbers):
        first, _, last = part.partition("-")
        found.extend(range(int(first) - 1, int(last or first)))
    return found
