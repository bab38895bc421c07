"""Sets of loops in service around a plant that is known at some frequencies only.

Rows and columns of what is in manual drop out, as they do of transfer functions. Stability of each
set is decided by the turns of its own determinant, mu is bounded at the frequencies of the data.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import UnsupportedPlantError
from solver.model.weights import Performance
from solver.robustness.on_data import data_analysis
from solver.stability.on_data import at_rest, unstable_poles_on_data

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from solver.model.controllers import Controller
    from solver.model.measured import MeasuredPlant
    from solver.model.weights import Uncertainty

__all__ = ["every_set", "integrity_on_data", "sensitivity_alone_on_data", "stable_on_data"]


def every_set(n: int) -> Iterator[tuple[int, ...]]:
    """Yield every set of units in service of `n`, the empty one apart."""
    for count in range(1, n + 1):
        yield from itertools.combinations(range(n), count)


def stable_on_data(plant: MeasuredPlant, loops: Sequence[Controller]) -> bool:
    """Whether the data tell that loops around a plant are stable."""
    try:
        gain = at_rest(plant)
    except UnsupportedPlantError:  # some loops by themselves are not at rest, or singular
        return False
    return unstable_poles_on_data(plant, gain, loops) == 0


def sensitivity_alone_on_data(plant: MeasuredPlant, loops: Sequence[Controller]) -> float:
    """Greatest |1/(1 + g_ii c_i)| at the frequencies of the data, every other loop in manual.

    Infinite where the data do not tell that a loop is stable alone.
    """
    greatest = 0.0
    for unit, loop in enumerate(loops):
        if not stable_on_data(plant.part([unit]), [loop]):
            return math.inf
        own = 1 + plant.values[:, unit, unit] * loop.response(plant.omega)
        greatest = max(greatest, float((1 / np.abs(own)).max()))
    return greatest


def integrity_on_data(
    plant: MeasuredPlant, uncertainty: Uncertainty, loops: Sequence[Controller], *, robust: bool
) -> float:
    """Greatest mu of robust stability at the frequencies of the data, of any set in service.

    Infinite where one of them is not known to be stable. Not `robust`: how many of them are not.
    """
    parts = [(plant.part(units), [loops[u] for u in units], units) for units in every_set(plant.n)]
    unstable = sum(not stable_on_data(part, own) for part, own, _ in parts)
    if not robust:
        return float(unstable)
    if unstable:
        return math.inf
    demand = Performance(tau_p=1 / float(plant.omega[0]))  # has no say in robust stability
    return max(
        float(
            data_analysis(part, uncertainty.of_units(units), demand, own)
            .robust_stability(plant.omega)
            .max()
        )
        for part, own, units in parts
    )
