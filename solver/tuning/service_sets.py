"""Integrity as a demand: every set of loops in service is stable, or robustly stable.

A set with its other loops in manual is the plant of the loops in service. Robust stability asks for
mu(w_I C S G) < 1 there: further rows of the search. Sets that symmetry makes equal are one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.frequencies import corners, grid, resonances
from solver.model.measured import MeasuredPlant
from solver.model.subsystems import interchangeable
from solver.model.weights import Performance
from solver.robustness.curves import LoopAnalysis
from solver.robustness.sets_on_data import integrity_on_data
from solver.robustness.subset_peaks import peaks
from solver.robustness.subsets import Subsets
from solver.tuning.loop_levels import loop_levels, winds_as_stable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import Layout
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Uncertainty
    from solver.tuning.scenarios import Case

__all__ = ["ServiceSets", "in_sight", "integrity_value"]

PER_DECADE = 12
NU = 1e-4  # barrier parameter: what is asked for has a margin far above it
MARGIN = 1e-3  # of mu: what a peak between two points of the grid may miss
IN_SIGHT = 24  # sets that the search looks at; all are looked at in the end
LEAST = -50.0  # stands for a level of minus infinity


def in_sight(cases: Sequence[Case]) -> list[Case]:
    """Return the cases that the search looks at, spread over all of them."""
    chosen = np.unique(np.linspace(0, len(cases) - 1, min(len(cases), IN_SIGHT)).astype(int))
    return [cases[index] for index in chosen.tolist()]


@dataclass(frozen=True, eq=False)
class ServiceSets:
    """Sets of loops in service on a grid of their own.

    Attributes
    ----------
    omega : (k,)
        Frequencies, rad per time unit.
    sets : tuple
        Plant (k, rows, widest), |w_I|^2 (k, rows) and layout of each set.
    robust : bool
        Whether robust stability is asked for, or stability alone.
    tells_stability : bool
        Whether the grid does; else it is looked at elsewhere, and `levels` says nothing of it.

    """

    omega: NDArray[np.float64]
    sets: tuple[tuple[NDArray[np.complex128], NDArray[np.float64], Layout, int], ...]
    robust: bool
    tells_stability: bool = True

    @property
    def demand(self) -> float:
        """Least -2 log mu."""
        return 2 * MARGIN

    @classmethod
    def of(cls, cases: Sequence[Case], *, robust: bool) -> ServiceSets:
        """Return the sets that these cases are."""
        bends = np.concatenate([corners(case.plant, case.uncertainty) for case in cases])
        extra = np.concatenate([resonances(case.plant) for case in cases])
        omega = grid(1e-3 * bends.min(), 1e2 * bends.max(), PER_DECADE, [np.unique(extra)])
        return cls.at(omega, in_sight(cases), robust=robust)

    @classmethod
    def at(
        cls,
        omega: NDArray[np.float64],
        cases: Sequence[Case],
        *,
        robust: bool,
        tells_stability: bool = True,
    ) -> ServiceSets:
        """Return the sets that these cases are, at frequencies `omega` (k,)."""
        sets = []
        for case in cases:
            blocks = case.blocks()
            u = blocks.squared(case.uncertainty, omega)
            sets.append((blocks.packed(omega), u, blocks.layout, blocks.n_scales))
        return cls(omega, tuple(sets), robust, tells_stability)

    def levels(
        self, theta: NDArray[np.float64], signs: NDArray[np.float64], *, lead: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
        """Return -2 log mu of robust stability, its gradient, and whether all sets are stable.

        (k sets,) and (k sets, m), empty where stability alone is asked for. Stability as far as
        the grid shows it.
        """
        none, everything = np.zeros(self.omega.size), True
        cold = True
        found, slopes, stable = [], [], True
        for G, u, layout, scales in self.sets:
            y = np.zeros((self.omega.size, scales))
            level, gradient, det = loop_levels(
                theta, signs, lead, self.omega, G, u, none, layout, everything, NU, cold, y
            )
            if self.tells_stability:
                stable = stable and bool(winds_as_stable(det, self.omega))
            found.append(np.clip(level, LEAST, -LEAST))
            slopes.append(gradient)
        if not self.robust:
            return np.empty(0), np.empty((0, theta.size)), stable
        return np.concatenate(found), np.concatenate(slopes), stable


def integrity_value(
    plant: Plant, uncertainty: Uncertainty, loops: Sequence[Controller], *, robust: bool
) -> float:
    """Return the greatest peak of mu of robust stability, or the number of kinds of unstable sets.

    Infinite where a set is unstable and robust stability is asked for.
    """
    if isinstance(plant, MeasuredPlant):
        return integrity_on_data(plant, uncertainty, loops, robust=robust)
    groups = interchangeable(plant, loops, uncertainty)
    axes = np.meshgrid(*(np.arange(len(group) + 1) for group in groups), indexing="ij")
    counts = np.stack([axis.ravel() for axis in axes], axis=1)[1:].astype(float)
    controllers = tuple(loops[group[0]] for group in groups)
    sets = Subsets(plant, controllers, counts)
    unstable = int(np.count_nonzero(sets.unstable_poles()))
    if not robust:
        return float(unstable)
    if unstable:
        return math.inf
    demand = Performance(tau_p=1 / float(corners(plant, uncertainty)[0]))
    analysis = LoopAnalysis(*group_loops(plant, loops, uncertainty), uncertainty, demand)
    units = [group[0] for group in groups]
    stability, _ = peaks(sets, plant.errors_of(uncertainty, units), demand, analysis.omega[::2])
    return max(peak.value for peak in stability)
