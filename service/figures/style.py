"""How every figure looks: colours and dashes, logarithmic axes, templates, plain numbers.

The colours are those of Okabe and Ito (Color Universal Design, 2008) that keep a contrast of
three to one on white and on near-black alike, so a figure serves both schemes and only text and
grid come from the template.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import StrEnum
from functools import cache
from typing import Any

import plotly.graph_objects as go

from service.schemas.complex import Complex
from service.wording import TIME_UNIT

__all__ = [
    "BACKGROUNDS",
    "COLOURS",
    "DASHES",
    "IDENTICAL",
    "NEUTRAL",
    "THIN",
    "TODAY",
    "Theme",
    "frequency_title",
    "line",
    "log_axis",
    "magnitude",
    "numbers",
    "template",
    "time_title",
]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
DASHES = ("solid", "dash", "dashdot", "longdash")
NEUTRAL = "#7A7A7A"
IDENTICAL = {"color": NEUTRAL, "dash": "dot", "width": 2.2}
TODAY = {"color": NEUTRAL, "dash": "longdashdot", "width": 1.6}
THIN = {"color": NEUTRAL, "width": 1}

_WIDE, _NARROW = 2.0, 0.7  # decades from which a label a decade, or labels at 1, 2, 5, do
_DIGITS = 6  # of a drawn number: a pixel in a million
_FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', 'DejaVu Sans', sans-serif"
_TRANSPARENT = "rgba(0,0,0,0)"


class Theme(StrEnum):
    """Scheme of the page that a figure stands on; its own background is transparent."""

    LIGHT = "light"
    DARK = "dark"


# What the figures are meant to stand on, and were checked against.
BACKGROUNDS = {Theme.LIGHT: "#FFFFFF", Theme.DARK: "#14181D"}


def line(index: int) -> dict[str, Any]:
    """Return the line style of series `index`: the first sixteen differ in colour and dash."""
    turn, colour = divmod(index, len(COLOURS))
    return {
        "color": COLOURS[colour],
        "dash": DASHES[(index + turn) % len(DASHES)],
        "width": 2,
    }


def numbers(values: Iterable[float | None]) -> list[float | None]:
    """Return values as plain JSON numbers of six digits, a gap (None) for each that is none."""
    return [
        None if value is None or not math.isfinite(value) else float(f"{value:.{_DIGITS}g}")
        for value in values
    ]


def frequency_title(unit: str) -> str:
    """Return the title of a frequency axis, `unit` being that of time."""
    return f"frequency ω (rad/{unit})"


def time_title(unit: str) -> str:
    """Return the title of a time axis."""
    return "time" if unit == TIME_UNIT else f"time ({unit})"


def magnitude(value: Complex) -> float | None:
    """Return the magnitude of a complex number, None where it does not exist."""
    return None if value.re is None or value.im is None else math.hypot(value.re, value.im)


def log_axis(values: Iterable[float | None], margin: float = 0.0) -> dict[str, Any]:
    """Return a logarithmic axis that shows the magnitudes of `values` at first.

    Labels stand at each decade, at 1, 2 and 5 where there are not two, or where they fit.

    Parameters
    ----------
    values : iterable of float or None
        What is to be seen; zeros and gaps do not count.
    margin : float
        Share of the range that is added at both ends.

    """
    exponents = [math.log10(abs(value)) for value in values if value and math.isfinite(value)]
    low, high = min(exponents, default=0.0), max(exponents, default=1.0)
    margin *= max(high - low, 0.1)
    axis: dict[str, Any] = {
        "type": "log",
        "range": [low - margin, high + margin],
        "exponentformat": "power",
        "minor": {"dtick": "D1", "ticks": "outside", "ticklen": 3},
    }
    if high - low > _WIDE:
        # Powers of ten come out a quarter larger than plain numbers.
        return axis | {"dtick": 1, "tickfont": {"size": 11}}
    if high - low > _NARROW:
        decades = range(math.floor(low - margin), math.ceil(high + margin))
        ticks = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
        return axis | {"tickvals": ticks, "ticktext": [f"{tick:g}" for tick in ticks]}
    return axis


@cache
def template(theme: Theme) -> go.layout.Template:
    """Return the template of a scheme: text, axes, grid and legend; no background."""
    text, axis, grid, box = {
        Theme.LIGHT: ("#1F2328", "#59636E", "#E3E6EA", "#FFFFFF"),
        Theme.DARK: ("#E6EDF3", "#9AA4AF", "#31373E", "#1B2026"),
    }[theme]
    axes = {
        "showline": True,
        "linecolor": axis,
        "ticks": "outside",
        "ticklen": 5,
        "tickcolor": axis,
        "gridcolor": grid,
        "zeroline": False,
        "automargin": True,
        "title": {"standoff": 8},
    }
    return go.layout.Template(
        layout={
            "font": {"family": _FONT, "size": 13, "color": text},
            "paper_bgcolor": _TRANSPARENT,
            "plot_bgcolor": _TRANSPARENT,
            "colorway": list(COLOURS),
            "xaxis": axes,
            "yaxis": axes,
            "margin": {"l": 64, "r": 16, "t": 16, "b": 48},
            "legend": {
                "orientation": "h",
                "yanchor": "bottom",
                "y": 1.01,
                "xanchor": "left",
                "x": 0,
                "bgcolor": _TRANSPARENT,
            },
            "modebar": {"bgcolor": _TRANSPARENT, "color": axis, "activecolor": text},
            "hovermode": "x unified",
            "hoverlabel": {
                "bgcolor": box,
                "bordercolor": axis,
                "font": {"color": text},
                "namelength": -1,
            },
        }
    )
