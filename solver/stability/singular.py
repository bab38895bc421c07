"""Gains that are singular to working accuracy, and the closed-loop poles at s = 0 they leave.

Integral action in a loop puts a pole at s = 0 into the open loop. It moves away in the closed loop
only if the static gain of the plant lets the controllers hold all outputs independently; in each
direction in which the gain is singular one stays, and det(I + G C) does not show it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from solver.model.plants import ParallelPlant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.plants import Plant

__all__ = [
    "SINGULAR_CONDITION",
    "equilibrate",
    "equilibration",
    "has_empty_line",
    "is_singular",
    "lost_directions",
    "origin_poles",
]

# Elements of the relative gain array grow with the condition number of the equilibrated gain;
# beyond this one fewer than three digits of them would be left.
SINGULAR_CONDITION = 1e13

_Number = TypeVar("_Number", bound=np.inexact[Any])


def is_singular(matrix: NDArray[np.inexact[Any]]) -> bool:
    """Whether the square matrix is singular to working accuracy, units of its signals apart."""
    if has_empty_line(matrix):
        return True
    return bool(np.linalg.cond(equilibrate(matrix)) > SINGULAR_CONDITION)


def origin_poles(plant: Plant, counts: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the closed-loop poles at s = 0 of several sets of loops with integral action, (k,).

    Parameters
    ----------
    plant : Plant
        The plant with all its units.
    counts : (k, controllers)
        Parallel plant: units that each controller runs. Any other: 0 for a loop in manual.

    """
    if not isinstance(plant, ParallelPlant):
        return _matrix_origin_poles(plant, counts > 0)
    units = counts.sum(axis=1).astype(np.int64)
    lost_sum, lost_difference = _parallel_lost_directions(plant, units)
    return np.asarray(lost_sum + (units - 1) * int(lost_difference))


def lost_directions(blocks: LoopBlocks) -> list[int]:
    """Return how many directions of the static gain each block lacks."""
    plant = blocks.plant
    if blocks.modes:
        return [_lost_of_mode(blocks, index) for index in range(len(blocks.blocks))]
    if not isinstance(plant, ParallelPlant):
        return [int(origin_poles(plant, np.ones((1, plant.n)))[0])]
    lost_sum, lost_difference = _parallel_lost_directions(plant, np.array([plant.n]))
    difference = int(lost_difference)
    means = int(lost_sum[0]) + (len(blocks.groups) - 1) * difference
    return [means, *[difference] * (len(blocks.blocks) - 1)]


def _lost_of_mode(blocks: LoopBlocks, index: int) -> int:
    """Return how many directions of the static gain one mode of a ring lacks.

    Integrating plants are not looked at: none are counted.
    """
    terms = blocks.terms(index)
    gain = np.array([[sum(f * e.static_gain for f, e in entry) for entry in row] for row in terms])
    if not np.isfinite(gain).all():
        return 0
    # Against what cancels in it: a mode that is weaker than the others is none the worse.
    size = max(sum(abs(f * e.static_gain) for f, e in entry) for row in terms for entry in row)
    values = np.linalg.svd(gain, compute_uv=False)
    return int(np.count_nonzero(values * SINGULAR_CONDITION <= size))


def _parallel_lost_directions(
    plant: ParallelPlant, units: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], bool]:
    """Whether the sum of that many `units` has no static gain, (k,), and whether differences have.

    The gain of the sum is g + (m - 1) i, that of the m - 1 differences g - i. Integrating units
    count where g and i are the same function.

    Parameters
    ----------
    plant : ParallelPlant
        The plant with all its units.
    units : (k,)
        m, at least 1.

    """
    if plant.n == 1:
        return np.zeros(units.shape, dtype=bool), False
    own, other = plant.process.static_gain, plant.interaction.static_gain
    if not (np.isfinite(own) and np.isfinite(other)):
        return np.zeros(units.shape, dtype=bool), plant.process == plant.interaction
    size = abs(own) + (units - 1) * abs(other)
    lost_sum = np.abs(own + (units - 1) * other) * SINGULAR_CONDITION <= size
    return lost_sum, abs(own - other) * SINGULAR_CONDITION <= abs(own) + abs(other)


def _matrix_origin_poles(plant: Plant, in_service: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Count the closed-loop poles at s = 0 with those loops `in_service` (k, n), (k,).

    Integrating plants are not looked at: none are counted.
    """
    gain = plant.static_gain()
    counts = np.zeros(len(in_service), dtype=np.int64)
    if not np.isfinite(gain).all():
        return counts
    masks, which = np.unique(in_service, axis=0, return_inverse=True)
    for index, mask in enumerate(masks):
        part = gain[np.ix_(mask, mask)]
        if is_singular(part):
            counts[which.ravel() == index] = max(mask.sum() - np.linalg.matrix_rank(part), 1)
    return counts


def has_empty_line(matrices: NDArray[np.inexact[Any]]) -> NDArray[np.bool_]:
    """Whether a row or column of each matrix (..., n, n) is zero."""
    present = matrices != 0
    filled = np.all(np.any(present, axis=-1), axis=-1) & np.all(np.any(present, axis=-2), axis=-1)
    return np.asarray(~filled)


def equilibrate(matrices: NDArray[_Number]) -> NDArray[_Number]:
    """Scale rows and columns to magnitude one (Ruiz 2001, infinity norm); zero ones stay."""
    return equilibration(matrices)[0]


def equilibration(matrices: NDArray[_Number]) -> tuple[NDArray[_Number], NDArray[np.float64]]:
    """Return `equilibrate` of matrices (..., m, n) and the factors of their columns (..., 1, n)."""
    core = matrices
    factors = np.ones((*matrices.shape[:-2], 1, matrices.shape[-1]))
    # A round halves the distance to one in logarithm: 2^-12 of 24 decades is a factor 1.01.
    for _ in range(12):
        sizes = (np.max(np.abs(core), axis=axis, keepdims=True) for axis in (-1, -2))
        row, column = (np.sqrt(np.where(size == 0, 1.0, size)) for size in sizes)
        core = cast("NDArray[_Number]", core / row / column)
        factors = factors / column
    return core, factors
