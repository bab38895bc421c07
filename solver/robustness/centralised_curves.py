"""mu over frequency under a full (centralised) controller.

N_RP = [[w_I C S G, w_I C S], [w_P S G, w_P S]] with C any matrix: Skogestad, Lundstrom and Hovd
(1989), eq. 31. A parallel controller on a parallel plant splits as the plant does, into the sum of
all units and their differences, which share one D-scale: two scalar blocks for any number of
units.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import reduce
from solver.model.frequencies import corners, grid, low_end, resonances_of
from solver.model.peaks import highest, slices
from solver.model.state_space import StateSpace
from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure, sigma_max
from solver.robustness.record import Curves, Peaks
from solver.robustness.shared_scales import best_scales

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.plants import MatrixPlant, Plant
    from solver.model.weights import Performance, Uncertainty

__all__ = ["ON_THE_AXIS", "CentralisedAnalysis", "central_blocks", "controller_poles"]

POINTS_PER_DECADE = 48
LOWEST = 1e-18  # of the lowest bend, as for single loops
ON_THE_AXIS = 1e-9  # relative real part below which a controller's pole counts as an integrator


def central_blocks(plant: Plant, uncertainty: Uncertainty) -> LoopBlocks:
    """Return the blocks of a plant under a full controller: two modes, or the whole matrix."""
    return reduce(plant, plant.kinds, uncertainty)


@dataclass(frozen=True)
class CentralisedAnalysis:
    """mu curves of a plant under a full controller, every value recomputed from its own scales.

    Parameters
    ----------
    blocks : LoopBlocks
        As of `central_blocks`.
    controllers : tuple of StateSpace or MatrixPlant
        One a block.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.

    """

    blocks: LoopBlocks
    controllers: tuple[StateSpace | MatrixPlant, ...]
    uncertainty: Uncertainty
    performance: Performance

    @cached_property
    def bends(self) -> NDArray[np.float64]:
        """Corner frequencies of plant, weights and controller, rad per time unit."""
        found = list(corners(self.blocks.plant, self.uncertainty))
        if self.performance.tau_p is not None:
            found.append(1 / self.performance.tau_p)
        for controller in self.controllers:
            sizes = np.abs(controller_poles(controller))
            found += list(sizes[sizes > ON_THE_AXIS * max(found)])
        return np.unique(found)

    @cached_property
    def omega(self) -> NDArray[np.float64]:
        """Dense grid over the whole axis: both ends lie where the curves are at their limits."""
        lowest = float(self.bends.min())
        low = low_end(self.robust_performance, 1e-4 * lowest, LOWEST * lowest)
        functions = (*self.blocks.plant.elements, *self.uncertainty.weights)
        extra = [resonances_of(functions), self.bends]
        return grid(low, 1e3 * self.bends.max(), POINTS_PER_DECADE, extra)

    def matrices(self, omega: NDArray[np.float64]) -> list[NDArray[np.complex128]]:
        """N_RP of each block, (k, 2 m, 2 m) complex: uncertain channels first."""
        w_I = self.uncertainty.weight_of(0).response(omega)[:, None, None]
        w_P = self.performance.weight.response(omega)[:, None, None]
        matrices = []
        for G, controller in zip(self.blocks.response(omega), self.controllers, strict=True):
            C = controller.response(omega)
            S = np.linalg.inv(np.eye(G.shape[1]) + G @ C)
            R = C @ S
            matrices.append(np.block([[w_I * R @ G, w_I * R], [w_P * S @ G, w_P * S]]))
        return matrices

    def robust_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(N_RP) at `omega` (k,)."""
        return best_scales(self.blocks, self.matrices(omega))[0]

    def curves(self, omega: NDArray[np.float64]) -> Curves:
        """Robust performance, robust stability and nominal performance at `omega` (k,)."""
        matrices = self.matrices(omega)
        performance = [
            sigma_max(N[:, block.size :, block.size :])
            for N, block in zip(matrices, self.blocks.blocks, strict=True)
        ]
        return Curves(
            omega,
            best_scales(self.blocks, matrices)[0],
            self._robust_stability(matrices),
            np.asarray(np.max(performance, axis=0)),
        )

    def _robust_stability(self, matrices: list[NDArray[np.complex128]]) -> NDArray[np.float64]:
        bounds = []
        for N, block in zip(matrices, self.blocks.blocks, strict=True):
            M = N[:, : block.size, : block.size]
            scalar = block.size == 1
            structure = BlockStructure(block.scales, 0)
            bounds.append(np.abs(M[:, 0, 0]) if scalar else upper_bound(M, structure).mu)
        return np.asarray(np.max(bounds, axis=0))

    def peaks(self, curves: Curves) -> Peaks:
        """Peaks of the three curves, refined from those on a grid."""

        def side_by_side(parts: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
            here = self.curves(np.concatenate(parts))
            values = here.robust_performance, here.robust_stability, here.nominal_performance
            return [value[part] for value, part in zip(values, slices(parts), strict=True)]

        on_grid = curves.robust_performance, curves.robust_stability, curves.nominal_performance
        return Peaks(*highest(side_by_side, [(curves.omega, curve) for curve in on_grid]))


def controller_poles(controller: StateSpace | MatrixPlant) -> NDArray[np.complex128]:
    """Poles of a controller, those of the elements of a transfer matrix one after another."""
    if isinstance(controller, StateSpace):
        return controller.poles
    return np.concatenate([element.poles for element in controller.elements])
