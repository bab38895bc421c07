"""Each loop with all others in manual, as further rows of the search: |1 + g_ii c_i| >= 1/Ms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners
from solver.tuning.loop_levels import responses, winds_as_stable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.tuning.groupings import Groups

__all__ = ["LoopsAlone", "least_level"]

PER_DECADE = 60  # a peak between two points is missed by less than `MARGIN`
MARGIN = 1e-3  # relative, of the permitted peak
BEYOND = 1e2  # of the plant's corners


def least_level(max_sensitivity: float) -> float:
    """Return the least log |1 + g c|^2 that a permitted peak leaves, with a margin."""
    return min(-2 * math.log(max_sensitivity * (1 - MARGIN)), 0.0)


@dataclass(frozen=True)
class LoopsAlone:
    """The loops alone on a grid of their own.

    Attributes
    ----------
    omega : (k,)
        Frequencies, rad per time unit.
    g : (k, loops)
        Each loop's own process.
    owners : (loops,)
        Controller of each loop.
    demand : float
        Least log |1 + g c|^2.
    tells_stability : bool
        Whether the grid does; else it is looked at elsewhere, and `levels` says nothing of it.

    """

    omega: NDArray[np.float64]
    g: NDArray[np.complex128]
    owners: NDArray[np.int64]
    demand: float
    tells_stability: bool = True

    @classmethod
    def of(cls, plant: Plant, groups: Groups, max_sensitivity: float) -> LoopsAlone:
        """Return the loops of a plant, those of a parallel plant once a group."""
        bends = corners(plant)
        low, high = bends[0] / BEYOND, bends[-1] * BEYOND
        omega = np.geomspace(low, high, math.ceil(PER_DECADE * math.log10(high / low)))
        own = [group[:1] if plant.interchangeable else group for group in groups]
        pairs = [(owner, unit) for owner, units in enumerate(own) for unit in units]
        g = np.stack([plant.entry(unit, unit).response(omega) for _, unit in pairs], axis=1)
        owners = np.array([owner for owner, _ in pairs])
        return cls(omega, g, owners, least_level(max_sensitivity))

    def levels(
        self, theta: NDArray[np.float64], signs: NDArray[np.float64], *, lead: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
        """Return log |1 + g c|^2 (k loops,), its gradient (k loops, m), and whether all are stable.

        Stability as far as the grid shows it.
        """
        c, dc = responses(theta, signs, lead, self.omega)
        E = 1 + self.g * c[:, self.owners]
        per = dc.shape[2]
        gradient = np.zeros((*E.shape, theta.size))
        for loop, owner in enumerate(self.owners.tolist()):
            slope = self.g[:, loop, None] * dc[:, owner] / E[:, loop, None]
            gradient[:, loop, owner * per : (owner + 1) * per] = 2 * slope.real
        level = 2 * np.log(np.abs(E))
        stable = not self.tells_stability or bool(winds_as_stable(E, self.omega))
        return level.ravel(), gradient.reshape(-1, theta.size), stable
