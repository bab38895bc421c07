"""Results as lines and grids of text: what the command line prints, before anything of colours.

The analyses say here what people read; `service.cli.console` gives it its form.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from service.loop_tags import Tags, cell_tagged, tagged
from service.schemas.peaks import Guarantee, Peaks
from service.wording import forms, guarantee_text, number, unit_of
from solver.model.controllers import Controller

__all__ = [
    "CURVES",
    "Grid",
    "Line",
    "Part",
    "form_parts",
    "in_unit",
    "matrix",
    "named_loops",
    "peaks_grid",
    "proof_lines",
    "warning_lines",
]

ROUNDED = 1e-6  # above 1, where a tuning ends to rounding

# Name and field of the three curves of mu, and what a peak at or below 1 and one above mean.
CURVES = (
    ("robust performance", "robust_performance", ("demand met", "above 1: demand not met")),
    ("robust stability", "robust_stability", ("always stable", "above 1: may be unstable")),
    ("nominal performance", "nominal_performance", ("(without uncertainty)",) * 2),
)


@dataclass(frozen=True)
class Line:
    """A line of text, and how much it should catch the eye."""

    text: str = ""
    style: Literal["plain", "strong", "alarm", "warning"] = "plain"


@dataclass(frozen=True)
class Grid:
    """A table.

    Parameters
    ----------
    heads : sequence of str
        Heads of the columns.
    rows : sequence of sequence of str
        Rows, a text for each column.
    left : set of int
        Columns that begin at the left, as words do; numbers end at the right.

    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: frozenset[int] = frozenset({0})


Part = Line | Grid

_TIMES = frozenset({"τP", "τI", "τD", "τF", "Ti", "Td", "Tf", "Ki", "Kd"})
_DURATIONS = frozenset(
    {"rise", "settle", "settling", "later change at", "delay", "from", "to", "period"}
    | {"half period", "dead time"}
)
_RATES = frozenset({"bandwidth", "ωu"})
_OF_LOOPS = frozenset({"loop", "loops", "Loop", "worst with units", "settings of output"})
_SETTING_TIME = re.compile(r", (?:integral|derivative|filter) time$")  # in ranges, a line each
_PARAMETERS = frozenset(  # in cells, a line each
    {"time constant", "time constant sum", "first time constant", "second time constant"}
    | {"dead time"}
)


def in_unit(parts: Sequence[Part], unit: str | None) -> Sequence[Part]:
    """Return the same parts with the unit of time named where one stands; None: it has no name."""
    if unit is None:
        return parts

    def named(text: str) -> str:
        text = re.sub(r"rad(/time| per time unit)\b", f"rad/{unit}", text)
        before = "τP =|Simulated up to|Ended at|Period|held for|Ti"
        before += r"|dead time is told only to lie between [-+.e\d]+ and"
        return re.sub(rf"((?:{before}) [-+.e\d]*\d)", rf"\1 {unit}", text)

    def head(text: str) -> str:
        if text in _DURATIONS:
            return f"{text}, {unit}"
        if text in _RATES:
            return f"{text}, rad/{unit}"
        return text + unit_of(text, unit) if text in _TIMES else named(text)

    def cells(row: Sequence[str]) -> list[str]:
        return [
            f"{cell}, {unit}" if cell in _PARAMETERS or _SETTING_TIME.search(cell) else cell
            for cell in row
        ]

    return [
        Line(named(part.text), part.style)
        if isinstance(part, Line)
        else Grid([*map(head, part.heads)], [*map(cells, part.rows)], part.left)
        for part in parts
    ]


def named_loops(parts: Sequence[Part], tags: Tags) -> Sequence[Part]:
    """Return the same parts with loops by their tags, where they have some."""
    if not tags:
        return parts

    def row(heads: Sequence[str], cells: Sequence[str]) -> list[str]:
        return [
            cell_tagged(cell, tags) if head in _OF_LOOPS else tagged(cell, tags)
            for head, cell in zip(heads, cells, strict=True)
        ]

    return [
        Line(tagged(part.text, tags), part.style)
        if isinstance(part, Line)
        else Grid(
            [tagged(head, tags) for head in part.heads],
            [row(part.heads, cells) for cells in part.rows],
            part.left,
        )
        for part in parts
    ]


def matrix(
    title: str, rows: Sequence[Sequence[float | None]], row_name: str, column_name: str
) -> Grid:
    """Return a matrix as a grid; rows and columns are counted from 1."""
    return Grid(
        [title, *(f"{column_name} {column + 1}" for column in range(len(rows[0])))],
        [[f"{row_name} {index + 1}", *map(number, row)] for index, row in enumerate(rows)],
    )


def peaks_grid(peaks: Peaks) -> Grid:
    """Return the peaks of the three curves of mu, and what each means."""
    rows = []
    for title, name, (within, above) in CURVES:
        peak = getattr(peaks, name)
        meaning = within if peak.value is not None and peak.value <= 1 + ROUNDED else above
        rows.append((title, number(peak.value), number(peak.omega), meaning))
    heads = ("peak of μ", "value", "ω (rad/time)", "over the whole set of plants")
    return Grid(heads, rows, frozenset({0, 3}))


def proof_lines(
    certificate: Mapping[str, Any] | None, guarantee: Guarantee | None
) -> Iterator[Line]:
    """Yield what a certificate proves, or without one what the guarantee says."""
    if certificate is None and guarantee is not None:
        yield Line(guarantee_text(guarantee))
    if certificate is not None:
        yield Line(
            f"Proven: stable, and μ of robust performance at most {certificate['gamma']:.6g} at "
            f"every frequency ({len(certificate['intervals'])} intervals)."
        )


def warning_lines(warnings: Sequence[str]) -> Iterator[Line]:
    """Yield a line for each warning."""
    for warning in warnings:
        yield Line(f"Warning: {warning}", "warning")


def form_parts(loops: Sequence[tuple[str, Controller]]) -> Iterator[Part]:
    """Yield a formula and a grid for each form; the same named controllers in all of them."""
    for form in forms([controller for _, controller in loops]):
        blank = ("",) * (len(form.symbols) - 1)
        rows = [
            (name, row, *blank) if isinstance(row, str) else (name, *map(number, row))
            for (name, _), row in zip(loops, form.rows, strict=True)
        ]
        yield Line(f"{form.name.capitalize()} form: {form.formula}")
        yield Grid(("loop", *form.symbols), rows)
