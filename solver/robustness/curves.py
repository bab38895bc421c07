"""Curves of mu over frequency of a closed loop, each value from D-scales of its own.

N_RP = [[w_I C S G, w_I C S], [w_P S G, w_P S]], S = (I + G C)^-1: Skogestad, Lundstrom and Hovd
(1989), eq. 31, block by block (`solver.model.blocks`). Robust stability is mu of its first block,
nominal performance the norm of its last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import LoopBlocks
from solver.model.frequencies import corners, grid, low_end, reach, resonances
from solver.model.peaks import greatest, maxima, slices
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep
from solver.mu.structure import sigma_max
from solver.robustness.block_bounds import greatest_bound, interconnections
from solver.robustness.record import Curves, Peaks
from solver.stability.singular import equilibrate, has_empty_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.weights import Performance, Uncertainty

__all__ = ["LoopAnalysis"]

POINTS_PER_DECADE = 24
BEYOND = 0.1  # the grid goes on so far beyond where the loop's gain can last be one
MAX_ENTRIES = 1_000_000  # of matrices that are held at once: 16 MB each, and a dozen of them
BEST_CONDITION = 1e12  # of the return difference, rows and columns equilibrated: four digits left
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
        # The loop's own rates may lie far from those of its parts.
        slow, fast = reach(plant, self.controllers)
        low, high = min(low, BEYOND * slow), max(1e2 * bends.max(), fast / BEYOND)
        return grid(low, high, POINTS_PER_DECADE, [resonances(plant), bends])

    def scales(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Optimal D-scales d (k, scales) of robust performance at `omega`."""
        return self._scales(self._at(omega), 1.0)

    def matrices(self, omega: NDArray[np.float64]) -> list[NDArray[np.complex128]]:
        """N_RP of each block, (k, m + its outputs, ...) complex: uncertain channels first."""
        return self._at(omega).matrices

    def resolved(self, omega: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether rounding leaves S some digits at `omega` (k,).

        It does not where a plant is regular by small differences of large elements alone, as one
        of integrators that differ in dead time is towards zero.
        """
        sound = np.ones(omega.size, dtype=bool)
        c = np.stack([controller.response(omega) for controller in self.controllers], axis=-1)
        for block, G in zip(
            self.blocks.blocks, self.blocks.known(np.complex128(1j) * omega), strict=True
        ):
            E = np.eye(block.outputs) + G * c[:, None, list(block.channels[: block.outputs])]
            usable = np.isfinite(E).all(axis=(1, 2)) & ~has_empty_line(E)
            sound &= usable
            sound[usable] &= np.linalg.cond(equilibrate(E[usable])) < BEST_CONDITION
        return sound

    def robust_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(N_RP) at `omega` (k,)."""
        return self._piecewise(self._robust_performance, omega)

    def robust_stability(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(w_I C S G) at `omega` (k,)."""
        return self._piecewise(self._robust_stability, omega)

    def nominal_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """sigma_max(w_P S) at `omega` (k,)."""
        return self._piecewise(self._nominal_performance, omega)

    def level(
        self, curve: int, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One of the three curves at `omega` (k,), and the D-scales d (k, scales) behind it.

        0 is robust performance, 1 robust stability, 2 nominal performance, whose scales are one.
        """
        parts = [self._level(curve, self._at(omega[part])) for part in self._parts(omega.size)]
        values, scales = zip(*parts, strict=True)
        return np.concatenate(values), np.concatenate(scales)

    def _level(
        self, curve: int, loop: _KernelData
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if curve == 0:
            d = self._scales(loop, 1.0)
            return self._robust_performance(loop, d), d
        if curve == 1:
            d = self._scales(loop, 0.0)
            return self._robust_stability(loop, d), d
        return self._nominal_performance(loop), np.ones((len(loop.c), self.blocks.n_scales))

    def curves(self, omega: NDArray[np.float64]) -> Curves:
        """Robust performance, robust stability and nominal performance at `omega` (k,)."""
        parts = []
        for part in self._parts(omega.size):
            loop = self._at(omega[part])
            parts.append([curve(loop) for curve in self._curves])
        return Curves(omega, *(np.concatenate(each) for each in zip(*parts, strict=True)))

    def peaks(self, curves: Curves) -> Peaks:
        """Peaks of the three curves, refined from those on a grid."""
        return Peaks(*(greatest(*found) for found in self.maxima(curves)))

    def maxima(self, curves: Curves) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Maxima of the three curves, refined from those on a grid: frequencies and values."""

        def side_by_side(parts: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
            if len(self._parts(sum(part.size for part in parts))) > 1:
                return [
                    self._piecewise(curve, part)
                    for curve, part in zip(self._curves, parts, strict=True)
                ]
            loop = self._at(np.concatenate(parts))
            return [
                curve(loop[part]) for curve, part in zip(self._curves, slices(parts), strict=True)
            ]

        on_grid = curves.robust_performance, curves.robust_stability, curves.nominal_performance
        return maxima(side_by_side, [(curves.omega, curve) for curve in on_grid])

    def _piecewise(
        self, curve: Callable[[_KernelData], NDArray[np.float64]], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.concatenate([curve(self._at(omega[part])) for part in self._parts(omega.size)])

    def _parts(self, count: int) -> list[slice]:
        """Return slices of so many frequencies, each with matrices that fit the memory."""
        entries = sum(4 * block.size**2 for block in self.blocks.blocks)
        at_once = max(1, MAX_ENTRIES // entries)
        return [slice(first, first + at_once) for first in range(0, max(count, 1), at_once)]

    @property
    def _curves(self) -> tuple[Callable[[_KernelData], NDArray[np.float64]], ...]:
        return self._robust_performance, self._robust_stability, self._nominal_performance

    def _at(self, omega: NDArray[np.float64]) -> _KernelData:
        c = np.stack([controller.response(omega) for controller in self.controllers], axis=-1)
        G = self.blocks.packed(omega)
        w_I = self.blocks.responses(self.uncertainty, omega)
        w_P = self.performance.weight.response(omega)
        matrices = interconnections(self.blocks, G, c, w_I, w_P)
        # A kernel compiles anew, for a minute, for arrays of another order in memory.
        u = np.ascontiguousarray(np.abs(w_I) ** 2)
        return _KernelData(G, c, u, np.abs(w_P) ** 2, matrices)

    def _robust_performance(
        self, loop: _KernelData, d: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Upper bound of mu(N_RP), (k,), from its best scales unless `d` are given."""
        d = self._scales(loop, 1.0) if d is None else d
        return greatest_bound(self.blocks, loop.matrices, d, performance=True)

    def _robust_stability(
        self, loop: _KernelData, d: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Upper bound of mu(w_I C S G), (k,), from its best scales unless `d` are given."""
        d = self._scales(loop, 0.0) if d is None else d
        return greatest_bound(self.blocks, loop.matrices, d, performance=False)

    def _nominal_performance(self, loop: _KernelData) -> NDArray[np.float64]:
        """sigma_max(w_P S), (k,)."""
        values = [
            sigma_max(N[:, block.size :, block.size :])
            for block, N in zip(self.blocks.blocks, loop.matrices, strict=True)
        ]
        return np.asarray(np.max(values, axis=0))

    def _scales(self, loop: _KernelData, performance: float) -> NDArray[np.float64]:
        """Optimal D-scales (k, scales); `performance` 0 is robust stability alone."""
        y = np.zeros((len(loop.c), self.blocks.n_scales))
        all_free = cold = True  # named here: positional booleans say nothing
        sweep(
            loop.G, loop.c, loop.u, performance * loop.b, self.blocks.layout,
            all_free, FINE, cold, y,
        )  # fmt: skip
        return np.asarray(np.exp(0.5 * y))


@dataclass(frozen=True)
class _KernelData:
    """A loop at k frequencies.

    `G`, `c`, `u`, `b`: as `solver.mu.scaling.sweep` takes them; `matrices`: N_RP of each block.
    """

    G: NDArray[np.complex128]
    c: NDArray[np.complex128]
    u: NDArray[np.float64]
    b: NDArray[np.float64]
    matrices: list[NDArray[np.complex128]]

    def __getitem__(self, part: slice) -> _KernelData:
        return _KernelData(
            self.G[part], self.c[part], self.u[part], self.b[part], [N[part] for N in self.matrices]
        )
