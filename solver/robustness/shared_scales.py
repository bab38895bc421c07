"""D-scales that the blocks of a plant under a full controller share.

The two modes of a parallel plant are scalar, and N of each is of rank one: with x = d^2 it demands

    (alpha x + beta) (1 + gamma/x) <= mu^2,   alpha = |w_I C S|^2, beta = |w_P S|^2, gamma = |G|^2.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks

__all__ = ["best_scales"]


def best_scales(
    blocks: LoopBlocks,
    matrices: list[NDArray[np.complex128]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Upper bound of mu over all blocks, and the scales that prove it.

    Parameters
    ----------
    blocks : LoopBlocks
        As of `central_blocks`.
    matrices : list of (k, 2 m, 2 m) complex
        N of each block.

    Returns
    -------
    mu : (k,)
        min over D of the greatest sigma_max(D N D^-1).
    x : (k, scales)
        Squared scales.

    """
    if not blocks.plant.interchangeable:
        block = blocks.blocks[0]
        bound = upper_bound(matrices[0], BlockStructure(block.scales, block.size))
        return bound.mu, bound.d**2
    squares = [np.abs(N) ** 2 for N in matrices]
    square, x = _shared_scale(
        # The terms of |D N D^-1|^2 by powers of x; N is of rank one.
        np.stack([square[:, 0, 1] for square in squares], axis=-1),
        np.stack([square[:, 0, 0] + square[:, 1, 1] for square in squares], axis=-1),
        np.stack([square[:, 1, 0] for square in squares], axis=-1),
    )
    return np.sqrt(square), x[:, None]


def _shared_scale(
    rise: NDArray[np.float64], level: NDArray[np.float64], fall: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least over x of the greatest rise x + level + fall/x of each row (k, blocks), and x.

    Each is quasi-convex, so the least of the greatest is at a minimum of one or where two cross.
    """
    tiny = np.finfo(float).tiny

    def greatest(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((rise * x[:, None] + level + fall / x[:, None]).max(axis=1))

    points = [np.sqrt((fall[:, j] + tiny) / (rise[:, j] + tiny)) for j in range(rise.shape[1])]
    for i, j in itertools.combinations(range(rise.shape[1]), 2):
        a, b, c = (each[:, i] - each[:, j] for each in (rise, level, fall))
        root = b + np.copysign(np.sqrt(np.maximum(b * b - 4 * a * c, 0)), b)
        with np.errstate(divide="ignore", invalid="ignore"):
            for x in (-root / (2 * a), -2 * c / root):
                points.append(np.where(np.isfinite(x) & (x > 0), x, points[0]))
    values = np.stack([greatest(x) for x in points])
    best = values.argmin(axis=0)
    each = np.arange(best.size)
    return values[best, each], np.stack(points)[best, each]
