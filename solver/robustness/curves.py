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
from solver.model.sums import squares
from solver.mu.kernel import FINE
from solver.mu.recomputed import NOMINAL, ROBUST, STABILITY, recomputed
from solver.mu.scaling import sweep
from solver.robustness.block_bounds import interconnections
from solver.robustness.record import Curves, Peaks
from solver.stability.singular import equilibrate, has_empty_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.sums import Sums
    from solver.model.weights import Performance, Uncertainty

__all__ = ["LoopAnalysis"]

POINTS_PER_DECADE = 24
BEYOND = 0.1  # the grid goes on so far beyond where the loop's gain can last be one
MAX_ENTRIES = 1_000_000  # of matrices that are held at once: 16 MB each, and a dozen of them
BEST_CONDITION = 1e12  # of the return difference, rows and columns equilibrated: four digits left
EVERY = (ROBUST, STABILITY, NOMINAL)
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
        low = low_end(lambda w: self.level(ROBUST, w)[0], 1e-4 * lowest, LOWEST * lowest)
        # The loop's own rates may lie far from those of its parts.
        slow, fast = reach(plant, self.controllers)
        low, high = min(low, BEYOND * slow), max(1e2 * bends.max(), fast / BEYOND)
        return grid(low, high, POINTS_PER_DECADE, [resonances(plant), bends])

    @cached_property
    def _weights(self) -> Sums:
        return self.blocks.weights(self.uncertainty)

    def scales(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Optimal D-scales d (k, scales) of robust performance at `omega`."""
        return np.asarray(np.exp(0.5 * self._log_scales(ROBUST, self._at(omega))))

    def matrices(self, omega: NDArray[np.float64]) -> list[NDArray[np.complex128]]:
        """N_RP of each block, (k, m + its outputs, ...) complex: uncertain channels first."""
        return interconnections(
            self.blocks, self.blocks.packed(omega), self._controllers(omega),
            self.blocks.responses(self.uncertainty, omega),
            self.performance.weight.response(omega),
        )  # fmt: skip

    def resolved(self, omega: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether rounding leaves S some digits at `omega` (k,).

        It does not where a plant is regular by small differences of large elements alone, as one
        of integrators that differ in dead time is towards zero.
        """
        sound = np.ones(omega.size, dtype=bool)
        c = self._controllers(omega)
        for block, G in zip(
            self.blocks.blocks, self.blocks.known(np.complex128(1j) * omega), strict=True
        ):
            E = np.eye(block.outputs) + G * c[:, None, list(block.channels[: block.outputs])]
            usable = np.isfinite(E).all(axis=(1, 2)) & ~has_empty_line(E)
            sound &= usable
            sound[usable] &= np.linalg.cond(equilibrate(E[usable])) < BEST_CONDITION
        return sound

    def robust_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(N_RP) at `omega` (k,); errors as of `sampled`, as in the next two."""
        return self.sampled((ROBUST,), omega)[0][0]

    def robust_stability(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu(w_I C S G) at `omega` (k,)."""
        return self.sampled((STABILITY,), omega)[0][0]

    def nominal_performance(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """sigma_max(w_P S) at `omega` (k,)."""
        return self.sampled((NOMINAL,), omega)[0][0]

    def level(
        self, curve: int, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One of the three curves at `omega` (k,), and the D-scales d (k, scales) behind it.

        `ROBUST` performance, robust `STABILITY`, or `NOMINAL` performance, whose scales are one. A
        value is no number where S is singular.
        """
        return self.levels((curve,), omega)[0]

    def levels(
        self, curves: Sequence[int], omega: NDArray[np.float64]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return what `level` says of each of several curves."""
        loops = [self._at(omega[part]) for part in self._parts(omega.size)]
        found = []
        for curve in curves:
            values, scales = zip(*(self._level(curve, loop) for loop in loops), strict=True)
            found.append((np.concatenate(values), np.concatenate(scales)))
        return found

    def _level(
        self, curve: int, loop: _KernelData
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        y = self._log_scales(curve, loop)
        layout = self.blocks.layout
        return recomputed(curve, loop.G, loop.c, loop.u, loop.b, layout, y), np.exp(0.5 * y)

    def curves(self, omega: NDArray[np.float64]) -> Curves:
        """Robust performance, robust stability and nominal performance at `omega` (k,).

        Raises
        ------
        ArithmeticError
            As `sampled`.

        """
        return Curves(omega, *(values for values, _ in self.sampled(EVERY, omega)))

    def sampled(
        self, curves: Sequence[int], omega: NDArray[np.float64]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return what `levels` does where each value must be a number.

        Raises
        ------
        ArithmeticError
            One is none: I + G C is singular.

        """
        found = self.levels(curves, omega)
        for values, _ in found:
            if not np.isfinite(values).all():
                where = omega[np.argmin(np.isfinite(values))]
                message = f"the loop is singular at omega = {where:.6g} rad per time unit"
                raise ArithmeticError(message)
        return found

    def peaks(self, curves: Curves) -> Peaks:
        """Peaks of the three curves, refined from those on a grid."""
        return Peaks(*(greatest(*found) for found in self.maxima(curves)))

    def maxima(self, curves: Curves) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Maxima of the three curves, refined from those on a grid: frequencies and values."""

        def side_by_side(parts: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
            if len(self._parts(sum(part.size for part in parts))) > 1:
                return [self.level(*each)[0] for each in zip(EVERY, parts, strict=True)]
            loop = self._at(np.concatenate(parts))
            return [
                self._level(curve, loop[part])[0]
                for curve, part in zip(EVERY, slices(parts), strict=True)
            ]

        on_grid = curves.robust_performance, curves.robust_stability, curves.nominal_performance
        return maxima(side_by_side, [(curves.omega, curve) for curve in on_grid])

    def _parts(self, count: int) -> list[slice]:
        """Return slices of so many frequencies, each with matrices that fit the memory."""
        entries = sum(4 * block.size**2 for block in self.blocks.blocks)
        at_once = max(1, MAX_ENTRIES // entries)
        return [slice(first, first + at_once) for first in range(0, max(count, 1), at_once)]

    def _controllers(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Responses (k, controllers)."""
        return np.stack([controller.response(omega) for controller in self.controllers], axis=-1)

    def _at(self, omega: NDArray[np.float64]) -> _KernelData:
        return _KernelData(
            self.blocks.packed(omega),
            self._controllers(omega),
            squares(self._weights, self.blocks.layout.channels.size, 1j * omega),
            self.performance.magnitude(omega) ** 2,
        )

    def _log_scales(self, curve: int, loop: _KernelData) -> NDArray[np.float64]:
        """Log of the squared D-scales (k, scales) that are best for a curve; of NOMINAL zeros."""
        y = np.zeros((len(loop.c), self.blocks.n_scales))
        all_free = cold = True  # named here: positional booleans say nothing
        if curve != NOMINAL:
            b = loop.b if curve == ROBUST else np.zeros_like(loop.b)
            sweep(loop.G, loop.c, loop.u, b, self.blocks.layout, all_free, FINE, cold, y)
        return y


@dataclass(frozen=True)
class _KernelData:
    """A loop at k frequencies: as `solver.mu.scaling.sweep` takes it, `b` being |w_P|^2."""

    G: NDArray[np.complex128]
    c: NDArray[np.complex128]
    u: NDArray[np.float64]
    b: NDArray[np.float64]

    def __getitem__(self, part: slice) -> _KernelData:
        return _KernelData(self.G[part], self.c[part], self.u[part], self.b[part])
