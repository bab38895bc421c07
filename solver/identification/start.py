"""Where a fit starts: first-order or integrating elements by scan over lag and dead time.

Each input's candidates are simulated once; which of them explain the output together is then a
matter of scalar products, so every candidate of one input is tried against the others' present
choice in one go, input after input, until nothing changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import ElementKind, responses
from solver.identification.row import orthonormal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.identification.fitting import TimeLimits
    from solver.identification.row import Row, Segment

__all__ = ["Scanned", "scan"]

LAGS = 14
DEAD_TIMES = 14
MOST_ROUNDS = 8
NEARLY_NOTHING = 1e-10  # part of a candidate that the others leave: below, it is one of them


@dataclass(frozen=True)
class Scanned:
    """Elements of one form: (log_lag, dead_time) for each input, and what they leave."""

    shapes: tuple[tuple[float, float], ...]
    cost: float


def scan(row: Row, limits: TimeLimits, kind: ElementKind = ElementKind.FIRST) -> Scanned:
    """Return the best combination of elements on a grid.

    Parameters
    ----------
    row : Row
        What they explain.
    limits : TimeLimits
        Of lags and dead times.
    kind : ElementKind
        Form of all of them: FIRST, INTEGRATOR_LAG or INTEGRATOR, whose lag says nothing.

    """
    lags = np.geomspace(limits.shortest, limits.longest, LAGS)
    if kind is ElementKind.INTEGRATOR:
        lags = lags[:1]
    grid = [(math.log(lag), dead) for lag in lags for dead in _dead_times(limits)]
    target, candidates = _projected(row, grid, kind)
    cost, choice = _choose(target, candidates)
    return Scanned(tuple(grid[index] for index in choice), cost)


def _dead_times(limits: TimeLimits) -> list[float]:
    if not limits.dead_time:
        return [0.0]
    low = min(limits.sample / 2, limits.dead_time / 2)
    return [0.0, *(float(v) for v in np.geomspace(low, limits.dead_time * 0.9, DEAD_TIMES - 1))]


def _projected(
    row: Row, grid: list[tuple[float, float]], kind: ElementKind
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return output and each input's candidates, each segment's offset projected out."""
    targets: list[NDArray[np.float64]] = []
    parts: list[list[NDArray[np.float64]]] = [[] for _ in range(row.inputs)]
    for segment in row.segments:
        weight = segment.weight[:, None]
        base = orthonormal(_own_columns(row, segment) * weight)
        output = segment.output * segment.weight
        targets.append(output - base @ (base.T @ output))
        for index, moves in enumerate(segment.changes):
            block = weight * np.hstack(
                [
                    responses(kind, shape[2 - len(kind.shape_names) :], segment.time, *moves)
                    for shape in grid
                ]
            )
            parts[index].append(block - base @ (base.T @ block))
    candidates = []
    for blocks in parts:
        block = np.concatenate(blocks)
        size = np.linalg.norm(block, axis=0)
        candidates.append(block / np.where(size > 0, size, 1.0))
    return np.concatenate(targets), candidates


def _own_columns(row: Row, segment: Segment) -> NDArray[np.float64]:
    """Return the segment's own columns, motions of three lags standing for those of any."""
    own = row.own_columns(segment, (), ())
    if not segment.moving:
        return own
    lags = float(segment.time[-1]) / np.array([2.0, 8.0, 32.0])
    return np.hstack([own, np.exp(-segment.time[:, None] / lags)])


def _choose(
    target: NDArray[np.float64], candidates: list[NDArray[np.float64]]
) -> tuple[float, tuple[int, ...]]:
    inputs = len(candidates)
    best: tuple[float, tuple[int, ...]] = (math.inf, (0,) * inputs)
    size = candidates[0].shape[1]
    # From the strongest input on, and from quick, middling and slow elements everywhere.
    for begin in (None, size // 6, size // 2, 5 * size // 6):
        choice: list[int | None] = [begin] * inputs
        cost = math.inf
        for _ in range(MOST_ROUNDS):
            before = list(choice)
            for index in range(inputs):
                others = [
                    candidates[j][:, c]
                    for j, c in enumerate(choice)
                    if j != index and c is not None
                ]
                choice[index], cost = _against(target, candidates[index], others)
            if choice == before:
                break
        if cost < best[0]:
            best = (cost, tuple(c or 0 for c in choice))
    return best


def _against(
    target: NDArray[np.float64], block: NDArray[np.float64], others: list[NDArray[np.float64]]
) -> tuple[int, float]:
    """Return the candidate that explains most of what the others leave, and the cost then."""
    if others:
        base = orthonormal(np.stack(others, axis=1))
        target = target - base @ (base.T @ target)
        along = base.T @ block
        left = 1.0 - np.einsum("ij,ij->j", along, along)
    else:
        left = np.ones(block.shape[1])
    won = np.where(left > NEARLY_NOTHING, (target @ block) ** 2 / np.maximum(left, 1e-300), 0.0)
    index = int(np.argmax(won))
    return index, float(target @ target - won[index])
