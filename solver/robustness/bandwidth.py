"""Bandwidths of a multivariable loop: each loop alone, and the worst direction of all together.

The bandwidth is where a sensitivity first reaches 0.707 from below. With all loops closed the
sensitivity of a direction lies between the singular values of S = (I + G C)^-1, so sigma_max(S)
tells the slowest one: Skogestad, Lundstrom and Hovd (1989), fig. 7, where 0.4 rad of each loop
alone become 0.02. What one loop sees of itself with the others closed (`Margins.bandwidth`) tells
neither.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from solver.model.blocks import group_loops

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["HALF_POWER", "Bandwidths", "bandwidths", "singular_sensitivities"]

HALF_POWER = 1 / math.sqrt(2)


@dataclass(frozen=True)
class Bandwidths:
    """Bandwidths, rad per time unit; infinite where 0.707 is never reached, 0 where always.

    Attributes
    ----------
    alone : float or None
        Of the slowest loop, each with all others open; None where one is unstable alone.
    worst_direction, best_direction : float
        Where the largest and the smallest singular value of S = (I + G C)^-1 first reach 0.707, all
        loops closed. They compare outputs as they come, in their units.

    """

    alone: float | None
    worst_direction: float
    best_direction: float


def singular_sensitivities(
    plant: Plant, loops: Sequence[Controller], omega: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the singular values of (I + G C)^-1 at `omega` (k,), each different one, descending.

    Those of units that are alike stand in one column.
    """
    blocks, controllers = group_loops(plant, loops)
    c = np.stack([controller.response(omega) for controller in controllers], axis=1)
    values = [
        1 / np.linalg.svd(np.eye(block.size) + G * c[:, None, block.channels], compute_uv=False)
        for block, G in zip(blocks.blocks, blocks.response(omega), strict=True)
    ]
    return np.sort(np.concatenate(values, axis=1), axis=1)[:, ::-1]


def bandwidths(
    plant: Plant,
    loops: Sequence[Controller],
    alone: Sequence[float | None],
    omega: NDArray[np.float64],
) -> Bandwidths:
    """Return the bandwidths of a stable loop.

    Parameters
    ----------
    plant : Plant
        The plant.
    loops : sequence of Controller
        One a unit.
    alone : sequence of float or None
        Bandwidth of each different loop with all others open; None where that is unstable.
    omega : (k,) rad per time unit
        Ascending frequencies that resolve the loop, from far below to far above its dynamics.

    """

    def sensitivities(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return singular_sensitivities(plant, loops, at)

    on_grid = sensitivities(omega)
    known = [each for each in alone if each is not None]
    return Bandwidths(
        alone=min(known) if len(known) == len(alone) else None,
        worst_direction=_first(omega, on_grid[:, 0], lambda at: sensitivities(at)[:, 0]),
        best_direction=_first(omega, on_grid[:, -1], lambda at: sensitivities(at)[:, -1]),
    )


def _first(
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
    curve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> float:
    """Where a curve first reaches `HALF_POWER` from below."""
    above = np.flatnonzero(values >= HALF_POWER)
    if not above.size:
        return math.inf
    first = int(above[0])
    if first == 0:
        return 0.0
    low, high = np.log(omega[[first - 1, first]])

    def excess(x: float) -> float:
        return float(curve(np.exp([x]))[0]) - HALF_POWER

    # Of nearly singular plants a single value may differ from that on the grid, by rounding.
    if excess(low) >= 0 or excess(high) <= 0:
        return float(omega[first])
    return float(np.exp(brentq(excess, low, high, xtol=1e-13)))
