"""A plant with its loops as small independent blocks that share their D-scales.

For a parallel plant whose loops fall into groups of equal settings, with sizes m_1..m_G, the
scaled problem splits exactly, by permutation symmetry and convexity of the scaling, into

- one G x G block, the group means, with plant entries (g - i) delta_ab + i sqrt(m_a m_b);
- for each group with m >= 2 a scalar block with plant g - i, standing for m - 1 differences
  within the group.

All share one D-scale per group (diagonal uncertainty) or one for all (full-block uncertainty).
A general matrix plant is a single block. What works with blocks need not know which it was.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.plants import ParallelPlant, Plant
from solver.model.weights import Structure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.model.controllers import Controller

__all__ = ["Block", "Layout", "LoopBlocks", "group_loops", "reduce"]


class Layout(NamedTuple):
    """Where the rows of all blocks, below each other, belong; a named tuple for compiled code.

    Attributes
    ----------
    channels, scales : (rows,)
        Controller and D-scale of each row.
    first : (blocks + 1,)
        First row of each block, with the number of rows at the end.

    """

    channels: NDArray[np.int64]
    scales: NDArray[np.int64]
    first: NDArray[np.int64]


@dataclass(frozen=True)
class Block:
    """One independent part of the loop.

    Parameters
    ----------
    channels : tuple of int
        Controller of each channel of the block.
    scales : tuple of int
        D-scale of each channel.
    multiplicity : int
        How often the block occurs in the full loop.

    """

    channels: tuple[int, ...]
    scales: tuple[int, ...]
    multiplicity: int

    @property
    def size(self) -> int:
        """Number of channels."""
        return len(self.channels)


@dataclass(frozen=True)
class LoopBlocks:
    """The blocks of a plant, its loops being grouped.

    Parameters
    ----------
    plant : Plant
        The plant they stand for.
    groups : tuple of tuples of int
        Units that share a controller; group j uses controller j.
    blocks : tuple of Block
        The first one carries the group means (all of a matrix plant).
    n_scales : int
        Number of different D-scales.

    """

    plant: Plant
    groups: tuple[tuple[int, ...], ...]
    blocks: tuple[Block, ...]
    n_scales: int

    @property
    def n_controllers(self) -> int:
        """Number of different controllers."""
        return len(self.groups)

    def response(self, omega: ArrayLike) -> tuple[NDArray[np.complex128], ...]:
        """Plant of each block at `omega` (rad per time unit): (k, m, m) complex each."""
        return self(1j * np.atleast_1d(np.asarray(omega, dtype=float)))

    def __call__(self, s: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], ...]:
        """Plant of each block at the complex points `s` (k,): (k, m, m) complex each."""
        if not isinstance(self.plant, ParallelPlant):
            n = self.plant.n
            G = np.empty((s.size, n, n), dtype=complex)
            for row in range(n):
                for column in range(n):
                    G[:, row, column] = self.plant.element(row, column)(s)
            return (G,)
        interaction = self.plant.interaction(s) if self.plant.n > 1 else np.zeros(s.shape)
        difference = np.asarray(self.plant.process(s) - interaction)
        sizes = np.sqrt([len(group) for group in self.groups])
        mean = (
            difference[:, None, None] * np.eye(sizes.size)
            + np.asarray(interaction)[:, None, None] * sizes[:, None] * sizes
        )
        single = difference[:, None, None]
        return (mean, *(single for _ in self.blocks[1:]))

    @cached_property
    def layout(self) -> Layout:
        """Controller and scale of each row, and the first row of each block."""
        channels = np.array([c for block in self.blocks for c in block.channels])
        scales = np.array([s for block in self.blocks for s in block.scales])
        first = np.cumsum([0, *(block.size for block in self.blocks)])
        return Layout(channels, scales, first)

    def packed(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Plants of all blocks below each other, (k, rows, widest block) complex."""
        return self.packed_at(1j * np.atleast_1d(np.asarray(omega, dtype=float)))

    def packed_at(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the same at the complex points `s` (k,)."""
        responses = self(s)
        first = self.layout.first
        widest = max(block.size for block in self.blocks)
        G = np.zeros((responses[0].shape[0], first[-1], widest), dtype=complex)
        for block, response, row in zip(self.blocks, responses, first, strict=False):
            G[:, row : row + block.size, : block.size] = response
        return G

    def expand(self, controllers: Sequence[Controller]) -> tuple[Controller, ...]:
        """One controller a unit from one a group."""
        loops: list[Controller | None] = [None] * self.plant.n
        for group, controller in zip(self.groups, controllers, strict=True):
            for unit in group:
                loops[unit] = controller
        return tuple(loop for loop in loops if loop is not None)


def reduce(
    plant: Plant,
    groups: Sequence[Sequence[int]],
    structure: Structure = Structure.DIAGONAL,
) -> LoopBlocks:
    """Return the independent blocks of `plant` under loops that are equal within `groups`.

    Parameters
    ----------
    plant : Plant
        Parallel or general.
    groups : sequence of sequences of int
        A partition of the units 0..n-1.
    structure : Structure
        Structure of the input uncertainty.

    Raises
    ------
    InvalidInputError
        `groups` is no partition of the units.

    """
    partition = tuple(tuple(group) for group in groups)
    if sorted(unit for group in partition for unit in group) != list(range(plant.n)):
        message = "the groups must hold each unit exactly once"
        raise InvalidInputError(message, "/groups")
    full = structure is Structure.FULL
    if not isinstance(plant, ParallelPlant):
        owner = {unit: index for index, group in enumerate(partition) for unit in group}
        channels = tuple(owner[unit] for unit in range(plant.n))
        scales = (0,) * plant.n if full else tuple(range(plant.n))
        block = Block(channels, scales, 1)
        return LoopBlocks(plant, partition, (block,), 1 if full else plant.n)
    size = len(partition)
    blocks = [Block(tuple(range(size)), (0,) * size if full else tuple(range(size)), 1)]
    blocks += [
        Block((index,), (0,) if full else (index,), len(group) - 1)
        for index, group in enumerate(partition)
        if len(group) > 1
    ]
    return LoopBlocks(plant, partition, tuple(blocks), 1 if full else size)


def group_loops(
    plant: Plant,
    loops: Sequence[Controller],
    structure: Structure = Structure.DIAGONAL,
) -> tuple[LoopBlocks, tuple[Controller, ...]]:
    """Return the blocks for given loops, equal settings sharing a group, and their controllers.

    Raises
    ------
    InvalidInputError
        Not one loop a unit.

    """
    if len(loops) != plant.n:
        message = f"{len(loops)} loops for a plant of {plant.n} units"
        raise InvalidInputError(message, "/loops")
    groups: dict[Controller, list[int]] = {}
    for unit, loop in enumerate(loops):
        groups.setdefault(loop, []).append(unit)
    return reduce(plant, list(groups.values()), structure), tuple(groups)
