"""Nominal stability of the closed loop, dead time exact, by counting encirclements.

The closed loop is stable iff det(I + G C), followed along the Nyquist contour, does not encircle
the origin (open-loop stable or integrating plants). The determinant is the product of those of
the blocks (`solver.blocks`), each to its multiplicity. Its argument is followed on a grid that is
bisected until it turns by less than `LARGEST_TURN` from point to point.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.blocks import LoopBlocks, group_loops
from solver.errors import UnsupportedPlantError
from solver.frequencies import corners, grid, resonances
from solver.plants import ParallelPlant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.controllers import Controller
    from solver.plants import Plant

__all__ = ["INFINITELY_MANY", "is_stable", "require_supported", "unstable_poles"]

INFINITELY_MANY = 10**9  # closed-loop poles of an unstable loop of neutral type
LARGEST_TURN = 0.6  # rad between neighbouring points, a tenth of a full turn
MAX_POINTS = 40_000


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
        or more, which no real plant has. A pole on the axis counts as unstable.

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
    total = 0
    determinants = _Determinants(blocks, controllers)
    if determinants.neutral_gain >= 1:
        return INFINITELY_MANY
    high = determinants.settled_above(1e3 * bends[-1])
    for index, block in enumerate(blocks.blocks):
        low, order = determinants.settled_below(1e-3 * bends[0], index)
        omega = grid(low, high, 30, [resonances(plant), bends])
        turned = _turn(determinants, index, omega)
        if turned is None:
            return max(1, total)
        start = determinants(np.array([low]), index)[0] * (1j * low) ** order
        # From 0+ to the first point, and from the last one to infinity, by their known limits.
        turned += _principal(start if start.real > 0 else -start)
        turned -= determinants.last_turn(high, index)
        total += block.multiplicity * round(order / 2 - turned / math.pi)
    return total


class _Determinants:
    """det(I + G C) of each block along the imaginary axis."""

    def __init__(self, blocks: LoopBlocks, controllers: Sequence[Controller]) -> None:
        self.blocks = blocks
        self.controllers = controllers
        self.dead_time = max(element.dead_time for element in blocks.plant.elements)

    def loop_gain(self, omega: NDArray[np.float64], index: int) -> NDArray[np.complex128]:
        G = self.blocks.response(omega)[index]
        c = np.stack([controller.response(omega) for controller in self.controllers], axis=-1)
        return G * c[:, None, list(self.blocks.blocks[index].channels)]

    def __call__(self, omega: NDArray[np.float64], index: int) -> NDArray[np.complex128]:
        L = self.loop_gain(omega, index)
        return np.asarray(np.linalg.det(np.eye(L.shape[1]) + L))

    @property
    def neutral_gain(self) -> float:
        """Bound of the loop gain's spectral radius at infinity; 0 without dead time."""
        if not self.dead_time or all(e.relative_degree for e in self.blocks.plant.elements):
            return 0.0
        far = np.array([1e9 * corners(self.blocks.plant, loops=self.controllers)[-1]])
        gains = [np.abs(self.loop_gain(far, i)[0]) for i in range(len(self.blocks.blocks))]
        return max(float(np.abs(np.linalg.eigvals(gain)).max()) for gain in gains)

    def settled_above(self, omega: float) -> float:
        """Return a frequency above which the loop gain stays small, or constant."""
        for _ in range(30):
            point = np.array([omega])
            gains = [self.loop_gain(point, i)[0] for i in range(len(self.blocks.blocks))]
            if all(np.abs(np.linalg.eigvals(gain)).max() < 0.1 for gain in gains):
                break
            if any(e.relative_degree == 0 for e in self.blocks.plant.elements):
                break
            omega *= 10
        return omega

    def settled_below(self, omega: float, index: int) -> tuple[float, int]:
        """Return a frequency below which det ~ K s^-m, and m."""
        order = 0
        for _ in range(30):
            here, below = self(np.array([omega, omega / 2]), index)
            slope = math.log2(abs(below) / abs(here))
            order = round(slope)
            rest = here * (1j * omega) ** order
            if abs(slope - order) < 0.01 and abs(rest.imag) < 0.05 * abs(rest.real):
                break
            omega /= 10
        return omega, order

    def last_turn(self, omega: float, index: int) -> float:
        """Return the argument at `omega` relative to its limit at infinity."""
        L = self.loop_gain(np.array([omega]), index)[0]
        if self.dead_time or np.abs(np.linalg.eigvals(L)).max() < 0.5:
            # I + t L is regular for t in 0..1, so each eigenvalue turns back to 1 directly.
            return float(np.angle(1 + np.linalg.eigvals(L)).sum())
        value = complex(np.linalg.det(np.eye(L.shape[0]) + L))
        return _principal(value if value.real > 0 else -value)


def _turn(determinants: _Determinants, index: int, omega: NDArray[np.float64]) -> float | None:
    """Total turn of the argument over `omega`, refined; None where it passes through 0."""
    values = determinants(omega, index)
    while True:
        ratio = values[1:] / values[:-1]
        coarse = (np.abs(np.angle(ratio)) > LARGEST_TURN) | (np.abs(np.log(np.abs(ratio))) > 1)
        if not coarse.any():
            return float(np.angle(ratio).sum())
        middle = np.sqrt(omega[1:][coarse] * omega[:-1][coarse])
        if omega.size + middle.size > MAX_POINTS or (middle <= omega[:-1][coarse]).any():
            return None
        where = np.flatnonzero(coarse) + 1
        omega = np.insert(omega, where, middle)
        values = np.insert(values, where, determinants(middle, index))


def _principal(value: complex) -> float:
    return math.atan2(value.imag, value.real)


def _text(pole: complex) -> str:
    if pole.imag == 0:
        return f"{pole.real:.6g}"
    return f"{pole.real:.6g}{pole.imag:+.6g}j"
