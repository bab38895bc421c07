"""Lines and grids of text in a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.loop_tags import Tags
from service.printing import Line, Part, in_unit, named_loops

__all__ = ["show", "to_rich"]

_STYLES = {"plain": "", "strong": "bold", "alarm": "bold red", "warning": "yellow"}


def show(parts: Sequence[Part], unit: str | None = None, tags: Tags = ()) -> None:
    """Print `parts` on standard output, times in `unit`, loops by `tags`, where those are named."""
    Console().print(to_rich(named_loops(in_unit(parts, unit), tags)))


def to_rich(parts: Sequence[Part]) -> RenderableType:
    """Return `parts` as Rich prints them."""
    return Group(*map(_rendered, parts))


def _rendered(part: Part) -> RenderableType:
    if isinstance(part, Line):
        return Text(part.text, style=_STYLES[part.style])
    table = Table(box=SIMPLE_HEAD)
    for index, head in enumerate(part.heads):
        table.add_column(head, justify="left" if index in part.left else "right")
    for row in part.rows:
        table.add_row(*row)
    return table
