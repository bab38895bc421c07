"""Nominal stability of the closed loop, dead time exact, by counting encirclements.

The closed loop is stable iff det(I + G C), followed along the Nyquist contour, does not encircle
the origin (open-loop stable or integrating plants). The determinant is the product of those of
the blocks (`solver.model.blocks`), each to its multiplicity (`solver.stability.encirclements`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.errors import UnsupportedPlantError
from solver.model.frequencies import corners, resonances
from solver.model.plants import ParallelPlant
from solver.stability.encirclements import Batch, count_unstable
from solver.stability.singular import matrix_origin_poles, parallel_origin_poles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = [
    "INFINITELY_MANY",
    "character",
    "is_stable",
    "neutral_gain",
    "require_supported",
    "unstable_poles",
]

INFINITELY_MANY = 10**9  # closed-loop poles of an unstable loop of neutral type


def require_supported(plant: Plant) -> None:
    """Refuse plants that are open-loop unstable.

    Raises
    ------
    UnsupportedPlantError
        An element has a pole in the right half plane, or on the imaginary axis away from 0.
        Poles at 0 (integrating processes) are fine.

    """
    for element in plant.elements:
        poles = element.poles
        away = poles[np.abs(poles) > 0]
        # Roots of a polynomial with a double pole carry errors near sqrt(machine epsilon).
        bad = away[away.real > -1e-9 * np.abs(away)]
        if bad.size:
            if isinstance(plant, ParallelPlant):
                where = "/process/den" if element == plant.process else "/interaction/den"
            else:
                index = plant.elements.index(element)
                where = f"/elements/{index // plant.n}/{index % plant.n}/den"
            message = (
                f"the plant is open-loop unstable (pole at {_text(bad[0])}); "
                "stabilise it with an inner loop first"
            )
            raise UnsupportedPlantError(message, where)


def is_stable(plant: Plant, loops: Sequence[Controller]) -> bool:
    """Whether the closed loop of `plant` with one controller a unit is stable."""
    return unstable_poles(plant, loops) == 0


def unstable_poles(plant: Plant, loops: Sequence[Controller]) -> int:
    """Count the closed-loop poles with a real part >= 0.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : sequence of Controller
        One a unit.

    Returns
    -------
    int
        0 for a stable loop. `INFINITELY_MANY` for dead time with a direct feedthrough gain of 1
        or more, which no real plant has. A pole on the axis counts as unstable. With a singular
        static gain the controllers' integrators that cannot act are counted, and nothing else.

    Raises
    ------
    UnsupportedPlantError
        As `require_supported`.
    InvalidInputError
        Not one loop a unit.

    """
    require_supported(plant)
    blocks, controllers = group_loops(plant, loops)
    bends = corners(plant, loops=controllers)
    if neutral_gain(blocks, controllers) >= 1:
        return INFINITELY_MANY
    integrating = np.array([controller.integral_time is not None for controller in controllers])
    if integrating.all():  # else the loops without integral action may hold what the others cannot
        if isinstance(plant, ParallelPlant):
            at_origin = parallel_origin_poles(plant, np.array([plant.n]))[0]
        else:
            at_origin = matrix_origin_poles(plant, np.ones((1, plant.n), dtype=bool))[0]
        if at_origin:
            return int(at_origin)
    total = 0
    for index, block in enumerate(blocks.blocks):

        def loop_gain(omega: NDArray[np.float64], index: int = index) -> NDArray[np.complex128]:
            return _loop_gain(blocks, controllers, omega, index)[:, None]

        batch = Batch(
            loop_gain, bends, resonances(plant), *character(plant),
            int(integrating[list(block.channels)].sum()),
        )  # fmt: skip
        total += block.multiplicity * int(count_unstable(batch)[0])
    return total


def character(plant: Plant) -> tuple[bool, bool]:
    """Whether any element of the plant has dead time, and whether any is not strictly proper."""
    return (
        any(element.dead_time > 0 for element in plant.elements),
        any(element.relative_degree == 0 for element in plant.elements),
    )


def neutral_gain(blocks: LoopBlocks, controllers: Sequence[Controller]) -> float:
    """Bound of the loop gain's spectral radius at infinity; 0 without dead time."""
    dead_time, biproper = character(blocks.plant)
    if not (dead_time and biproper):
        return 0.0
    far = np.array([1e9 * corners(blocks.plant, loops=controllers)[-1]])
    gains = [
        np.abs(_loop_gain(blocks, controllers, far, index)[0])
        for index in range(len(blocks.blocks))
    ]
    return max(float(np.abs(np.linalg.eigvals(gain)).max()) for gain in gains)


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


def _text(pole: complex) -> str:
    if pole.imag == 0:
        return f"{pole.real:.6g}"
    return f"{pole.real:.6g}{pole.imag:+.6g}j"
