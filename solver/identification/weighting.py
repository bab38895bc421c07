"""What each reading of a row counts: by the level and the colour of its segment's residual."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.colour import colour_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.identification.row import Row, Segment, Solved

__all__ = ["coloured", "levelled"]

# Below this ratio the noise of a segment is that of its neighbours, whatever the estimate says.
QUIETEST = 0.1


def levelled(row: Row, solved: Solved) -> Row:
    """Return the row with each segment weighted by its own residual."""
    if len(row.segments) == 1:
        return row
    own = row.own_parts(solved)
    levels = []
    for segment, block, part in zip(row.segments, solved.blocks, own, strict=True):
        left = (segment.output - block @ solved.gains - part)[segment.weight > 0]
        levels.append(float(np.sqrt(np.mean(left**2))) if left.size else 0.0)
    return _weighted(row, row.segments, levels)


def coloured(row: Row, solved: Solved) -> Row | None:
    """Return the row with each segment weighted by the colour of its residual, if any has one."""
    own = row.own_parts(solved)
    segments, levels = [], []
    for segment, block, part in zip(row.segments, solved.blocks, own, strict=True):
        seen = segment.weight > 0
        left = segment.output - block @ solved.gains - part
        colour = colour_of(segment.time, seen, left)
        white = left if colour is None else colour.whitened(segment.time, seen, left)
        levels.append(float(np.sqrt(np.mean(white[seen] ** 2))) if np.any(seen) else 0.0)
        segments.append(replace(segment, colour=colour))
    if all(segment.colour is None for segment in segments):
        return None
    return _weighted(row, segments, levels)


def _weighted(row: Row, segments: Sequence[Segment], levels: Sequence[float]) -> Row:
    """Return the row with these segments, each weighted by its level of the residual."""
    typical = float(np.median(levels)) or 1.0
    return replace(
        row,
        segments=tuple(
            replace(segment, weight=(segment.weight > 0) / max(level / typical, QUIETEST))
            for segment, level in zip(segments, levels, strict=True)
        ),
    )
