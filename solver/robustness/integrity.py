"""Integrity: what happens when loops are put in manual, or their gains are turned down.

Every subset of loops in service is analysed on its own plant: nominal stability, and the peaks
of mu for robust stability and robust performance of the loops that remain. Units of a parallel
plant with equal settings are interchangeable, so a set is known by how many of each group it
holds: n = 50 in two groups of 25 has 675 kinds of sets in place of 2^50 - 1.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.integral_controllability import (
    IntegralControllability,
    integral_controllability,
    parallel_integral_controllability,
)
from solver.interaction.parallel_matrix import ParallelMatrix
from solver.model.blocks import group_loops
from solver.model.errors import InvalidInputError
from solver.model.given import require_loops, require_weights
from solver.model.peaks import Peak
from solver.model.plants import ParallelPlant
from solver.model.subsystems import interchangeable, subsystem
from solver.robustness.axis import kept, proven_peaks, require_bounded
from solver.robustness.curves import LoopAnalysis
from solver.robustness.record import Guarantee, GuaranteeStatus
from solver.robustness.reduced_gains import ReducedGains, reduced_gains
from solver.robustness.subset_peaks import peaks
from solver.robustness.subsets import Subsets

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty
    from solver.robustness.record import Peaks

__all__ = [
    "MAX_CLASSES",
    "Detuning",
    "Integrity",
    "ServiceClass",
    "in_one_line",
    "integrity",
    "service_classes",
    "summarise",
]

MAX_CLASSES = 1023  # all subsets of ten loops, or two groups of 31
READABLE = 10**6  # counts above are given as shares
TOLERANCE = 1e-6  # a tuning ends with its peak at one, to rounding
MAX_IN_PASSING = 300  # kinds of sets times the square of the block's size: four different loops
MAX_PROVEN = 15  # kinds of sets, of four different loops: half a second
MAX_DETUNED = 800  # six loops at three factors are 728
LEVELS = (5, 4, 3)  # equidistant gain factors, 0 and 1 among them: the most that are allowed


@dataclass(frozen=True)
class ServiceClass:
    """Sets of loops in service that symmetry makes equal.

    Attributes
    ----------
    in_service : tuple of int
        How many loops of each group are in service, at least one in all.
    subsets : int
        How many sets of loops this stands for, exact.
    nominally_stable : bool
        Whether the loops in service are stable.
    robust_stability, robust_performance : Peak or None
        Peaks of mu of the loops in service; None where they are unstable.
    guarantee : Guarantee or None
        What is proven of robust performance over all frequencies; None likewise.

    """

    in_service: tuple[int, ...]
    subsets: int
    nominally_stable: bool
    robust_stability: Peak | None
    robust_performance: Peak | None
    guarantee: Guarantee | None = None


@dataclass(frozen=True)
class Detuning:
    """Nominal stability with gains reduced independently: on a grid, and between its points.

    Attributes
    ----------
    factors : tuple of float
        The factors tried on each gain; 0 is a loop in manual.
    by_group : bool
        Whether the loops of a group were reduced alike, there being too many combinations.
    combinations, unstable : int
        Combinations tried, interchangeable ones once, and those found unstable.
    example : tuple of float or None
        Factor of each unit in an unstable combination.
    between : ReducedGains or None
        What holds for all factors between those of the grid; None with more loops than it takes, or
        where a combination is unstable anyway.

    """

    factors: tuple[float, ...]
    by_group: bool
    combinations: int
    unstable: int
    example: tuple[float, ...] | None
    between: ReducedGains | None = None


@dataclass(frozen=True)
class Integrity:
    """Integrity of the loops of a plant.

    Attributes
    ----------
    groups : tuple of tuples of int
        Units whose loops are interchangeable.
    classes : tuple of ServiceClass
        All kinds of sets in service, those with the most loops first.
    detuning : Detuning or None
        None where even two groups' worth of combinations would be too many.
    controllability : IntegralControllability or None
        Conditions on the plant for any controllers; None for an integrating plant, whose static
        gain is infinite.

    """

    groups: tuple[tuple[int, ...], ...]
    classes: tuple[ServiceClass, ...]
    detuning: Detuning | None
    controllability: IntegralControllability | None

    @property
    def stable(self) -> bool:
        """Whether the loops stay nominally stable whichever of them are in manual."""
        return all(each.nominally_stable for each in self.classes)

    @property
    def summary(self) -> str:
        """One line; see `summarise`."""
        return summarise(self.classes)


def integrity(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
) -> Integrity:
    """Analyse given loops with any of them in manual.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit.

    Raises
    ------
    InvalidInputError
        Not one loop a unit, no `tau_p`, more than `MAX_CLASSES` kinds of sets.
    UnsupportedPlantError
        The plant is open-loop unstable.

    """
    loops = require_loops(plant, loops)
    classes = service_classes(plant, uncertainty, performance, loops)
    groups = interchangeable(plant, loops, uncertainty, performance.output_scale)
    return Integrity(groups, classes, _detuning(plant, loops, groups), _controllability(plant))


def service_classes(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    *,
    whole: tuple[Peaks, Guarantee] | None = None,
) -> tuple[ServiceClass, ...]:
    """Return all kinds of sets of loops in service, those with the most loops first.

    `whole` is what is known of all loops together, which is then not proven anew. Other parameters,
    errors: as for `integrity`.
    """
    loops = require_loops(plant, loops)
    require_weights(plant, uncertainty, performance)
    groups = interchangeable(plant, loops, uncertainty, performance.output_scale)
    count = math.prod(len(group) + 1 for group in groups) - 1
    if count > MAX_CLASSES:
        message = (
            f"{_number(count)} kinds of sets of loops in service, at most {MAX_CLASSES} are "
            "analysed; give more loops equal settings"
        )
        raise InvalidInputError(message, "/loops")
    kinds = _kinds(groups)
    controllers = tuple(loops[group[0]] for group in groups)
    sets = Subsets(plant, controllers, np.array(kinds, dtype=float))
    stable = sets.unstable_poles() == 0
    found = iter(
        _proven(
            plant,
            uncertainty,
            performance,
            loops,
            kinds=itertools.compress(kinds, stable),
            whole=whole,
        )
        if np.count_nonzero(stable) <= MAX_PROVEN
        else _sampled(
            Subsets(plant, controllers, sets.counts[stable]), uncertainty, performance, loops
        )
    )
    return tuple(
        ServiceClass(
            kind,
            _count(groups, kind),
            good,
            *(next(found) if good else (None, None, None)),
        )
        for kind, good in zip(kinds, stable.tolist(), strict=True)
    )


_Found = tuple[Peak, Peak, Guarantee]


def _proven(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    *,
    kinds: Iterable[tuple[int, ...]],
    whole: tuple[Peaks, Guarantee] | None,
) -> list[_Found]:
    """Peaks of robust stability and performance of each kind of set, over all frequencies."""
    groups = interchangeable(plant, loops, uncertainty, performance.output_scale)
    found = []
    for kind in kinds:
        units = _units(groups, kind)
        if whole is not None and len(units) == plant.n:
            top, guarantee = whole
            found.append((top.robust_stability, top.robust_performance, guarantee))
            continue
        part, remaining = subsystem(plant, loops, units)
        axis = proven_peaks(
            part, plant.errors_of(uncertainty, units), performance.of_units(units), remaining
        )
        found.append((axis.peaks.robust_stability, axis.peaks.robust_performance, axis.guarantee))
    return found


def _sampled(
    sets: Subsets, uncertainty: Uncertainty, performance: Performance, loops: Sequence[Controller]
) -> list[_Found]:
    """Return the same for many kinds at once, on the grid of all loops together, refined."""
    analysis = LoopAnalysis(
        *group_loops(sets.plant, loops, uncertainty, performance.output_scale),
        uncertainty,
        performance,
    )
    require_bounded(analysis, loops)
    groups = interchangeable(sets.plant, loops, uncertainty, performance.output_scale)
    units = [group[0] for group in groups]
    errors = None
    if performance.output_scale is not None:
        errors = np.array([performance.output_scale[unit] for unit in units])
    reason = f"more than {MAX_PROVEN} kinds of sets: their peaks are sampled"
    return [
        (stability, robust, Guarantee(GuaranteeStatus.OPEN, robust.value, reason))
        for stability, robust in zip(
            *peaks(
                sets,
                sets.plant.errors_of(uncertainty, units),
                performance,
                analysis.omega[::2],
                errors=errors,
            ),
            strict=True,
        )
    ]


def in_one_line(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    *,
    whole: tuple[Peaks, Guarantee] | None = None,
) -> str:
    """Return the summary for a tuning's result, where it takes a fraction of a second.

    Otherwise say that it was left out. Parameters, errors: as for `service_classes`.
    """
    groups = interchangeable(plant, loops, uncertainty, performance.output_scale)
    count = math.prod(len(group) + 1 for group in groups) - 1
    if count * len(groups) ** 2 > MAX_IN_PASSING:
        return f"loops out of service: {_number(count)} kinds of sets, not analysed in passing"
    kinds = _kinds(groups)
    if len(kinds) > MAX_PROVEN:
        return summarise(service_classes(plant, uncertainty, performance, loops, whole=whole))
    rows = []
    if whole is not None:  # its loops are stable, or there were no peaks
        top, _ = whole
        kept_by_all = _kept(top.robust_stability), _kept(top.robust_performance)
        rows, kinds = [(1, True, *kept_by_all)], kinds[1:]
    for kind in kinds:
        units = _units(groups, kind)
        part, remaining = subsystem(plant, loops, units)
        held = kept(
            part,
            plant.errors_of(uncertainty, units),
            performance.of_units(units),
            remaining,
            1 + TOLERANCE,
        )
        rows.append((_count(groups, kind), *held))
    return _line(rows)


def summarise(classes: Sequence[ServiceClass]) -> str:
    """Say in one line how many of the sets of loops in service are stable, robust, performing."""
    return _line(
        [
            (
                each.subsets, each.nominally_stable,
                _kept(each.robust_stability), _kept(each.robust_performance),
            )
            for each in classes
        ]
    )  # fmt: skip


def _line(rows: Sequence[tuple[int, bool, bool, bool]]) -> str:
    """Say it of kinds of sets: how many, and whether stable, robust, performing."""
    total = sum(row[0] for row in rows)

    def count(condition: int) -> str:
        held = sum(row[0] for row in rows if row[condition])
        if held in {0, total}:
            return "all" if held else "none"
        return f"{held:,}" if total < READABLE else _share(Fraction(held, total))

    sets = "set" if total == 1 else "sets"
    return (
        f"loops out of service: of {_number(total)} {sets} of loops in service {count(1)} "
        f"stable, {count(2)} robustly stable, {count(3)} with robust performance"
    )


def _kinds(groups: Sequence[Sequence[int]]) -> list[tuple[int, ...]]:
    """How many loops of each group are in service, those with the most loops first."""
    every = itertools.product(*(range(len(group), -1, -1) for group in groups))
    return sorted(every, key=sum, reverse=True)[:-1]


def _units(groups: Sequence[Sequence[int]], kind: tuple[int, ...]) -> list[int]:
    """Return the units of one set of a kind."""
    return sorted(unit for group, k in zip(groups, kind, strict=True) for unit in group[:k])


def _count(groups: Sequence[Sequence[int]], kind: tuple[int, ...]) -> int:
    """How many sets are of a kind."""
    return math.prod(math.comb(len(group), k) for group, k in zip(groups, kind, strict=True))


def _detuning(
    plant: Plant, loops: Sequence[Controller], groups: Sequence[Sequence[int]]
) -> Detuning | None:
    """Try reduced gains on the finest grid that is small enough."""
    for by_group in (False, True):
        for levels in LEVELS:
            sizes = [1 if by_group else len(group) for group in groups]
            count = math.prod(math.comb(size + levels - 1, size) for size in sizes) - 1
            if count <= MAX_DETUNED:
                factors = tuple(level / (levels - 1) for level in range(levels))
                return _detuned(plant, loops, groups, factors, by_group=by_group)
    return None


def _detuned(
    plant: Plant,
    loops: Sequence[Controller],
    groups: Sequence[Sequence[int]],
    factors: tuple[float, ...],
    *,
    by_group: bool,
) -> Detuning:
    choices = [
        [(factor,) * len(group) for factor in factors]
        if by_group
        else list(itertools.combinations_with_replacement(factors, len(group)))
        for group in groups
    ]
    units = [unit for group in groups for unit in group]
    factor = np.zeros((math.prod(len(given) for given in choices), plant.n))
    for row, choice in enumerate(itertools.product(*choices)):
        factor[row, units] = list(itertools.chain.from_iterable(choice))
    factor = factor[factor.any(axis=1)]
    controllers, counts = tuple(loops), factor
    if plant.interchangeable:
        controllers = tuple(
            replace(loop, gain=loop.gain * level)
            for loop in (loops[group[0]] for group in groups)
            for level in factors[1:]
        )
        counts = np.stack(
            [
                np.count_nonzero(factor[:, group] == level, axis=1)
                for group in groups
                for level in factors[1:]
            ],
            axis=1,
        ).astype(float)
    unstable = Subsets(plant, controllers, counts).unstable_poles() > 0
    return Detuning(
        factors=factors,
        by_group=by_group,
        combinations=len(factor),
        unstable=int(np.count_nonzero(unstable)),
        example=tuple(factor[np.argmax(unstable)].tolist()) if unstable.any() else None,
        between=None if unstable.any() else reduced_gains(plant, loops),
    )


def _controllability(plant: Plant) -> IntegralControllability | None:
    if any(not math.isfinite(element.static_gain) for element in plant.elements):
        return None
    if isinstance(plant, ParallelPlant):
        other = plant.interaction.static_gain if plant.n > 1 else 0.0
        return parallel_integral_controllability(
            ParallelMatrix(plant.n, plant.process.static_gain, other)
        )
    return integral_controllability(np.asarray(plant.static_gain()))


def _kept(peak: Peak | None) -> bool:
    return peak is not None and peak.value <= 1 + TOLERANCE


def _share(part: Fraction) -> str:
    percent = 100 * float(part)
    if percent > 99.9:
        return "over 99.9 %"
    return f"{percent:.3g} %" if percent >= 0.1 else "under 0.1 %"


def _number(count: int) -> str:
    return f"{count:,}" if count < READABLE else f"about 10^{math.log10(count):.0f}"
