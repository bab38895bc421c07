"""The sensitivity S = (I + G C)^-1 of single loops: at frequencies, and enclosed on intervals.

With all loops closed, one of them broken at its controller's output sees
1/(1 + L_k) = det(I + G C without loop k)/det(I + G C): by Cramer's rule the k-th diagonal element
of S. Of m units of a parallel plant with equal settings it is the mean of what the block of the
group means has there, once, and of the block of the differences, m - 1 times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.frequencies import corners
from solver.model.plants import ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.robustness.full_models import Variable, lifted_element, lifted_ratio
from solver.robustness.matrix_models import DEGREE, Models, sigma_max_bound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["NONE", "Sensitivities", "SensitivityModels"]

NONE, ONE = TransferFunction([0.0], [1.0]), TransferFunction([1.0], [1.0])
LENGTHS = 1 + 1e-12  # of two vectors of length one as LAPACK leaves them


@dataclass(frozen=True)
class Sensitivities:
    """Of c frequencies, or upper bounds on c intervals.

    Attributes
    ----------
    own : (c, k)
        |S_kk| of each channel of the first block.
    complement : (c, k)
        |1 - S_kk|.
    largest, smallest : (c,)
        Singular values of S.

    """

    own: NDArray[np.float64]
    complement: NDArray[np.float64]
    largest: NDArray[np.float64]
    smallest: NDArray[np.float64]


class SensitivityModels:
    """A loop that is stable.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : sequence of Controller
        One a unit.

    Raises
    ------
    UnprovenError
        A loop that cannot be enclosed here.

    """

    def __init__(self, plant: Plant, loops: Sequence[Controller]) -> None:
        self.blocks, self.controllers = group_loops(plant, loops)
        bends = corners(plant, loops=loops)
        self.ends = float(bends[0]), float(bends[-1])
        self.corner = 2.0 ** math.ceil(math.log2(self.ends[1]))
        # Powers of s against the poles there: of rows, those of the plant, of columns the loops'.
        self.rows = [
            [max(e.integrators for terms in row for _, e in terms) for row in self.blocks.terms(k)]
            for k in range(len(self.blocks.blocks))
        ]
        self.columns = [int(each.integral_time is not None) for each in self.controllers]
        self.parts: Sequence[Sequence[int]] = [(unit,) for unit in range(plant.n)]
        if isinstance(plant, ParallelPlant):
            self.parts = self.blocks.parts
        further = iter(range(1, len(self.blocks.blocks)))
        self.differences = [next(further) if len(part) > 1 else 0 for part in self.parts]

    def channel(self, unit: int) -> int:
        """Return the channel of the first block that a unit is in."""
        return next(index for index, part in enumerate(self.parts) if unit in part)

    def at(self, omega: NDArray[np.float64]) -> Sensitivities:
        """Return the values at frequencies (c,), rad per time unit."""
        c = np.stack([controller.response(omega) for controller in self.controllers], axis=1)
        S = [
            np.linalg.inv(np.eye(block.size) + G * c[:, None, block.channels])
            for block, G in zip(self.blocks.blocks, self.blocks.response(omega), strict=True)
        ]
        own = []
        for channel, (part, further) in enumerate(zip(self.parts, self.differences, strict=True)):
            rest = (1 - 1 / len(part)) * S[further][:, 0, 0]
            own.append(S[0][:, channel, channel] / len(part) + rest)
        seen = np.stack(own, axis=1)
        singular = [np.linalg.svd(matrix, compute_uv=False) for matrix in S]
        return Sensitivities(
            np.abs(seen),
            np.abs(1 - seen),
            np.max([values[:, 0] for values in singular], axis=0),
            np.min([values[:, -1] for values in singular], axis=0),
        )

    def over(
        self, low: NDArray[np.float64], high: NDArray[np.float64], *, singular: bool
    ) -> Sensitivities:
        """Return bounds on intervals (c,), infinite where there are none.

        The intervals' upper ends are all finite, or none is. Without `singular` there are none of
        the singular values.
        """
        variable = Variable.over(low, high, self.corner)
        S, sound = [], np.ones(low.size, dtype=bool)
        for index in range(len(self.blocks.blocks)):
            each, known = self._enclosed(index, variable)
            S.append(each)
            sound &= known & np.isfinite(each.P).all(axis=(0, 2, 3))
        own = _joined([self._own(S, channel) for channel in range(len(self.parts))])
        one = Models.constant(np.ones((1, 1), dtype=complex), own.radius.shape[0])
        both = sigma_max_bound(_joined([own, one + own.times(-1.0)]))
        sides = both.reshape(2, len(self.parts), low.size).swapaxes(1, 2)
        largest, smallest = np.full((2, low.size), np.inf)
        if singular:
            largest = np.max([sigma_max_bound(each) for each in S], axis=0)
            smallest = np.min([_least(each, sound) for each in S], axis=0)
        found = Sensitivities(sides[0], sides[1], largest, smallest)
        for values in (found.own, found.complement, found.largest, found.smallest):
            values[~sound] = np.inf
            values[np.isnan(values)] = np.inf
        return found

    def _enclosed(self, index: int, variable: Variable) -> tuple[Models, NDArray[np.bool_]]:
        """S of a block and where it is known: with R, K of powers of s, K (R (I + G C) K)^-1 R."""
        block, rows = self.blocks.blocks[index], self.rows[index]
        columns = [self.columns[channel] for channel in block.channels]
        count, size = variable.middle.size, block.size
        sound = np.ones(count, dtype=bool)
        P = np.zeros((DEGREE, count, size, size), dtype=complex)
        radius = np.zeros((count, size, size))
        known: dict[tuple[TransferFunction, int], Models] = {}

        def lifted(element: TransferFunction, powers: int) -> Models:
            nonlocal sound
            if (element, powers) not in known:
                known[element, powers], here = lifted_element(element, variable, powers)
                sound = sound & here
            return known[element, powers]

        for column, channel in enumerate(block.channels):
            polynomials = self.controllers[channel].polynomials
            c, here = lifted_ratio(*polynomials, variable, columns[column])
            sound = sound & here
            for row, entries in enumerate(self.blocks.terms(index)):
                entry = Models.constant(np.zeros((1, 1), dtype=complex), count)
                for factor, element in entries[column]:
                    if not element.is_zero:
                        entry = entry + lifted(element, rows[row]).times(factor)
                entry = entry @ c
                if row == column:
                    entry = entry + lifted(ONE, rows[row] + columns[column])
                P[:, :, row, column] = entry.P[:, :, 0, 0]
                radius[:, row, column] = entry.radius[:, 0, 0]
        inverse, regular = Models(P, radius).inverse()
        P, radius = np.empty_like(P), np.empty_like(radius)
        for row, column in np.ndindex(size, size):
            entry = _entry(inverse, row, column) @ lifted(ONE, columns[row] + rows[column])
            P[:, :, row, column] = entry.P[:, :, 0, 0]
            radius[:, row, column] = entry.radius[:, 0, 0]
        return Models(P, radius), sound & regular

    def _own(self, S: Sequence[Models], channel: int) -> Models:
        """1/(1 + L_k), 1 x 1."""
        mean, size = _entry(S[0], channel, channel), len(self.parts[channel])
        if size == 1:
            return mean
        return mean.times(1 / size) + S[self.differences[channel]].times(1 - 1 / size)


def _entry(S: Models, row: int, column: int) -> Models:
    """Return one entry, 1 x 1."""
    at = slice(row, row + 1), slice(column, column + 1)
    return Models(S.P[:, :, *at], S.radius[:, *at])


def _joined(models: Sequence[Models]) -> Models:
    """Join the intervals of several."""
    return Models(
        np.concatenate([each.P for each in models], axis=1),
        np.concatenate([each.radius for each in models]),
    )


def _least(S: Models, sound: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Upper bound of the smallest singular value: |u^H S v| of any vectors of length one."""
    u, _, vh = np.linalg.svd(np.where(sound[:, None, None], S.P[0], 0))
    left, right = u[:, :, -1:].conj().swapaxes(1, 2), vh[:, -1:].conj().swapaxes(1, 2)
    return sigma_max_bound(_fixed(left) @ S @ _fixed(right)) * LENGTHS


def _fixed(values: NDArray[np.complex128]) -> Models:
    P = np.zeros((DEGREE, *values.shape), dtype=complex)
    P[0] = values
    return Models(P, np.zeros(values.shape))
