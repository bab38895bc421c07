"""What a figure of the gallery is made of, as it stands in the files of definitions."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "Curve",
    "Figure",
    "Number",
    "Panel",
    "Run",
    "Source",
    "figure_names",
    "find_figure",
    "sources",
]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Run(_Model):
    """A request to an analysis; a string ``$name`` in it stands for the part of that name."""

    analysis: str
    request: dict[str, Any]


class Curve(_Model):
    """A curve of a panel, by pointers into the result of a run; see `service.gallery.runs`."""

    name: str
    run: str
    x: str
    y: str
    style: int | Literal["thin", "dotted"] = 0


class Level(_Model):
    """A horizontal line, at a number or at one in a result."""

    text: str
    value: float | None = None
    run: str | None = None
    at: str | None = None


class Panel(_Model):
    """One of the panels of a figure, which stand one below the other."""

    y: str
    log: bool = False
    range: tuple[float, float] | None = None
    curves: tuple[Curve, ...]
    levels: tuple[Level, ...] = ()


class Number(_Model):
    """A number of the figure: what the source states of it, and where ours stands."""

    text: str
    stated: str = ""
    run: str
    at: str


class Figure(_Model):
    """A figure of a source."""

    name: str
    title: str
    stated: str = Field(description="What the source says of it.")
    axis: Literal["time", "frequency", "real"] = "time"
    range: tuple[float, float] | None = None
    panels: tuple[Panel, ...]
    numbers: tuple[Number, ...]


class Source(_Model):
    """A source, its runs and its figures."""

    title: str
    time_unit: str
    parts: dict[str, Any]
    runs: dict[str, Run]
    figures: tuple[Figure, ...]


@cache
def sources() -> tuple[Source, ...]:
    """Return the sources that have figures, in the order of the gallery."""
    folder = files("service") / "gallery"
    names = ("skogestad", "astrom", "johansson")
    return tuple(
        Source.model_validate(json.loads((folder / f"{name}.json").read_text("utf-8")))
        for name in names
    )


def figure_names() -> list[str]:
    """Return the names of all figures."""
    return [figure.name for source in sources() for figure in source.figures]


def find_figure(name: str) -> tuple[Source, Figure]:
    """Return a figure with its source.

    Raises
    ------
    KeyError
        There is none of that name.

    """
    for source in sources():
        for figure in source.figures:
            if figure.name == name:
                return source, figure
    raise KeyError(name)
