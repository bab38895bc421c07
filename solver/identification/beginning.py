"""How records begin: at rest, just switched on, or with outputs that are still on their way.

Where no input moves for some samples, the outputs show it. Else a plant that rests and one that
does not are fitted, and what the second explains better decides.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum, auto
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import ElementKind
from solver.identification.fitting import fit
from solver.identification.problem import Start, limits, rows, thinned
from solver.identification.selection import begin
from solver.identification.start import scan
from solver.identification.weighting import coloured

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.fitting import TimeLimits
    from solver.identification.problem import PlantStructure
    from solver.identification.record import Record
    from solver.identification.row import Row, Segment, Solved

__all__ = ["starts"]

# A start that moves by so many standard deviations of its scatter before any input does is no rest.
MOVING = 6.0
QUIET_SAMPLES = 8
FEWEST = 3  # readings that show a speed and its scatter
DEAD_TIME = 0.1  # of the record: the longest that is tried
# The least part of an output's range that counts as a move.
VISIBLE = 0.05
TRIED = 1000  # readings
# Free motions that a wrong form or a nonlinear plant explains cost the knowledge that the plant
# rested: likelier by the criterion of Schwarz is not enough. An output must be seen to move
# at once; and they must leave a quarter of the squares, or the residual of rest must rise there.
MUCH_LESS = 4.0
EARLY = 20  # the part of the record that is its start


def starts(
    records: Sequence[Record], structure: PlantStructure, *, drift: bool = False
) -> list[Start]:
    """Return how each record begins.

    Parameters
    ----------
    records : sequence of Record
        Looked at one by one.
    structure : PlantStructure
        Which elements are shared.
    drift : bool
        Whether the outputs may drift.

    """
    return [_start(record, structure, drift=drift) for record in records]


def _start(record: Record, structure: PlantStructure, *, drift: bool) -> Start:
    def thin(start: Start) -> list[Row]:
        return [thinned(row, TRIED) for row in rows([record], [start], structure, drift=drift)]

    seen = _before_any_move(record, rows([record], [Start.HELD], structure, drift=drift))
    box = limits([record])
    rest = Start.HELD
    if any(values[0] for values in record.inputs.values()):
        rest = min((Start.HELD, Start.FROM_ZERO), key=lambda one: _cost(thin(one), box))
    elif seen is Seen.MOTION:
        return Start.MOVING
    if seen is Seen.REST:
        return rest
    still, moving = thin(rest), thin(Start.MOVING)
    if not any(_leaves(segment) for row in still for segment in row.segments):
        return rest
    pairs = zip(still, moving, strict=True)
    return Start.MOVING if any(_moves(a, b, box) for a, b in pairs) else rest


class Seen(Enum):
    """What the outputs show before any input moves."""

    REST = auto()
    MOTION = auto()
    NEITHER = auto()


def _before_any_move(record: Record, held: Sequence[Row]) -> Seen:
    """Return what the readings before the first move of an input show."""
    moved = [np.flatnonzero(np.diff(values)) for values in record.inputs.values()]
    first = record.time[min((int(at[0]) + 1 for at in moved if at.size), default=-1)]
    flat = True
    for segment in (segment for row in held for segment in row.segments):
        quiet = segment.time < first - record.time[0]
        if np.count_nonzero(quiet) < QUIET_SAMPLES:
            return Seen.NEITHER
        rise, error = _rise(segment.time[quiet], segment.output[quiet])
        visible = VISIBLE * float(np.ptp(segment.output))
        # Coloured noise wanders too: its steps, not its level, are the yardstick's floor.
        if abs(rise) > max(MOVING * error, visible):
            return Seen.MOTION
        flat = flat and abs(rise) + 2 * error <= visible
    return Seen.REST if flat else Seen.NEITHER


def _cost(tried: Sequence[Row], box: TimeLimits) -> float:
    """Return the sum over rows of the logarithm of what lags or integrators leave."""
    cost = 0.0
    for row in tried:
        left = math.inf
        for form in (ElementKind.FIRST, ElementKind.INTEGRATOR):
            shapes = [shape[2 - len(form.shape_names) :] for shape in scan(row, box, form).shapes]
            left = min(left, fit(row, [form] * row.inputs, shapes, box).cost)
        cost += math.log(max(left, 1e-300))
    return cost


def _rise(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """Return by how much a straight line rises over a stretch, with its standard error."""
    t = (time - time.mean()) / np.ptp(time)
    rise = float(t @ (values - values.mean()) / (t @ t))
    left = values - values.mean() - rise * t
    return rise, float(np.linalg.norm(left)) / float(np.linalg.norm(t) * np.sqrt(t.size))


def _moves(still: Row, moving: Row, box: TimeLimits) -> bool:
    """Whether a plant that did not rest explains a row, and one that rested does not.

    Second-order elements, or integrators with a lag: what a poorer form leaves looks like a
    motion. Readings are weighted by the colour of what rest leaves (see `selection`).
    """
    forms = (ElementKind.SECOND, ElementKind.INTEGRATOR_LAG)
    rest = min(
        (begin(still, [form] * still.inputs, box) for form in forms), key=lambda one: one.cost
    )
    kinds = rest.kinds
    free = min(
        (
            fit(moving, kinds, shapes, box)
            for shapes in (rest.shapes, begin(moving, kinds, box).shapes)
        ),
        key=lambda one: one.cost,
    )
    weighted = coloured(still, rest) or still
    left = fit(weighted, kinds, rest.shapes, box).cost
    right = min(
        fit(_as_weighted(moving, weighted), kinds, shapes, box).cost
        for shapes in (rest.shapes, free.shapes)
    )
    count = still.readings
    more = sum(kind.motions for kind in kinds) * len(still.segments)
    if left <= 0 or (right > 0 and count * math.log(left / right) < more * math.log(count)):
        return False
    return rest.cost > MUCH_LESS * free.cost or any(
        _early_rise(segment, residual, max(segment.time.size // EARLY, QUIET_SAMPLES))
        for segment, residual in zip(still.segments, _residuals(still, rest), strict=True)
    )


def _as_weighted(row: Row, like: Row) -> Row:
    """Return the row with the weights and colours of another."""
    pairs = zip(row.segments, like.segments, strict=True)
    return replace(
        row, segments=tuple(replace(a, weight=b.weight, colour=b.colour) for a, b in pairs)
    )


def _residuals(row: Row, solved: Solved) -> list[NDArray[np.float64]]:
    triples = zip(row.segments, solved.blocks, row.own_parts(solved), strict=True)
    return [segment.output - block @ solved.gains - part for segment, block, part in triples]


def _leaves(segment: Segment) -> bool:
    """Whether the first readings leave rest at a speed that is visible within a dead time."""
    first = min((float(at[0]) for at, _ in segment.changes if at.size), default=math.inf)
    count = int(np.clip(np.count_nonzero(segment.time <= first), FEWEST, QUIET_SAMPLES))
    rise, _ = _rise(segment.time[:count], segment.output[:count])
    speed = abs(rise) / float(np.ptp(segment.time[:count]))
    return speed * float(segment.time[-1]) * DEAD_TIME > VISIBLE * float(np.ptp(segment.output))


def _early_rise(segment: Segment, values: NDArray[np.float64], count: int) -> bool:
    """Whether values over the first readings rise or fall visibly."""
    rise, _ = _rise(segment.time[:count], values[:count])
    return abs(rise) > VISIBLE * float(np.ptp(segment.output))
