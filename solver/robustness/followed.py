"""Closed-loop poles to the right, counted by the proven turn of det(I + G C) along the axis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.robustness.enclosed_forms import TURN
from solver.robustness.march import march

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.robustness.tables import Scratch, Tables

__all__ = ["MAX_STEPS", "followed_count"]

FIRST_STEP, SHORTEST = 0.7, 1e-11  # log(ratio) of the ends of a step
MAX_STEPS = 60_000  # of a march: a second or two for two loops
TAIL_STEP, TAIL_STEPS = 4.0, 30  # ends of the axis that are tried: up to 1e18 beyond the middle
NO_TRAIL = np.empty(0)


def followed_count(
    T: Tables, S: Scratch, low: float, high: float, most: int = MAX_STEPS
) -> int | None:
    """Count the closed-loop poles with Re s >= 0 by proof; None where it is not found.

    `low` and `high` are frequencies below and above what the loop does, rad per time unit; `most`
    steps are tried between them.
    """
    low = high = math.sqrt(low * high)
    angles = np.zeros(T.multiplicity.size)
    for _ in range(TAIL_STEPS):
        if _follow(T, S, 0.0, low, angles) >= low:
            break
        low /= TAIL_STEP
    else:
        return None
    for _ in range(TAIL_STEPS):
        if math.isinf(_follow(T, S, high, math.inf, angles)):
            break
        high *= TAIL_STEP
    else:
        return None
    if low < high and _follow(T, S, low, high, angles, most=most) < high:
        return None
    zeros = np.round(-angles)
    # Each is a sum of some hundred angles, right to 1e-4 at worst.
    if not np.abs(-angles - zeros).max() < 0.1:
        return None
    return int(np.sum(zeros * T.multiplicity))


def _follow(
    T: Tables,
    S: Scratch,
    low: float,
    high: float,
    angles: NDArray[np.float64],
    *,
    most: int = MAX_STEPS,
) -> float:
    """Follow det(I + G C) from `low` upwards, at most to `high`; return how far."""
    no_scales, no_level = np.zeros((2, T.controllers)), 1.0
    return float(
        march(
            T, S, np.array([0.0, 1.0]), no_scales, low, high, FIRST_STEP, SHORTEST, most,
            no_level, TURN, angles, NO_TRAIL,
        )[0]
    )  # fmt: skip
