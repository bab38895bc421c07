"""Which form each element has: by prediction of readings kept back, not by fit.

The record is cut into blocks; each quarter of them is predicted by what the others tell. A richer
form is taken only if it predicts better by more than the standard error of the difference over the
blocks (Breiman, Friedman, Olshen and Stone 1984, section 3.4.3), half as much again since blocks of
one record are not quite independent; of rare forms by two and a half. Readings weighted by the
colour of the simple form's residual must ask for it too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import ElementKind
from solver.identification.fitting import fit
from solver.identification.noise import covariance
from solver.identification.row import Row
from solver.identification.start import scan
from solver.identification.weighting import coloured
from solver.model.errors import InvalidInputError
from solver.model.validation import flag, integer, settle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.fitting import TimeLimits
    from solver.identification.row import Solved

__all__ = ["Allowed", "begin", "select"]

BLOCKS = 16
FOLDS = 4
FEW_STEPS = 12
# Less than this part of the error kept back is no reason for another parameter.
WORTH = 0.02
ERRORS = 1.5  # standard errors: between the one of the rule and two

# The same of forms that are rare in plants, and predict badly where they are chosen wrongly.
RARE = 2.5

_NEXT = {
    ElementKind.FIRST: (ElementKind.SECOND, ElementKind.INTEGRATOR),
    ElementKind.SECOND: (ElementKind.INTEGRATOR_LAG,),
    ElementKind.INTEGRATOR: (ElementKind.INTEGRATOR_LAG,),
}
# Tried where none of the others is better.
_LAST = {
    ElementKind.FIRST: (ElementKind.SECOND_ZERO, ElementKind.RESONANT),
    ElementKind.SECOND: (ElementKind.SECOND_ZERO, ElementKind.RESONANT),
    ElementKind.INTEGRATOR_LAG: (ElementKind.INTEGRATOR_ZERO,),
}


@dataclass(frozen=True)
class Allowed:
    """Forms that may be tried.

    Attributes
    ----------
    order : int or None
        1 or 2: every element has it. None: by prediction.
    integrating : bool or None
        Whether elements integrate. None: by prediction.

    """

    order: int | None = None
    integrating: bool | None = None

    def __post_init__(self) -> None:
        if self.order is not None:
            settle(self, order=integer(self.order, "/order"))
            if self.order not in {1, 2}:
                message = "must be 1, 2 or None"
                raise InvalidInputError(message, "/order")
        if self.integrating is not None:
            settle(self, integrating=flag(self.integrating, "/integrating"))

    def simplest(self) -> ElementKind:
        """Return the form that all elements begin with."""
        if self.integrating:
            return ElementKind.INTEGRATOR if self.order in {None, 1} else ElementKind.INTEGRATOR_LAG
        return ElementKind.SECOND if self.order == 2 else ElementKind.FIRST

    def richer(self, kind: ElementKind, *, last: bool) -> list[ElementKind]:
        """Return the forms to try after `kind`."""
        found = []
        for other in (_LAST if last else _NEXT).get(kind, ()):
            if other.integrating and not kind.integrating:
                if self.integrating is None:
                    found.append(other)
            elif self.order is None:
                found.append(other)
        return found


def begin(row: Row, kinds: Sequence[ElementKind], limits: TimeLimits) -> Solved:
    """Return the best fit of given forms, from a scan."""
    # A lag says nothing of an integrator: such elements are scanned as what they are.
    first = kinds[0] if all(kind.integrating for kind in kinds) else ElementKind.FIRST
    scanned = scan(row, limits, first).shapes
    starts = [[_shape(kind, *shape, share) for kind, shape in zip(kinds, scanned, strict=True)]
              for share in (0.0, 0.5, 1.0)]  # fmt: skip
    if not any("ratio" in kind.shape_names for kind in kinds):
        starts = starts[-1:]
    fits = [fit(row, kinds, start, limits) for start in starts]
    return min(fits, key=lambda one: one.cost)


def select(row: Row, allowed: Allowed, limits: TimeLimits) -> tuple[Solved, tuple[int, ...]]:
    """Return the fit with the forms that predict best, simple ones preferred.

    Elements without which the readings kept back are predicted as well have the shape of the
    strongest element: no time can be fitted to what is not seen. They come second.

    Parameters
    ----------
    row : Row
        Thinned: every trial is a handful of fits.
    allowed : Allowed
        What may be tried.
    limits : TimeLimits
        Bounds of the parameters.

    """
    best = begin(row, [allowed.simplest()] * row.inputs, limits)
    score = kept_back(row, best, limits)
    refused: set[tuple[int, ElementKind]] = set()
    last = False
    while True:
        found = None
        for index, kind in enumerate(best.kinds):
            for other in allowed.richer(kind, last=last):
                if (index, other) in refused:
                    continue
                trial = _richer(row, best, index, other, limits)
                value = kept_back(row, trial, limits)
                if not (
                    _better(score, value, fewer=other.size <= kind.size, rare=_rare(kind, other))
                    and _zero_is_told(row, trial, index, limits)
                    and _likelier(row, best, trial, limits)
                ):
                    refused.add((index, other))
                elif found is None or value.sum() < found[1].sum():
                    found = (trial, value)
        if found is not None:
            best, score = found
            last = False
        elif last:
            break
        else:
            last = True
    return _without_unseen(row, best, score, limits)


def _zero_is_told(row: Row, trial: Solved, index: int, limits: TimeLimits) -> bool:
    """Whether a zero is more than a dead time in other words."""
    if trial.kinds[index].gains < 2:
        return True
    told = covariance(row, trial, limits)
    place = sum(kind.gains for kind in trial.kinds[: index + 1]) - 1
    shapes = sum(len(shape) for shape in trial.shapes)
    error = float(told.matrix[shapes + place, shapes + place]) ** 0.5
    return bool(abs(trial.gains[place]) > told.quantile * error)


def _likelier(row: Row, simple: Solved, rich: Solved, limits: TimeLimits) -> bool:
    """Whether readings weighted by the simple fit's colour ask for the rich form (Schwarz).

    A slow disturbance looks alike in neighbouring blocks, so a form that follows it predicts them;
    weighted by its colour, it hardly counts.
    """
    row = coloured(row, simple) or row
    costs = [fit(row, one.kinds, one.shapes, limits).cost for one in (simple, rich)]
    more = sum(kind.size for kind in rich.kinds) - sum(kind.size for kind in simple.kinds)
    count = row.readings
    return costs[1] <= 0 or count * math.log(costs[0] / costs[1]) > max(more, 1) * math.log(count)


def _without_unseen(
    row: Row, solved: Solved, score: NDArray[np.float64], limits: TimeLimits
) -> tuple[Solved, tuple[int, ...]]:
    strength = [
        float(np.linalg.norm(solved.left[:, place] @ solved.gains[place]))
        for place in _gain_places(solved.kinds)
    ]
    strongest = int(np.argmax(strength))
    unseen: list[int] = []
    for index in np.argsort(strength):
        if index == strongest:
            continue
        kinds = [ElementKind.NONE if j == index else k for j, k in enumerate(solved.kinds)]
        shapes = [() if j == index else s for j, s in enumerate(solved.shapes)]
        without = kept_back(row, fit(row, kinds, shapes, limits), limits)
        if not _better(without, score, fewer=True):
            unseen.append(int(index))
    while unseen:
        kinds = [solved.kinds[strongest] if j in unseen else k for j, k in enumerate(solved.kinds)]
        shapes = [
            solved.shapes[strongest] if j in unseen else s for j, s in enumerate(solved.shapes)
        ]
        fixed = replace(limits, fixed={j: shapes[j] for j in unseen})
        best = fit(row, kinds, shapes, fixed)
        shapes = [best.shapes[strongest] if j in unseen else s for j, s in enumerate(best.shapes)]
        alone = row.solve(kinds, shapes)
        # Blocks of outputs that wander far predict nothing well; a gain that is told is an effect.
        told = [j for j in unseen if _gain_is_told(row, alone, j, fixed)]
        if not told:
            return alone, tuple(sorted(unseen))
        unseen = [j for j in unseen if j not in told]
    return solved, ()


def _gain_is_told(row: Row, solved: Solved, index: int, limits: TimeLimits) -> bool:
    """Whether the interval of an element's gains leaves out zero."""
    found = covariance(row, solved, limits)
    first = sum(len(shape) for shape in solved.shapes)
    error = np.sqrt(np.diag(found.matrix))[first:]
    place = _gain_places(solved.kinds)[index]
    return bool(np.any(np.abs(solved.gains[place]) > found.quantile * error[place]))


def _gain_places(kinds: Sequence[ElementKind]) -> list[slice]:
    ends = np.cumsum([kind.gains for kind in kinds])
    return [slice(int(end) - kind.gains, int(end)) for end, kind in zip(ends, kinds, strict=True)]


def kept_back(row: Row, solved: Solved, limits: TimeLimits) -> NDArray[np.float64]:
    """Return the squared error of prediction of each block, by what the other blocks tell."""
    each = max(math.ceil(BLOCKS / len(row.segments)), 2)
    labels, count = [], 0
    for segment in row.segments:
        size = segment.time.size
        labels.append(count + np.arange(size) * each // size)
        count += each
    errors = np.zeros(count)
    for fold in range(FOLDS):
        segments = tuple(
            replace(segment, weight=np.where(label % FOLDS == fold, 0.0, segment.weight))
            for segment, label in zip(row.segments, labels, strict=True)
        )
        reduced = replace(row, segments=segments)
        trained = fit(reduced, solved.kinds, solved.shapes, limits, most_steps=FEW_STEPS)
        own = reduced.own_parts(trained)
        for segment, label, block, part in zip(
            row.segments, labels, trained.blocks, own, strict=True
        ):
            away = (segment.output - block @ trained.gains - part) * segment.weight
            held = label % FOLDS == fold
            errors += np.bincount(label[held], away[held] ** 2, minlength=count)
    return errors


def _rare(simple: ElementKind, rich: ElementKind) -> bool:
    return rich not in {ElementKind.FIRST, ElementKind.SECOND} and not (
        rich is ElementKind.INTEGRATOR_LAG and simple is ElementKind.INTEGRATOR
    )


def _better(
    simple: NDArray[np.float64], rich: NDArray[np.float64], *, fewer: bool, rare: bool = False
) -> bool:
    gain = simple - rich
    spread = float(np.std(gain, ddof=1)) * math.sqrt(gain.size)
    least = 0.0 if fewer else WORTH * float(simple.sum())
    return float(gain.sum()) > max((RARE if rare else ERRORS) * spread, least)


def _richer(row: Row, solved: Solved, index: int, kind: ElementKind, limits: TimeLimits) -> Solved:
    old, shape = solved.kinds[index], solved.shapes[index]
    options: list[tuple[float, ...]]
    kinds = [*solved.kinds[:index], kind, *solved.kinds[index + 1 :]]
    if old is ElementKind.FIRST and kind is ElementKind.INTEGRATOR:
        options = [(shape[-1],), (0.0,)]
    elif old is ElementKind.SECOND and kind is ElementKind.INTEGRATOR_LAG:
        second = math.exp(shape[0]) * shape[1] / 4
        options = [(math.log(max(second, limits.shortest)), shape[-1]),
                   (math.log(limits.sample), shape[-1])]  # fmt: skip
    elif old is ElementKind.FIRST:
        options = [_shape(kind, shape[0], shape[1], share) for share in (0.0, 0.5, 1.0)]
    elif old is ElementKind.INTEGRATOR:
        options = [
            (math.log(max(shape[0], limits.sample)), 0.0),
            (math.log(limits.sample), shape[0]),
        ]
    else:
        options = [shape, (*shape[:-1], shape[-1] / 2), (*shape[:-1], 0.0)]
    fits = [
        fit(row, kinds, [*solved.shapes[:index], option, *solved.shapes[index + 1 :]], limits)
        for option in options
    ]
    return min(fits, key=lambda one: one.cost)


def _shape(kind: ElementKind, log_lag: float, dead_time: float, share: float) -> tuple[float, ...]:
    """Return a start for a form near a first-order one; the dead time keeps a share of it."""
    if kind is ElementKind.NONE:
        return ()
    if kind is ElementKind.INTEGRATOR:
        return (dead_time,)
    if "ratio" in kind.shape_names:
        lag = math.exp(log_lag) + (1 - share) * dead_time
        return (math.log(lag), (1.0, 0.8, 0.3)[round(2 * share)], share * dead_time)
    return (log_lag, dead_time)
