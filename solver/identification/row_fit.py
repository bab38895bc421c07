"""A row from readings to elements with standard errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import Element, ElementKind
from solver.identification.fitting import fit, split, without_spikes
from solver.identification.noise import Covariance, covariance
from solver.identification.problem import thinned
from solver.identification.row import Row
from solver.identification.selection import begin, select
from solver.identification.weighting import coloured, levelled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.fitting import TimeLimits
    from solver.identification.row import Solved
    from solver.identification.selection import Allowed

__all__ = ["RowFit", "fit_row", "refit_row"]

# The form of an element shows in a thousand readings or in none; trials are made on so many.
TRIED = 1500


@dataclass(frozen=True, eq=False)
class RowFit:
    """A row's elements and how well the readings tell them.

    Attributes
    ----------
    row : Row
        The readings with their final weights.
    solved : Solved
        The fit.
    covariance : Covariance
        Of shapes and gains.
    limits : TimeLimits
        The box of the shapes.

    """

    row: Row
    solved: Solved
    covariance: Covariance
    limits: TimeLimits

    @property
    def elements(self) -> tuple[Element, ...]:
        """The elements with their numbers."""
        return self.solved.elements

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Shapes, then gains."""
        return np.array([*(v for shape in self.solved.shapes for v in shape), *self.solved.gains])

    @property
    def spikes(self) -> int:
        """Number of readings left out as spikes."""
        return sum(int(np.count_nonzero(s.weight == 0)) for s in self.row.segments)

    def residuals(self) -> list[NDArray[np.float64]]:
        """Return reading minus fit of each segment, spikes included."""
        own = self.row.own_parts(self.solved)
        return [
            segment.output - block @ self.solved.gains - part
            for segment, block, part in zip(self.row.segments, self.solved.blocks, own, strict=True)
        ]

    def places(self) -> list[tuple[list[int], list[int]]]:
        """Return where each element's shapes and gains stand among the parameters."""
        shapes, gains = 0, sum(len(shape) for shape in self.solved.shapes)
        found = []
        for kind in self.solved.kinds:
            found.append(
                (
                    list(range(shapes, shapes + len(kind.shape_names))),
                    list(range(gains, gains + kind.gains)),
                )
            )
            shapes += len(kind.shape_names)
            gains += kind.gains
        return found

    def draws(self, count: int, generator: np.random.Generator) -> NDArray[np.float64]:
        """Return parameters drawn from the fitted distribution, (count, parameters).

        Normal in the shapes and, where a gain is known to its sign, in its logarithm, within the
        box of what the record can tell. Degrees of freedom widen it as they widen the intervals.
        """
        factor = self.covariance.factor
        z = generator.standard_normal((count, factor.shape[1]))
        away = z @ factor.T * (self.covariance.quantile / NORMAL)
        mean = self.parameters
        shapes = sum(len(shape) for shape in self.solved.shapes)
        drawn = mean + away
        low, high = self.limits.box(self.solved.kinds)
        drawn[:, :shapes] = np.clip(drawn[:, :shapes], low, high)
        for places, kind in zip(self.places(), self.solved.kinds, strict=True):
            _draw_gains(drawn, away, self, kind, places)
        return drawn


NORMAL = 2.241402727604947  # the normal distribution's quantile for intervals of the same width
SIGNED = 3.0  # standard errors from zero


def _draw_gains(
    drawn: NDArray[np.float64],
    away: NDArray[np.float64],
    fit: RowFit,
    kind: ElementKind,
    places: tuple[list[int], list[int]],
) -> None:
    """Fill in the first gain by its ratio to the lag, which a short record tells better than both.

    In the logarithm where the sign of that ratio is known.
    """
    mean, factor = fit.parameters, fit.covariance.factor
    shapes, gains = places
    if not gains or mean[gains[0]] == 0:
        return
    gain, place = mean[gains[0]], gains[0]
    lagged = "log_lag" in kind.shape_names and not kind.integrating
    lag = shapes[0] if lagged else None
    slope = away[:, place] / gain - (away[:, lag] if lag is not None else 0.0)
    row = factor[place] / gain - (factor[lag] if lag is not None else 0.0)
    if SIGNED * float(np.linalg.norm(row)) < 1:
        moved = drawn[:, lag] - mean[lag] if lag is not None else 0.0
        drawn[:, place] = gain * np.exp(slope + moved)


def fit_row(row: Row, allowed: Allowed, limits: TimeLimits) -> RowFit:
    """Return the fit of a row, forms chosen by prediction."""
    row = _first_look(row, limits)
    thin = thinned(row, TRIED)
    chosen, unseen = select(thin, allowed, limits)
    if unseen:
        limits = replace(limits, fixed={index: chosen.shapes[index] for index in unseen})
    return refit_row(row, chosen.kinds, chosen.shapes, limits)


def refit_row(
    row: Row, kinds: Sequence[ElementKind], shapes: Sequence[Sequence[float]], limits: TimeLimits
) -> RowFit:
    """Return the fit of given forms, from given shapes on; spikes, levels and colours anew."""
    solved = fit(row, kinds, shapes, limits)
    cleaned = levelled(without_spikes(row, solved), solved)
    if any(
        not np.array_equal(a.weight, b.weight)
        for a, b in zip(row.segments, cleaned.segments, strict=True)
    ):
        row = cleaned
        solved = fit(row, kinds, solved.shapes, limits)
    solved = _rescanned(row, solved, limits)
    weighted = coloured(row, solved)
    if weighted is None:
        return RowFit(row, solved, covariance(row, solved, limits), limits)
    solved = _rescanned(weighted, fit(weighted, kinds, solved.shapes, limits), limits)
    # The colour is told too poorly to trust what the weighted fit says of its own errors; those of
    # the plain fit are larger and ask for no colour's memory.
    colours = [segment.colour for segment in weighted.segments]
    plain = covariance(row, row.solve(kinds, solved.shapes), limits, colours)
    return RowFit(weighted, solved, plain, limits)


def _first_look(row: Row, limits: TimeLimits) -> Row:
    """Return the row without the spikes that stand out from any fit."""
    rough = begin(thinned(row, TRIED), [ElementKind.FIRST] * row.inputs, limits)
    return without_spikes(row, row.solve(rough.kinds, rough.shapes))


def _rescanned(row: Row, solved: Solved, limits: TimeLimits) -> Solved:
    """Return a better fit from other dead times, where there is one: there are several minima."""
    thin = thinned(row, TRIED)
    best = solved
    for index, kind in enumerate(solved.kinds):
        if not kind.shape_names or index in limits.fixed:
            continue
        position = sum(len(k.shape_names) for k in solved.kinds[: index + 1]) - 1
        x = np.array([v for shape in best.shapes for v in shape])
        here = thin.solve(solved.kinds, split(solved.kinds, x)).cost
        for away in (-3.0, -1.0, -0.5, 0.5, 1.0, 3.0):
            moved = x.copy()
            moved[position] = np.clip(moved[position] + away * limits.sample, 0, limits.dead_time)
            trial = fit(thin, solved.kinds, split(solved.kinds, moved), limits, most_steps=6)
            if trial.cost < here * (1 - 1e-4):
                full = fit(row, solved.kinds, trial.shapes, limits)
                if full.cost < best.cost:
                    best, here = full, trial.cost
    return best
