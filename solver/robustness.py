"""Robustness of given loops: mu over frequency, its peaks, and nominal stability.

N_RP = [[w_I C S G, w_I C S], [w_P S G, w_P S]], S = (I + G C)^-1: Skogestad, Lundstrom and Hovd
(1989), eq. 31, block by block (`solver.blocks`). Robust stability is mu of its first block,
nominal performance the norm of its last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.blocks import LoopBlocks, group_loops
from solver.errors import InvalidInputError
from solver.frequencies import corners, grid, low_end, resonances
from solver.margins import loop_margins
from solver.mu.kernel import COLD, FINE
from solver.mu.scaling import sweep
from solver.mu.structure import BlockStructure, bound_of_scales
from solver.mu.worst_case import worst_case
from solver.peaks import highest
from solver.proof import prove
from solver.results import Curves, Peak, Peaks, Robustness
from solver.stability import unstable_poles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.certificate import Certificate
    from solver.controllers import Controller
    from solver.plants import Plant
    from solver.weights import Performance, Uncertainty

__all__ = ["LoopAnalysis", "analyse"]

PROVEN_ABOVE = 1 + 2e-4  # level of a certificate over the peak; a touch cannot be proven
POINTS_PER_DECADE = 24
MAX_FREQUENCIES = 10_000
LOWEST = 1e-18  # of the lowest bend: slower directions are singular to working accuracy


@dataclass(frozen=True)
class LoopAnalysis:
    """mu curves of a closed loop, every value recomputed from its own D-scales.

    Parameters
    ----------
    blocks : LoopBlocks
        Plant and grouping.
    controllers : tuple of Controller
        One a group.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.

    """

    blocks: LoopBlocks
    controllers: tuple[Controller, ...]
    uncertainty: Uncertainty
    performance: Performance

    @cached_property
    def omega(self) -> NDArray[np.float64]:
        """Grid that resolves the loop, from where it is at its low-frequency limit upwards."""
        plant = self.blocks.plant
        bends = corners(plant, self.uncertainty, self.controllers)
        assert self.performance.tau_p is not None  # noqa: S101 - for the type checker
        bends = np.append(bends, 1 / self.performance.tau_p)
        lowest = float(bends.min())
        low = low_end(self.robust_performance, 1e-4 * lowest, LOWEST * lowest)
        return grid(low, 1e2 * bends.max(), POINTS_PER_DECADE, [resonances(plant), bends])

    def scales(
        self, omega: NDArray[np.float64], *, stability_only: bool = False
    ) -> NDArray[np.float64]:
        """Optimal D-scales d (k, scales) at `omega`, for robust performance or stability."""
        c = self._controller_response(omega)
        b = np.zeros_like(omega) if stability_only else self.performance.magnitude(omega) ** 2
        y = np.zeros((omega.size, self.blocks.n_scales))
        u = self.uncertainty.magnitude(omega) ** 2
        all_free = cold = True  # compiled code takes no keywords
        sweep(
            self.blocks.packed(omega),
            c,
            u,
            b,
            self.blocks.layout,
            all_free,
            COLD,
            FINE,
            cold,
            y,
        )
        return np.asarray(np.exp(0.5 * y))

    def matrices(self, omega: NDArray[np.float64]) -> list[NDArray[np.complex128]]:
        """N_RP of each block, (k, 2 m, 2 m) complex: uncertain channels first."""
        c = self._controller_response(omega)
        w_I = self.uncertainty.magnitude(omega)[:, None, None]
        w_P = self.performance.magnitude(omega)[:, None, None]
        matrices = []
        for block, G in zip(self.blocks.blocks, self.blocks.response(omega), strict=True):
            c_block = c[:, list(block.channels)]
            S = np.linalg.inv(np.eye(block.size) + G * c_block[:, None, :])
            CS = c_block[:, :, None] * S
            upper = np.concatenate([w_I * CS @ G, w_I * CS], axis=2)
            lower = np.concatenate([w_P * S @ G, w_P * S], axis=2)
            matrices.append(np.concatenate([upper, lower], axis=1))
        return matrices

    def robust_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(N_RP) at `omega` (k,)."""
        d = self.scales(omega)
        bounds = [
            bound_of_scales(N, *_own(d, block.scales, block.size)).mu
            for block, N in zip(self.blocks.blocks, self.matrices(omega), strict=True)
        ]
        return np.asarray(np.max(bounds, axis=0))

    def robust_stability(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(w_I C S G) at `omega` (k,)."""
        d = self.scales(omega, stability_only=True)
        bounds = [
            bound_of_scales(N[:, : block.size, : block.size], *_own(d, block.scales, 0)).mu
            for block, N in zip(self.blocks.blocks, self.matrices(omega), strict=True)
        ]
        return np.asarray(np.max(bounds, axis=0))

    def nominal_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """sigma_max(w_P S) at `omega` (k,)."""
        values = [
            np.linalg.norm(N[:, block.size :, block.size :], 2, axis=(1, 2))
            for block, N in zip(self.blocks.blocks, self.matrices(omega), strict=True)
        ]
        return np.asarray(np.max(values, axis=0))

    def curves(self, omega: NDArray[np.float64]) -> Curves:
        """All three curves at `omega` (k,)."""
        return Curves(
            omega,
            self.robust_performance(omega),
            self.robust_stability(omega),
            self.nominal_performance(omega),
        )

    def peaks(self, curves: Curves) -> Peaks:
        """Peaks of the three curves, refined from those on a grid."""
        omega = curves.omega
        return Peaks(
            highest(self.robust_performance, omega, curves.robust_performance),
            highest(self.robust_stability, omega, curves.robust_stability),
            highest(self.nominal_performance, omega, curves.nominal_performance),
        )

    def _controller_response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.stack([controller.response(omega) for controller in self.controllers], axis=-1)


def analyse(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    omega: ArrayLike | None = None,
    *,
    certificate: bool = False,
) -> Robustness:
    """Analyse given loops.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit.
    omega : (k,) or None
        Frequencies of the curves, rad per time unit, > 0; None: a grid chosen from the loop. The
        peaks are sought on the chosen grid in any case.
    certificate : bool
        Whether to prove a level just above the robust performance peak for all frequencies.

    Raises
    ------
    InvalidInputError
        Not one loop a unit, no `tau_p`, frequencies that are not finite and positive.
    UnsupportedPlantError
        The plant is open-loop unstable.

    """
    if performance.tau_p is None:
        message = "an analysis needs a time constant"
        raise InvalidInputError(message, "/performance/tau_p")
    wanted = None if omega is None else np.unique(np.asarray(omega, dtype=float))
    if wanted is not None:
        if not 1 <= wanted.size <= MAX_FREQUENCIES:
            message = f"between 1 and {MAX_FREQUENCIES} frequencies"
            raise InvalidInputError(message, "/omega")
        if not (np.isfinite(wanted).all() and (wanted > 0).all()):
            message = "frequencies must be finite and positive"
            raise InvalidInputError(message, "/omega")
    blocks, controllers = group_loops(plant, loops, uncertainty.structure)
    unstable = unstable_poles(plant, loops)
    if unstable:
        return Robustness(
            nominally_stable=False,
            unstable_poles=unstable,
            peaks=None,
            curves=None,
            margins=loop_margins(plant, loops),
            warnings=("the closed loop is unstable: mu has no meaning for it",),
        )
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    curves = analysis.curves(analysis.omega)
    peaks = analysis.peaks(curves)
    top = np.array([peaks.robust_performance.omega])
    worst = worst_case(
        blocks, controllers, uncertainty, performance, omega=top, scales=analysis.scales(top)
    )
    proof: Certificate | None = None
    warnings = [worst.warning] if worst.warning else []
    if certificate:
        level = PROVEN_ABOVE * peaks.robust_performance.value
        proof, reasons = prove(plant, uncertainty, performance, loops, level)
        warnings += reasons
    return Robustness(
        nominally_stable=True,
        unstable_poles=0,
        peaks=peaks,
        curves=curves if wanted is None else analysis.curves(wanted),
        lower_bound=Peak(worst.mu, worst.omega),
        worst_case=worst,
        uncertainty_scaling=1 / peaks.robust_stability.value,
        margins=loop_margins(plant, loops),
        certificate=proof,
        warnings=tuple(warnings),
    )


def _own(
    d: NDArray[np.float64], scales: tuple[int, ...], performance: int
) -> tuple[NDArray[np.float64], BlockStructure]:
    """Scales and structure of one block, its scales numbered from 0."""
    used = sorted(set(scales))
    structure = BlockStructure(tuple(used.index(scale) for scale in scales), performance)
    return d[:, used], structure
