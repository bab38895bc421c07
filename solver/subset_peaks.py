"""Peaks of mu of many subsets of one plant's loops, the kernel running over all in one sweep."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.blocks import reduce
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep
from solver.mu.structure import BlockStructure, bound_of_scales
from solver.mu.worst_case import interconnection
from solver.peaks import zoom
from solver.plants import MatrixPlant, ParallelPlant
from solver.results import Peak

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.blocks import LoopBlocks
    from solver.plants import Plant
    from solver.subsets import Subsets
    from solver.weights import Performance, Uncertainty

__all__ = ["peaks"]

COARSE = 1e-4  # last barrier parameter while a peak is located; its value is found with FINE
WITHIN = 0.05  # local maxima lower than the greatest by more than this share are not refined
SECTIONS = 8  # of a bracket; each round keeps two of them
ROUNDS = 4  # 4^4 = 256: a step of a tenth of a decade becomes 1e-3, and the peak's error 1e-6
MAX_ENTRIES = 4_000_000  # complex numbers in one batch of matrices, for the memory's sake


def peaks(
    subsets: Subsets,
    uncertainty: Uncertainty,
    performance: Performance,
    omega: NDArray[np.float64],
    *,
    stability_only: bool,
) -> tuple[Peak, ...]:
    """Return the refined peak of mu of each subset, all nominally stable.

    Parameters
    ----------
    subsets : Subsets
        Loops in service.
    uncertainty, performance : Uncertainty, Performance
        The weights.
    omega : (k,) rad per time unit
        Ascending grid that resolves all of them.
    stability_only : bool
        Peaks of robust stability instead of robust performance.

    Returns
    -------
    tuple of Peak
        Upper bounds, from the D-scales at the frequency found.

    """
    where, values = np.empty((2, len(subsets.counts)))
    for members in _families(subsets):
        family = _Family.of(
            subsets, members, uncertainty, performance, stability_only=stability_only
        )
        step = max(MAX_ENTRIES // (omega.size * 4 * family.channels.shape[1] ** 2), 1)
        for first in range(0, members.size, step):
            rows = np.arange(first, min(first + step, members.size))
            found = family.peak_frequencies(rows, omega)
            where[members[rows]] = found
            values[members[rows]] = family.bounds(rows, found)
    return tuple(Peak(float(value), float(at)) for value, at in zip(values, where, strict=True))


def _families(subsets: Subsets) -> list[NDArray[np.intp]]:
    """Return the indices of subsets whose loops fall into blocks of equal layout."""
    if isinstance(subsets.plant, ParallelPlant):
        keys = np.minimum(subsets.counts, 2)
    else:
        keys = subsets.counts.sum(axis=1, keepdims=True)
    _, family = np.unique(keys, axis=0, return_inverse=True)
    return [np.flatnonzero(family == index) for index in range(family.max(initial=-1) + 1)]


@dataclass(frozen=True)
class _Family:
    """Subsets whose blocks have equal layout, and what is asked of them.

    `channels` and `counts` (members, m): the controllers of the first block, and their units.
    `blocks`: the blocks of one of them.
    """

    subsets: Subsets
    channels: NDArray[np.intp]
    counts: NDArray[np.float64]
    blocks: LoopBlocks
    uncertainty: Uncertainty
    performance: Performance
    stability_only: bool

    @classmethod
    def of(
        cls,
        subsets: Subsets,
        members: NDArray[np.intp],
        uncertainty: Uncertainty,
        performance: Performance,
        *,
        stability_only: bool,
    ) -> _Family:
        """Return the family of the subsets `members`."""
        counts = subsets.counts[members]
        channels = np.nonzero(counts)[1].reshape(members.size, -1)
        counts = np.take_along_axis(counts, channels, axis=1)
        plant = subsets.plant
        if isinstance(plant, ParallelPlant):
            # Two units stand for any larger number: the layout is the same.
            sizes = np.minimum(counts[0], 2).astype(int)
            ends = np.cumsum(sizes)
            groups = [
                range(end - size, end)
                for end, size in zip(ends.tolist(), sizes.tolist(), strict=True)
            ]
            sample: Plant = ParallelPlant(int(ends[-1]), plant.process, plant.interaction)
        else:
            units = channels[0].tolist()
            groups = [range(row, row + 1) for row in range(len(units))]
            sample = MatrixPlant([[plant.element(row, col) for col in units] for row in units])
        blocks = reduce(sample, groups, uncertainty.structure)
        return cls(subsets, channels, counts, blocks, uncertainty, performance, stability_only)

    def peak_frequencies(
        self, members: NDArray[np.intp], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Frequency of each member's greatest mu, by zooming in on its local maxima."""
        values = self._levels(members, np.tile(omega, (members.size, 1)))
        padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
        top = (values >= padded[:, :-2]) & (values > padded[:, 2:])
        near = values >= (1 - WITHIN) * values.max(axis=1, keepdims=True)
        owner, found = np.nonzero(top & near)
        low = np.log(omega[np.maximum(found - 1, 0)])
        high = np.log(omega[np.minimum(found + 1, omega.size - 1)])
        best, best_value = zoom(
            partial(self._levels, members[owner]),
            low, high, omega[found], values[owner, found], sections=SECTIONS, rounds=ROUNDS,
        )  # fmt: skip
        order = np.argsort(best_value, kind="stable")  # the last one written is the greatest
        frequencies = np.empty(members.size)
        frequencies[owner[order]] = best[order]
        return frequencies

    def bounds(self, members: NDArray[np.intp], omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bound of mu of each member at its own `omega` (members,), from its D-scales."""
        G, c = self._responses(members, omega)
        _, d = self._sweep(G, c, omega, FINE)
        w_I = self.uncertainty.weight.response(omega)
        w_P = self.performance.weight.response(omega)
        greatest = np.zeros(omega.size)
        for block, first in zip(self.blocks.blocks, self.blocks.layout[2], strict=False):
            size = block.size
            plant = G[:, first : first + size, :size]
            N = interconnection(plant, c[:, list(block.channels)], w_I, w_P)
            used = sorted(set(block.scales))
            scales = tuple(used.index(scale) for scale in block.scales)
            structure = BlockStructure(scales, size)
            if self.stability_only:
                N, structure = N[:, :size, :size], BlockStructure(scales, 0)
            greatest = np.maximum(greatest, bound_of_scales(N, d[:, used], structure).mu)
        return greatest

    def _levels(self, members: NDArray[np.intp], omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return mu of the `members` (r,) at `omega` (r, q), as the kernel's level says it.

        The rows go to the kernel one frequency after the other: it starts each solve at the
        scales of the last, and neighbouring subsets differ less than the ends of a grid.
        """
        by_frequency = omega.T.ravel()
        G, c = self._responses(np.tile(members, omega.shape[1]), by_frequency)
        level, _ = self._sweep(G, c, by_frequency, COARSE)
        return np.exp(-0.5 * level).reshape(omega.T.shape).T

    def _responses(
        self, members: NDArray[np.intp], omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Plants as `LoopBlocks.packed` has them, and controllers (r, m), a row a member."""
        channels, counts = self.channels[members], self.counts[members]
        c = np.take_along_axis(self.subsets.controller_response(omega), channels, axis=1)
        means = self.subsets.plant_response(omega, channels, counts)
        rows, size = int(self.blocks.layout[2][-1]), channels.shape[1]
        G = np.zeros((omega.size, rows, size), dtype=complex)
        G[:, :size] = means
        if rows > size:
            G[:, size:, 0] = self.subsets.modes(omega)[0][:, None]
        return G, c

    def _sweep(
        self,
        G: NDArray[np.complex128],
        c: NDArray[np.complex128],
        omega: NDArray[np.float64],
        nu: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Level (k,) and D-scales (k, scales)."""
        u = self.uncertainty.magnitude(omega) ** 2
        b = np.zeros_like(omega)
        if not self.stability_only:
            b = self.performance.magnitude(omega) ** 2
        y = np.zeros((omega.size, self.blocks.n_scales))
        scales_all = True
        starts_at_the_last = True
        level, _, _ = sweep(G, c, u, b, self.blocks.layout, scales_all, nu, starts_at_the_last, y)
        return level, np.exp(0.5 * y)
