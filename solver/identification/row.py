"""One output as a sum over inputs: what is fitted together, and its residual.

A segment is a stretch of one output with the inputs that move it. All segments share the elements;
each has an offset of its own and, where asked for, a drift and an unknown start. Shared gains and
the segments' own coefficients enter linearly; they are projected out (variable projection: Golub
and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413), the segments' own ones segment by segment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import Element, free_motions, responses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.colour import Colour
    from solver.identification.elements import ElementKind

__all__ = ["Row", "Segment", "Solved", "least_squares", "orthonormal"]

# Columns that differ from those before by less than this part are theirs: rounding of the data.
DEPENDENT = 1e-9


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of one output.

    Attributes
    ----------
    time : (k,) ndarray
        Times of the readings, from the record's start.
    output : (k,) ndarray
        Readings.
    changes : tuple of ((c,) ndarray, (c,) ndarray)
        For each input, when it changes and its deviation from its first value from then on.
    weight : (k,) ndarray
        Square root of each reading's weight; 0 leaves it out.
    record, unit : int
        Where it comes from.
    colour : Colour or None
        Of its disturbances, where they are not white.
    moving : bool
        Whether it begins with free motions.

    """

    time: NDArray[np.float64]
    output: NDArray[np.float64]
    changes: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]
    weight: NDArray[np.float64]
    record: int = 0
    unit: int = 0
    colour: Colour | None = None
    moving: bool = False

    def weighted(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return columns over the readings, (k,) or (k, c), each reading by what it tells."""
        weight = self.weight if columns.ndim == 1 else self.weight[:, None]
        if self.colour is None:
            return columns * weight
        return self.colour.whitened(self.time, self.weight > 0, columns * weight)

    def thinned(self, step: int) -> Segment:
        """Return every `step`-th reading; the inputs stay whole."""
        return replace(
            self,
            time=self.time[::step].copy(),
            output=self.output[::step].copy(),
            weight=self.weight[::step].copy(),
        )


@dataclass(frozen=True, eq=False)
class Row:
    """Segments that share their elements, and whether each may drift linearly."""

    segments: tuple[Segment, ...]
    drift: bool = False

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.segments[0].changes)

    @property
    def readings(self) -> int:
        """Number of readings with weight."""
        return sum(int(np.count_nonzero(s.weight)) for s in self.segments)

    def plain(self) -> Row:
        """Return the row as if the disturbances were white."""
        return replace(self, segments=tuple(replace(s, colour=None) for s in self.segments))

    def own_columns(
        self, segment: Segment, kinds: Sequence[ElementKind], shapes: Sequence[Sequence[float]]
    ) -> NDArray[np.float64]:
        """Return what the segment has for itself, (k, columns)."""
        columns = [np.ones_like(segment.time)]
        if self.drift:
            columns.append(segment.time / max(segment.time[-1], 1e-300) - 0.5)
        if segment.moving:
            for kind, shape in zip(kinds, shapes, strict=True):
                columns += free_motions(kind, shape, segment.time)
        return np.stack(columns, axis=1)

    def solve(self, kinds: Sequence[ElementKind], shapes: Sequence[Sequence[float]]) -> Solved:
        """Return gains and residual for given shapes."""
        bases, blocks, lefts, targets = [], [], [], []
        for segment in self.segments:
            block = np.hstack(
                [
                    responses(kind, shape, segment.time, *moves)
                    for kind, shape, moves in zip(kinds, shapes, segment.changes, strict=True)
                ]
            )
            own = self.own_columns(segment, kinds, shapes)
            base = orthonormal(segment.weighted(own))
            weighted = segment.weighted(block)
            target = segment.weighted(segment.output)
            bases.append(base)
            blocks.append(block)
            lefts.append(weighted - base @ (base.T @ weighted))
            targets.append(target - base @ (base.T @ target))
        left, target = np.concatenate(lefts), np.concatenate(targets)
        gains = least_squares(left, target)
        return Solved(
            tuple(kinds), tuple(tuple(s) for s in shapes), gains, target - left @ gains,
            left, tuple(bases), tuple(blocks),
        )  # fmt: skip

    def jacobian(self, solved: Solved, steps: Sequence[float]) -> NDArray[np.float64]:
        """Return the derivative of the fitted output by each shape parameter, (k, parameters).

        The segments' own columns are projected out; the shared gains are not.

        Parameters
        ----------
        solved : Solved
            Where.
        steps : sequence of float
            Half the distance of the central difference, for each parameter.

        """
        count = sum(len(shape) for shape in solved.shapes)
        rows = []
        for segment, base, block in zip(self.segments, solved.bases, solved.blocks, strict=True):
            motions = self._motion_coefficients(segment, solved, block)
            part = np.empty((segment.time.size, count))
            index, first = 0, 0
            for kind, shape, moves, free in zip(
                solved.kinds, solved.shapes, segment.changes, motions, strict=True
            ):
                gains = solved.gains[first : first + kind.gains]
                first += kind.gains
                for position in range(len(shape)):
                    ends = []
                    for h in (steps[index], -steps[index]):
                        moved = [*shape[:position], shape[position] + h, *shape[position + 1 :]]
                        value = responses(kind, moved, segment.time, *moves) @ gains
                        for share, motion in zip(
                            free, free_motions(kind, moved, segment.time), strict=False
                        ):
                            value += share * motion
                        ends.append(value)
                    part[:, index] = (ends[0] - ends[1]) / (2 * steps[index])
                    index += 1
            part = segment.weighted(part)
            rows.append(part - base @ (base.T @ part))
        return np.concatenate(rows)

    def own_parts(self, solved: Solved) -> list[NDArray[np.float64]]:
        """Return offset, drift and free motion of each segment over its readings."""
        parts = []
        for segment, block in zip(self.segments, solved.blocks, strict=True):
            own = self.own_columns(segment, solved.kinds, solved.shapes)
            parts.append(own @ self._own_coefficients(segment, solved, block, own))
        return parts

    def _own_coefficients(
        self,
        segment: Segment,
        solved: Solved,
        block: NDArray[np.float64],
        own: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        left = segment.output - block @ solved.gains
        return least_squares(segment.weighted(own), segment.weighted(left))

    def _motion_coefficients(
        self, segment: Segment, solved: Solved, block: NDArray[np.float64]
    ) -> list[NDArray[np.float64]]:
        """Return the share of each free motion, element by element."""
        if not segment.moving:
            return [np.zeros(0)] * len(solved.kinds)
        own = self.own_columns(segment, solved.kinds, solved.shapes)
        shares = self._own_coefficients(segment, solved, block, own)
        first, found = 1 + self.drift, []
        for kind in solved.kinds:
            found.append(shares[first : first + kind.motions])
            first += kind.motions
        return found


@dataclass(frozen=True, eq=False)
class Solved:
    """A row with given shapes: best gains and what they leave.

    Attributes
    ----------
    kinds, shapes
        Of each element.
    gains : (g,) ndarray
        Of all elements, one after the other.
    residual : (k,) ndarray
        Weighted, the segments' own columns projected out.
    left : (k, g) ndarray
        Weighted response for each unit gain, the same projected out.
    bases : tuple of (k, o) ndarray
        Orthonormal basis of each segment's own columns, weighted.
    blocks : tuple of (k, g) ndarray
        Response of each segment for each unit gain, as it is.

    """

    kinds: tuple[ElementKind, ...]
    shapes: tuple[tuple[float, ...], ...]
    gains: NDArray[np.float64]
    residual: NDArray[np.float64]
    left: NDArray[np.float64]
    bases: tuple[NDArray[np.float64], ...]
    blocks: tuple[NDArray[np.float64], ...]

    @property
    def cost(self) -> float:
        """Sum of the squared weighted residuals."""
        return float(self.residual @ self.residual)

    @property
    def elements(self) -> tuple[Element, ...]:
        """The elements with their numbers."""
        found, first = [], 0
        for kind, shape in zip(self.kinds, self.shapes, strict=True):
            gains = tuple(float(g) for g in self.gains[first : first + kind.gains])
            found.append(Element(kind, shape, gains))
            first += kind.gains
        return tuple(found)


def orthonormal(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis of the columns, those that depend on others left out."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 0] / size[size > 0]
    if kept.shape[1] == 1:
        return np.asarray(kept)
    u, s, _ = np.linalg.svd(kept, full_matrices=False)
    return np.asarray(u[:, s > DEPENDENT * s[0]] if s.size else u)


def least_squares(columns: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients with the least residual, whatever the columns' units."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    found = np.linalg.lstsq(columns / size, target, rcond=DEPENDENT)[0]
    return np.asarray(found / size)
