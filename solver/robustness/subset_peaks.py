"""Peaks of mu of many subsets of one plant's loops, the kernel running over all in one sweep."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import reduce, with_inputs, with_outputs
from solver.model.memory import batch_length
from solver.model.mixed_plant import shares_inputs
from solver.model.peaks import Peak, tops, zoom
from solver.model.weights import Uncertainty
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep
from solver.robustness.block_bounds import greatest_bound, interconnections

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.weights import Performance
    from solver.robustness.subsets import Subsets

__all__ = ["peaks"]

COARSE = 1e-4  # last barrier parameter while a peak is located; its value is found with FINE
WITHIN = 0.05  # local maxima lower than the greatest by more than this share are not refined
SECTIONS = 8  # of a bracket; each round keeps two of them
ROUNDS = 4  # 4^4 = 256: a step of a tenth of a decade becomes 1e-3, and the peak's error 1e-6


def peaks(
    subsets: Subsets,
    uncertainty: Uncertainty,
    performance: Performance,
    omega: NDArray[np.float64],
    *,
    errors: NDArray[np.float64] | None = None,
) -> tuple[list[Peak], list[Peak]]:
    """Return the refined peaks of mu of each subset, all nominally stable.

    Parameters
    ----------
    subsets : Subsets
        Loops in service.
    uncertainty, performance : Uncertainty, Performance
        The weights; the uncertainty of each controller's inputs, or of all.
    omega : (k,) rad per time unit
        Ascending grid that resolves all of them.
    errors : (controllers,) or None
        Permitted error of each controller's outputs; None: all alike.

    Returns
    -------
    stability, performance : list of Peak
        Upper bounds, from the D-scales at the frequency found.

    """
    where, values = np.empty((2, 2, len(subsets.counts)))
    for members in _families(subsets):
        family = _Family.of(subsets, members, uncertainty, performance, errors)
        step = batch_length(omega.size * 8 * family.channels.shape[1] ** 2)
        for first in range(0, members.size, step):
            rows = np.arange(first, min(first + step, members.size))
            found = family.peak_frequencies(rows, omega)
            where[:, members[rows]] = found
            values[:, members[rows]] = family.bounds(rows, found)
    stability, robust = (
        [Peak(*peak) for peak in zip(*both, strict=True)]
        for both in zip(values.tolist(), where.tolist(), strict=True)
    )
    return stability, robust


def _families(subsets: Subsets) -> list[NDArray[np.intp]]:
    """Return the indices of subsets whose loops fall into blocks of equal layout."""
    if subsets.plant.interchangeable:
        keys = np.minimum(subsets.counts, 2)
        used_first = np.argsort(keys == 0, axis=1, kind="stable")
        keys = np.take_along_axis(keys, used_first, axis=1)
    else:
        keys = subsets.counts.sum(axis=1, keepdims=True)
    _, family = np.unique(keys, axis=0, return_inverse=True)
    return [np.flatnonzero(family == index) for index in range(family.max(initial=-1) + 1)]


@dataclass(frozen=True)
class _Family:
    """Subsets whose blocks have equal layout, with uncertainty and performance weights.

    `channels` and `counts` (members, m): the controllers of the first block, and their units.
    `blocks`: the blocks of one of them.
    """

    subsets: Subsets
    channels: NDArray[np.intp]
    counts: NDArray[np.float64]
    blocks: LoopBlocks
    uncertainty: Uncertainty
    performance: Performance
    errors: NDArray[np.float64] | None

    @classmethod
    def of(
        cls,
        subsets: Subsets,
        members: NDArray[np.intp],
        uncertainty: Uncertainty,
        performance: Performance,
        errors: NDArray[np.float64] | None,
    ) -> _Family:
        """Return the family of the subsets `members`."""
        counts = subsets.counts[members]
        channels = np.nonzero(counts)[1].reshape(members.size, -1)
        counts = np.take_along_axis(counts, channels, axis=1)
        plant = subsets.plant
        if plant.interchangeable:
            # Two units stand for any larger number: the layout is the same.
            sizes = np.minimum(counts[0], 2).astype(int)
            ends = np.cumsum(sizes)
            groups = [
                range(end - size, end)
                for end, size in zip(ends.tolist(), sizes.tolist(), strict=True)
            ]
            units = range(int(ends[-1]))
        else:
            units = channels[0].tolist()
            groups = [range(row, row + 1) for row in range(len(units))]
        alike = replace(uncertainty, weight=uncertainty.weight_of(0))
        if alike.outputs is not None:
            alike = replace(alike, outputs=Uncertainty(alike.outputs.weight_of(0)))
        blocks = reduce(plant.part(units), groups, alike)
        return cls(subsets, channels, counts, blocks, uncertainty, performance, errors)

    @property
    def repeated(self) -> list[int]:
        """Channels of the first block that have a block of differences of their own."""
        return [index for index, part in enumerate(self.blocks.parts) if len(part) > 1]

    def peak_frequencies(
        self, members: NDArray[np.intp], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Frequencies (2, members) of the greatest mu of stability and of performance.

        Found by zooming in on local maxima.
        """
        tasks = np.arange(2 * members.size)
        values = self._levels(members, tasks, np.tile(omega, (tasks.size, 1)))
        near = values >= (1 - WITHIN) * values.max(axis=1, keepdims=True)
        owner, found = np.nonzero(tops(values) & near)
        low = np.log(omega[np.maximum(found - 1, 0)])
        high = np.log(omega[np.minimum(found + 1, omega.size - 1)])
        best, best_value = zoom(
            lambda rows, points: self._levels(members, owner[rows], points),
            low, high, omega[found], values[owner, found],
            sections=SECTIONS, rounds=ROUNDS, rivals=owner,
        )  # fmt: skip
        order = np.argsort(best_value, kind="stable")  # the last one written is the greatest
        frequencies = np.empty(tasks.size)
        frequencies[owner[order]] = best[order]
        return frequencies.reshape(2, -1)

    def bounds(self, members: NDArray[np.intp], omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper bounds of mu of each member at its own `omega` (2, members), from D-scales."""
        size = members.size
        loops = self._at(np.tile(members, 2), omega.ravel(), size)
        _, d = self._sweep(loops, FINE)
        N = interconnections(self.blocks, loops.G, loops.c, loops.uncertainty, loops.performance)
        stability, performance = [each[:size] for each in N], [each[size:] for each in N]
        return np.stack(
            [
                greatest_bound(self.blocks, stability, d[:size], performance=False),
                greatest_bound(self.blocks, performance, d[size:], performance=True),
            ]
        )

    def _levels(
        self, members: NDArray[np.intp], tasks: NDArray[np.intp], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return mu at `omega` (r, q), as the kernel's level says it.

        The `tasks` (r,), ascending, are numbered from 0: stability of each of the `members`, then
        performance of each. The rows of each go to the kernel one frequency after the other: it
        starts each solve at the scales of the last, and neighbouring subsets differ less than the
        ends of a grid.
        """
        split = int(np.searchsorted(tasks, members.size))
        both = slice(split), slice(split, None)
        loops = self._at(
            np.concatenate(
                [np.tile(members[tasks[p] % members.size], omega.shape[1]) for p in both]
            ),
            np.concatenate([omega[part].T.ravel() for part in both]),
            split * omega.shape[1],
        )
        mu = np.exp(-0.5 * self._sweep(loops, COARSE)[0])
        ends = mu[: loops.split], mu[loops.split :]
        return np.concatenate([part.reshape(omega.shape[1], -1).T for part in ends])

    def _at(self, members: NDArray[np.intp], omega: NDArray[np.float64], split: int) -> _Loops:
        """Return the loops of the `members` (k,), each at its own `omega` (k,)."""
        channels, counts = self.channels[members], self.counts[members]
        c = np.take_along_axis(self.subsets.controller_response(omega), channels, axis=1)
        e = np.ones(channels.shape) if self.errors is None else self.errors[channels]
        plant = self.subsets.plant
        if shares_inputs(plant):
            rows = np.arange(omega.size)[:, None]
            P = (plant.to_outputs @ plant.plant.response(omega))[rows, channels]
            M = np.moveaxis(plant.to_inputs[:, channels], 0, 1)
            G = with_inputs(P / e[:, :, None], M * e[:, None, :])
            w_I = self.blocks.responses(self.uncertainty, omega)
            return _Loops(G, c, w_I, self.performance.weight.response(omega), split)
        means = self.subsets.plant_response(omega, channels, counts)
        means *= e[:, None, :] / e[:, :, None]  # E^-1 G E, see `solver.model.blocks`
        outputs = self.uncertainty.outputs
        own = [_each(self.uncertainty, omega, channels)]
        if outputs is not None:
            own.append(_each(outputs, omega, channels))
            means = with_outputs(means)
        width = means.shape[1]
        G = np.zeros((omega.size, int(self.blocks.layout.first[-1]), width), dtype=complex)
        G[:, :width] = means
        weights = own.copy()
        if self.repeated:
            mode = self.subsets.modes(omega)[0][:, None, None]
            mode = mode if outputs is None else with_outputs(mode)
            # The differences within groups follow those with two units or more.
            for index, first in zip(self.repeated, self.blocks.layout.first[1:], strict=False):
                G[:, first : first + mode.shape[1], : mode.shape[1]] = mode
                weights += [weight[:, [index]] for weight in own]
        w_P = self.performance.weight.response(omega)
        return _Loops(G, c, np.concatenate(weights, axis=1), w_P, split)

    def _sweep(self, loops: _Loops, nu: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Level (k,) and D-scales (k, scales)."""
        u = np.ascontiguousarray(np.abs(loops.uncertainty) ** 2)
        b = np.abs(loops.performance) ** 2
        b[: loops.split] = 0.0
        y = np.zeros((b.size, self.blocks.n_scales))
        scales_all = True
        starts_at_the_last = True
        level = [
            sweep(
                loops.G[part], loops.c[part], u[part], b[part], self.blocks.layout,
                scales_all, nu, starts_at_the_last, y[part],
            )[0]
            for part in (slice(loops.split), slice(loops.split, None))
        ]  # fmt: skip
        return np.concatenate(level), np.exp(0.5 * y)


def _each(
    uncertainty: Uncertainty, omega: NDArray[np.float64], channels: NDArray[np.intp]
) -> NDArray[np.complex128]:
    """Return the weight of each channel's controller, (k, m): each has its own, or all have one."""
    weights = uncertainty.responses(omega, range(len(uncertainty.weights)))
    if weights.shape[1] > 1:
        return np.take_along_axis(weights, channels, axis=1)
    return np.broadcast_to(weights, channels.shape)


@dataclass(frozen=True)
class _Loops:
    """Loops of a family, k rows.

    `G` as `LoopBlocks.packed` has it, controllers `c` (k, m), weights (k, rows) and (k,). The first
    `split` rows are asked for robust stability, the others for robust performance.
    """

    G: NDArray[np.complex128]
    c: NDArray[np.complex128]
    uncertainty: NDArray[np.complex128]
    performance: NDArray[np.complex128]
    split: int
