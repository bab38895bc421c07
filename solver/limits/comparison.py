"""Single loops, what lies between, and what any controller could do: for one demand, side by side.

Every entry is made for the same demand under the same uncertainty of the physical inputs.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from solver.limits.ending import EnoughError
from solver.limits.manual import controller_in_manual, loops_in_manual
from solver.limits.multivariable import multivariable_limit, require_covered
from solver.limits.record import LimitStatus
from solver.limits.structure_search import structured_controllers
from solver.limits.youla import youla_blocks
from solver.model.mixed_plant import MixedPlant
from solver.robustness.centralised_curves import central_blocks
from solver.tuning.clock import Clock
from solver.tuning.demands import NO_DEMANDS
from solver.tuning.record import Status
from solver.tuning.specification import Arrangement, Bounds, ControllerKind, Objective
from solver.tuning.tuner import tune

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.limits.manual import OneInManual
    from solver.limits.record import Limit
    from solver.limits.structure_search import StructuredController, StructuresFound
    from solver.model.controllers import Controller
    from solver.robustness.record import Guarantee
    from solver.tuning.record import Tuning
    from solver.tuning.specification import Specification

__all__ = ["LOOPS_SHARE", "ControllerComparison", "Entry", "Family", "compare_controllers"]

LOOPS_SHARE = 0.12  # of the time limit, at most, for each kind of single loops
BETWEEN_SHARE = 0.7  # of it, at the end of which what lies between is there; the limit has the rest
FEW = 4  # units that all have settings of their own; of more the best grouping is sought


class Family(StrEnum):
    """Kinds of controllers, from one setting for all loops to all that is linear."""

    IDENTICAL_PI = "identical_pi"
    UNLIKE_PI = "unlike_pi"
    UNLIKE_PID = "unlike_pid"
    UNLIKE_PIDF = "unlike_pidf"
    STATIC_DECOUPLING = "static_decoupling"
    ONE_WAY_DECOUPLING = "one_way_decoupling"
    INVERSE = "inverse"
    MODE_CONTROL = "mode_control"
    PAIRS = "pairs"
    MULTIVARIABLE = "multivariable"


SINGLE_LOOPS = {
    Family.IDENTICAL_PI: (ControllerKind.PI, Arrangement.IDENTICAL),
    Family.UNLIKE_PI: (ControllerKind.PI, Arrangement.INDEPENDENT),
    Family.UNLIKE_PID: (ControllerKind.PID, Arrangement.INDEPENDENT),
    Family.UNLIKE_PIDF: (ControllerKind.PIDF, Arrangement.INDEPENDENT),
}
STRUCTURES = (
    Family.STATIC_DECOUPLING,
    Family.ONE_WAY_DECOUPLING,
    Family.INVERSE,
    Family.MODE_CONTROL,
    Family.PAIRS,
)


@dataclass(frozen=True)
class Entry:
    """One kind of controller.

    Attributes
    ----------
    family : Family
        Which kind.
    value : float or None
        Its tau_P (time units) or mu; None: none was found that meets the demand, or the plant
        has no such controller.
    loops : tuple of Controller
        Settings of single loops, one a unit; else empty.
    structure : StructuredController or None
        What lies between.
    states : int or None
        Of a full controller.
    guarantee : Guarantee or None
        What is known of mu over all frequencies.
    manual : OneInManual or None
        What the worst unit in manual costs.
    exhausted : bool
        Whether the time limit ended the search.

    """

    family: Family
    value: float | None
    loops: tuple[Controller, ...] = ()
    structure: StructuredController | None = None
    states: int | None = None
    guarantee: Guarantee | None = None
    manual: OneInManual | None = None
    exhausted: bool = False


@dataclass(frozen=True, repr=False)
class ControllerComparison:
    """All kinds for one demand.

    Attributes
    ----------
    entries : tuple of Entry
        Single loops, what lies between, and a full controller that can be built.
    limit : Limit
        The best of all controllers, and the bound that none can pass.
    warnings : tuple of str
        What to look at twice.

    """

    entries: tuple[Entry, ...]
    limit: Limit
    warnings: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        """Return the value of each kind, and the limit, in a line."""
        values = [
            f"{each.family.value} {'-' if each.value is None else f'{each.value:.5g}'}"
            for each in self.entries
        ]
        return f"ControllerComparison({', '.join([*values, repr(self.limit)])})"

    @property
    def best_loops(self) -> Entry | None:
        """The best of the single loops; None where none meet the demand."""
        found = [each for each in self.entries if each.family in SINGLE_LOOPS and each.value]
        return min(found, key=lambda each: each.value or 0.0, default=None)


def compare_controllers(
    specification: Specification, *, tick: Callable[[], None] = lambda: None
) -> ControllerComparison:
    """Return what each kind of controller reaches for the task's demand.

    Parameters
    ----------
    specification : Specification
        The task; its kind and arrangement are varied, and its bounds hold for single loops. Its
        time limit is that of the whole comparison, divided among its parts: what one of them does
        not need the limit has.
    tick : callable
        Called often. `EnoughError` ends the comparison with what it has by then: single loops come
        first, then what lies between, then the limit. What else it raises passes through.

    Raises
    ------
    InvalidInputError, UnsupportedPlantError
        As of `multivariable_limit`.

    """
    plant, uncertainty = specification.plant, specification.uncertainty
    performance = specification.performance
    mixed = isinstance(plant, MixedPlant)
    if isinstance(plant, MixedPlant):  # any controller may move the inputs themselves
        plant = plant.from_inputs()
    require_covered(plant, uncertainty, performance)
    youla_blocks(central_blocks(plant, uncertainty), fast=1.0)  # refuses a singular plant at once
    until = _Deadlines(specification.time_limit, tick)
    entries: list[Entry] = []
    with contextlib.suppress(EnoughError):
        for family in _families(plant.n):
            found = _loops(specification, family, until(1.0))
            if entries and specification.bounds == Bounds():
                found = _with_contained(found, entries[-1])
            entries.append(found)
    first = entries[0].loops if entries else ()
    structured = structured_controllers(
        plant,
        uncertainty,
        performance,
        identical=first[0] if first and not mixed else None,
        tick=until(BETWEEN_SHARE),
    )
    whole = replace(specification, plant=plant)
    entries += _between(whole, structured, until(1.0))
    limit = multivariable_limit(plant, uncertainty, performance, tick=until(1.0))
    if limit.realised is not None:
        built = limit.realised
        peaks = built.robustness.peaks
        sought = performance.tau_p is None
        value = built.tau_p if sought else None if peaks is None else peaks.robust_performance.value
        manual = controller_in_manual(
            plant,
            uncertainty,
            performance.with_tau_p(built.tau_p),
            built.controller,
            until(1.0),
        )
        entries.append(
            Entry(
                Family.MULTIVARIABLE,
                value,
                states=built.states,
                guarantee=built.robustness.guarantee,
                manual=manual,
            )
        )
    limit = _no_worse(limit, entries)
    warnings = list(limit.warnings)
    if specification.demands.names or specification.scenarios or specification.spread:
        warnings.append(
            "further demands, scenarios and spread are asked of no controller in this comparison: "
            "the limit is that of the plant as given, and what serves all of them is no faster"
        )
    return ControllerComparison(tuple(entries), limit, tuple(warnings))


class _Deadlines:
    """Ticks that end the work at a share of the time limit; compiling does not count."""

    def __init__(self, limit: float | None, tick: Callable[[], None]) -> None:
        self.clock = Clock(limit, None, float)
        self.limit = math.inf if limit is None else limit
        self.tick = tick

    def __call__(self, share: float) -> Callable[[], None]:
        """Return a tick that raises `EnoughError` from that share on."""

        def tick() -> None:
            self.tick()
            if self.clock.elapsed > share * self.limit:
                raise EnoughError

        return tick


def _no_worse(limit: Limit, entries: list[Entry]) -> Limit:
    """Return the limit with the value of an entry that is below it: that is linear too.

    The search for the limit is a local one.
    """
    if limit.status is LimitStatus.UNLIMITED:
        return limit  # nothing is claimed
    values = {each.family: each.value for each in entries if each.value is not None}
    best = min(values, key=lambda family: values[family], default=None)
    if best is None or (limit.value is not None and limit.value <= values[best]):
        return limit
    status = LimitStatus.FOUND if limit.status is LimitStatus.INFEASIBLE else limit.status
    name = best.value.replace("_", " ")
    warning = f"no controller was found that is better than {name}: the limit is its value"
    warnings = (*limit.warnings, warning)
    return replace(limit, status=status, value=values[best], reason=None, warnings=warnings)


def _with_contained(found: Entry, before: Entry) -> Entry:
    """Return the entry, or the one before it under its name: its loops are of this kind too."""
    if before.value is None or (found.value is not None and found.value <= before.value):
        return found
    return replace(before, family=found.family, exhausted=found.exhausted)


def _families(n: int) -> list[Family]:
    if n == 1:
        return [Family.IDENTICAL_PI, Family.UNLIKE_PID, Family.UNLIKE_PIDF]
    return list(SINGLE_LOOPS)


def _loops(specification: Specification, family: Family, tick: Callable[[], None]) -> Entry:
    kind, arrangement = SINGLE_LOOPS[family]
    n = specification.plant.n
    if n == 1:
        arrangement = Arrangement.IDENTICAL
    elif arrangement is Arrangement.INDEPENDENT and n > FEW:
        arrangement = Arrangement.BEST
    limit = specification.time_limit
    bounds = Bounds(**{name: getattr(specification.bounds, name) for name in kind.parameters})
    task = replace(
        specification,
        kind=kind,
        arrangement=arrangement,
        group_sizes=None,
        groups=None,
        scenarios=(),
        spread=None,
        resolution=None,
        as_found=None,
        bounds=bounds,
        demands=NO_DEMANDS,
        start=None,
        certificate=False,
        model_tolerance=False,
        optimality_gap=False,
        remarks=False,
        time_limit=None if limit is None else LOOPS_SHARE * limit,
    )

    def on_progress(_: object) -> None:
        tick()

    found = tune(task, on_progress)
    value = _value(found)
    if value is None or found.tau_p is None:
        return Entry(family, None, exhausted=found.status is Status.TIME_LIMIT)
    manual = loops_in_manual(
        task.plant, task.uncertainty, task.performance.with_tau_p(found.tau_p), found.loops
    )
    return Entry(
        family,
        value,
        loops=found.loops,
        guarantee=found.guarantee,
        manual=manual,
        exhausted=found.status is Status.TIME_LIMIT,
    )


def _value(tuning: Tuning) -> float | None:
    if tuning.objective == Objective.TAU_P or tuning.peaks is None:
        return tuning.tau_p
    return tuning.peaks.robust_performance.value


def _between(
    specification: Specification, structured: StructuresFound, tick: Callable[[], None]
) -> list[Entry]:
    """Return an entry for each structure that the plant can have."""
    entries = {kind.value: Entry(Family(kind.value), None) for kind in structured.none}
    for kind in structured.ended:
        entries[kind.value] = Entry(Family(kind.value), None, exhausted=True)
    for found in structured.found:
        performance = specification.performance.with_tau_p(found.tau_p)
        manual = None
        if found.controller is not None:
            manual = controller_in_manual(
                specification.plant, specification.uncertainty, performance, found.controller, tick
            )
        entries[found.kind.value] = Entry(
            Family(found.kind.value),
            found.value,
            structure=found,
            guarantee=found.robustness.guarantee,
            manual=manual,
        )
    return [entries[family.value] for family in STRUCTURES if family.value in entries]
