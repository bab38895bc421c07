"""Nominal stability of the closed loop, dead time exact, by counting encirclements.

The closed loop is stable iff det(I + G C), followed along the Nyquist contour, does not encircle
the origin (open-loop stable or integrating plants). The determinant is the product of those of
the blocks (`solver.model.blocks`), each to its multiplicity (`solver.stability.encirclements`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.frequencies import corners, finite_reach, resonances
from solver.model.open_loop import require_supported
from solver.model.plants import ParallelPlant
from solver.stability.encirclements import INFINITELY_MANY, LoopBatch, count_unstable
from solver.stability.neutral import direct_gain, mode_gain, neutral_gain
from solver.stability.singular import lost_directions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = [
    "ClosedLoopPoles",
    "closed_loop_poles",
    "is_stable",
    "unstable_poles",
]

MANY = 3  # different settings on a parallel plant from which the determinant's factors are followed


@dataclass(frozen=True)
class ClosedLoopPoles:
    """Closed-loop poles that keep a loop from being stable.

    `right_half_plane`: how many have a real part >= 0, those at s = 0 apart; `INFINITELY_MANY` for
    dead time with a direct feedthrough gain of 1 or more, which no real plant has, and for more
    than can be counted, where a dead time is very long. `at_origin`: how many are at s = 0. They
    are controllers' integrators that a singular static gain keeps from acting together: the loops
    do not run away but drift, and never settle.
    """

    right_half_plane: int
    at_origin: int

    @property
    def stable(self) -> bool:
        """Whether there are none."""
        return not (self.right_half_plane or self.at_origin)


def is_stable(plant: Plant, loops: Sequence[Controller]) -> bool:
    """Whether the closed loop of `plant` with one controller a unit is stable."""
    return closed_loop_poles(plant, loops).stable


def unstable_poles(plant: Plant, loops: Sequence[Controller]) -> int:
    """Count the closed-loop poles with a real part >= 0, those at s = 0 included.

    Parameters, errors: as for `closed_loop_poles`.
    """
    poles = closed_loop_poles(plant, loops)
    return poles.right_half_plane + poles.at_origin


def closed_loop_poles(plant: Plant, loops: Sequence[Controller]) -> ClosedLoopPoles:
    """Count the closed-loop poles with a real part >= 0.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : sequence of Controller
        One a unit.

    Returns
    -------
    ClosedLoopPoles
        A pole on the imaginary axis away from 0 counts as one in the right half plane.

    Raises
    ------
    UnsupportedPlantError
        As `require_supported`.
    InvalidInputError
        Not one loop a unit.

    """
    require_supported(plant)
    blocks, controllers = group_loops(plant, loops)
    bends = np.sort(np.append(corners(plant, loops=controllers), finite_reach(plant, controllers)))
    integrating = np.array([controller.integral_time is not None for controller in controllers])
    lost = [0] * len(blocks.blocks)
    if integrating.all():  # else the loops without integral action may hold what the others cannot
        lost = lost_directions(blocks)
    multiplicities = [block.multiplicity for block in blocks.blocks]
    at_origin = sum(m * count for m, count in zip(multiplicities, lost, strict=True))
    acting = [controllers[channel] for channel in blocks.blocks[0].channels]
    counts = np.array([[float(len(part)) for part in blocks.parts]])
    if blocks.modes:
        acting, counts = list(loops), np.ones((1, plant.n))
    if neutral_gain(plant, acting, counts)[0] >= 1:
        return ClosedLoopPoles(INFINITELY_MANY, at_origin)
    means, differences = direct_gain(plant, acting, counts)
    total = 0
    for index, block in enumerate(blocks.blocks):

        def loop_gain(omega: NDArray[np.float64], index: int = index) -> NDArray[np.complex128]:
            return _loop_gain(blocks, controllers, omega, index)[:, None]

        def factors(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
            return _factors(blocks, controllers, omega)[:, None]

        direct = means if index == 0 else differences[list(block.channels), None, None]
        if blocks.modes:
            direct = mode_gain(blocks, controllers, index)
        many = isinstance(plant, ParallelPlant) and block.size > MANY
        batch = LoopBatch(
            loop_gain, bends, resonances(plant), direct,
            int(integrating[list(block.channels)].sum()) - lost[index],
            factors if many else None,
            plant.longest_dead_time,
        )  # fmt: skip
        total += block.multiplicity * int(count_unstable(batch)[0])
    total = min(total, INFINITELY_MANY)
    return ClosedLoopPoles(total, at_origin)


def _factors(
    blocks: LoopBlocks, controllers: Sequence[Controller], omega: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Factors of the determinant of a parallel plant's means, (k, m + 1).

    det(I + ((g - i) I + i 1 m^T) C) = prod_a d_a (1 + sum_a m_a i c_a/d_a), d_a = 1 + (g - i) c_a,
    by the matrix determinant lemma.
    """
    plant = blocks.plant
    assert isinstance(plant, ParallelPlant)  # noqa: S101 - for the type checker
    interaction = plant.interaction.response(omega)[:, None]
    c = np.stack([controllers[a].response(omega) for a in blocks.blocks[0].channels], axis=-1)
    apart = 1 + (plant.process.response(omega)[:, None] - interaction) * c
    sizes = np.array([len(part) for part in blocks.parts])
    joint = 1 + (sizes * interaction * c / apart).sum(axis=1, keepdims=True)
    return np.concatenate([apart, joint], axis=1)


def _loop_gain(
    blocks: LoopBlocks,
    controllers: Sequence[Controller],
    omega: NDArray[np.float64],
    index: int,
) -> NDArray[np.complex128]:
    """G C of one block, (k, m, m)."""
    G = blocks.response(omega)[index]
    c = np.stack([controller.response(omega) for controller in controllers], axis=-1)
    return G * c[:, None, list(blocks.blocks[index].channels)]
