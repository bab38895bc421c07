"""Upper bounds of mu of a closed loop from its D-scales, block by block (`solver.model.blocks`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import acting
from solver.mu.structure import BlockStructure, bound_of_scales
from solver.robustness.worst_case import interconnection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks

__all__ = ["greatest_bound", "interconnections"]


def interconnections(
    blocks: LoopBlocks,
    G: NDArray[np.complex128],
    c: NDArray[np.complex128],
    w_I: NDArray[np.complex128],
    w_P: NDArray[np.complex128],
) -> list[NDArray[np.complex128]]:
    """Return N_RP of each block, (k, size + outputs, size + outputs).

    Parameters
    ----------
    blocks : LoopBlocks
        The reduced plant.
    G : (k, rows, widest) complex
        `LoopBlocks.packed`.
    c : (k, controllers) complex
        Controller responses.
    w_I : (k, rows) complex
        Weight of each row's input.
    w_P : (k,) complex
        The weight of performance.

    """
    return [
        interconnection(
            G[:, first : first + block.size, : block.size],
            acting(c, block.channels),
            w_I[:, first : first + block.size],
            w_P,
            block.outputs,
        )
        for block, first in zip(blocks.blocks, blocks.layout[2], strict=False)
    ]


def greatest_bound(
    blocks: LoopBlocks,
    matrices: Sequence[NDArray[np.complex128]],
    d: NDArray[np.float64],
    *,
    performance: bool,
) -> NDArray[np.float64]:
    """Return the upper bound of mu that given D-scales prove, (k,): the greatest of the blocks.

    Parameters
    ----------
    blocks : LoopBlocks
        The reduced plant.
    matrices : sequence of (k, size + outputs, size + outputs) complex
        N_RP of each block.
    d : (k, scales)
        D-scales, which blocks may share.
    performance : bool
        Robust performance, all of N_RP; else robust stability, its first block w_I C S G.

    """
    found = []
    for block, N in zip(blocks.blocks, matrices, strict=True):
        used = sorted(set(block.scales))
        scales = tuple(used.index(scale) for scale in block.scales)
        rows = block.outputs if performance else 0
        part = N if performance else N[:, : block.size, : block.size]
        found.append(bound_of_scales(part, d[:, used], BlockStructure(scales, rows)).mu)
    return np.asarray(np.max(found, axis=0))
