"""Stability and the demand sigma_max(w_P S) <= 1 of one plant, by proof in a millisecond."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.certificate.enclosed_loop import ExactLoop
from solver.certificate.record import Claim
from solver.certificate.reduction import settings_of
from solver.model.errors import MutuneError
from solver.model.weights import Uncertainty
from solver.mu.recomputed import NOMINAL
from solver.robustness.followed import MAX_STEPS, followed_count
from solver.robustness.march import march
from solver.robustness.tables import Scratch, Tables, scratch, tables

if TYPE_CHECKING:
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance

__all__ = ["ProvenDemand"]

MOST = 12  # different settings: a tenth of a second a plant
FIRST_STEP, SHORTEST = 0.7, 1e-7  # log(ratio) of the ends of a step
DEMAND_STEPS = 2_000
FARTHER, TRIES = 16.0, 12  # ends of the axis that are tried: up to 1e14 beyond the grid
# The nominal loop knows nothing of the uncertainty.
ANY = Uncertainty.from_error(0.1, 0.0)


@dataclass(frozen=True)
class ProvenDemand:
    """Loops and their demand.

    Parameters
    ----------
    performance : Performance
        The demand, with its `tau_p`.
    loops : tuple of Controller
        One a unit.
    low, high : float
        Frequencies beyond which little happens, rad per time unit.

    """

    performance: Performance
    loops: tuple[Controller, ...]
    low: float
    high: float

    def holds(self, plant: Plant, most: int = MAX_STEPS) -> tuple[bool, bool]:
        """Whether the loop is proven stable with a plant, in `most` steps, and the demand too."""
        compiled = self._compiled(plant)
        if compiled is None or not self._is_stable(*compiled, most):
            return False, False
        return True, self._demand(*compiled)

    def stable(self, plant: Plant) -> bool:
        """Whether the loop is proven stable with a plant."""
        compiled = self._compiled(plant)
        return compiled is not None and self._is_stable(*compiled)

    def _compiled(self, plant: Plant) -> tuple[Tables, Scratch] | None:
        if len(settings_of(plant, self.loops, ANY, self.performance.output_scale)) > MOST:
            return None
        try:
            loop = ExactLoop.of(Claim(plant, ANY, self.performance, self.loops, 1.0), known=True)
        except MutuneError:  # a plant beyond the proof
            return None
        T = tables(loop)
        return T, scratch(T)

    def _is_stable(self, T: Tables, S: Scratch, most: int = MAX_STEPS) -> bool:
        return followed_count(T, S, self.low, self.high, most) == 0

    def _demand(self, T: Tables, S: Scratch) -> bool:
        low, high = self.low, self.high
        for _ in range(TRIES):
            if _reached(T, S, 0.0, low) >= low:
                break
            low /= FARTHER
        else:
            return False
        for _ in range(TRIES):
            if math.isinf(_reached(T, S, high, math.inf)):
                break
            high *= FARTHER
        else:
            return False
        return _reached(T, S, low, high) >= high


def _reached(T: Tables, S: Scratch, low: float, high: float) -> float:
    """Return how far the demand is proven from `low` towards `high`."""
    ones, angles = np.zeros((2, T.controllers)), np.zeros(T.multiplicity.size)
    return float(
        march(
            T, S, np.array([0.0, 1.0]), ones, low, high, FIRST_STEP, SHORTEST, DEMAND_STEPS, 1.0,
            NOMINAL, angles, np.empty(0),
        )[0]
    )  # fmt: skip
