"""Frequencies between which a loop does nothing unseen: where det(I + G C) is followed by proof.

On each step of the march I + G C, times a fixed matrix, stays near the identity, so that the steps
shrink towards every zero of its determinant near the axis, however narrow the resonance there. A
grid through their ends has points on the flanks of each.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.certificate.enclosed_loop import ExactLoop
from solver.certificate.record import Claim
from solver.certificate.reduction import settings_of
from solver.model.weights import Performance, Uncertainty
from solver.robustness.enclosed_forms import TURN
from solver.robustness.march import march
from solver.robustness.tables import scratch, tables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["turning_points"]

MOST_FOLLOWED = 12  # different settings: a tenth of a second each
FIRST_STEP, SHORTEST = 0.7, 1e-11  # log(ratio) of the ends of a step
BEYOND = 1e-9  # relative, past what cannot be followed: a pole on the axis
MAX_STEPS = 4_000
MAX_OBSTACLES = 20
# The determinant knows nothing of the weights.
ANY = Uncertainty.from_error(0.1, 0.0), Performance(tau_p=1.0)


def turning_points(
    plant: Plant, loops: Sequence[Controller], low: float, high: float
) -> NDArray[np.float64]:
    """Return the ends of the steps in which det(I + G C) is followed from `low` to `high`.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : sequence of Controller
        One a unit, stable or not.
    low, high : float
        Frequencies, rad per time unit.

    Returns
    -------
    (k,)
        Ascending; none where more than `MOST_FOLLOWED` loops differ.

    """
    if len(settings_of(plant, loops, ANY[0], None)) > MOST_FOLLOWED:
        return np.empty(0)
    T = tables(ExactLoop.of(Claim(plant, *ANY, tuple(loops), 1.0), known=True))
    S = scratch(T)
    no_scales, angles = np.zeros((2, T.controllers)), np.zeros(T.multiplicity.size)
    found, steps = [], MAX_STEPS
    for _ in range(MAX_OBSTACLES):
        trail = np.zeros(steps)
        low, _, left = march(
            T, S, np.array([0.0, 1.0]), no_scales, low, high, FIRST_STEP, SHORTEST, steps, 1.0,
            TURN, angles, trail,
        )  # fmt: skip
        found.append(trail[trail > 0])
        if low >= high or left <= 0:
            break
        steps, low = left, low * (1 + BEYOND)
    return np.concatenate(found)
