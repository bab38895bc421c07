"""The figures of the published sources, each drawn anew by one name.

What they show is data: a file of definitions for each source beside this one. A figure is some
runs of the analyses that everybody has, laid over each other.
"""

from service.gallery.definitions import Figure, Source, figure_names, find_figure, sources
from service.gallery.drawing import draw
from service.gallery.runs import Runs, value_at

__all__ = [
    "Figure",
    "Runs",
    "Source",
    "draw",
    "figure_names",
    "find_figure",
    "sources",
    "value_at",
]
