"""Which demands forbid settings, and how far they would have to be relaxed.

The settings without any demand tell which demands they break, and values at which these would be
met. Those that can be kept while the others are relaxed are not to blame. The others are then
brought as near to their limits as settings are found, all by the same share of the way in
logarithms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, Decimal
from typing import TYPE_CHECKING

from solver.tuning.demand_checks import outcomes
from solver.tuning.demands import NO_DEMANDS, IntegrityDemand

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.tuning.demands import DemandOutcome, Demands
    from solver.tuning.record import Tuning
    from solver.tuning.specification import Specification

__all__ = ["LEAST_TIME", "with_the_demands_named"]

LEAST_TIME = 1.0  # seconds to find out which demand forbids settings

HALVINGS = 5  # of the way from the limits to values that are met
STARTS = 2  # of each of these searches: what they miss makes the value larger, not wrong
BEYOND = 1.002  # of a value, or its excess over 1: the search keeps margins
DIGITS = 3  # of a value in the sentence, rounded up

INTEGRITY = "integrity"


def with_the_demands_named(
    specification: Specification, found: Tuning, tune: Callable[[Specification], Tuning]
) -> Tuning:
    """Return an infeasible outcome with the demands that forbid settings, and how far to relax.

    Parameters
    ----------
    specification : Specification
        The task, with demands.
    found : Tuning
        What came of it.
    tune : callable
        Tunes a task; called while the time limit of the specification lasts.

    """
    limit, spent = specification.time_limit, found.search.elapsed_seconds

    def again(task: Specification) -> Tuning | None:
        nonlocal spent
        if limit is not None:
            if spent > limit + LEAST_TIME:
                return None
            task = replace(task, time_limit=max((limit - spent) / 2, LEAST_TIME))
        tuning = tune(task)
        spent += tuning.search.elapsed_seconds
        return tuning

    reason = _why_forbidden(specification, again)
    return found if reason is None else replace(found, reason=reason, omega=None)


def _why_forbidden(
    specification: Specification, tune: Callable[[Specification], Tuning | None]
) -> str | None:
    """Return the sentence that names the demands and how far to relax them; None: none is to blame.

    Parameters
    ----------
    specification : Specification
        A task with demands for which no settings were found.
    tune : callable
        Tunes a task; None where the time is over.

    """
    plain = replace(
        specification,
        certificate=False,
        optimality_gap=False,
        model_tolerance=False,
        as_found=None,
        rough=True,  # nothing is told of these settings but tau_p
    )
    free = tune(replace(plain, demands=NO_DEMANDS))
    if free is None or not free.loops:
        return None
    broken = [
        each
        for each in outcomes(
            specification.demands, specification.plants, free.loops, specification.uncertainties
        )
        if not each.met
    ]
    if not broken:
        return None
    way = _Way(specification.demands, tuple(broken), free)
    plain = replace(plain, starts=STARTS)

    def settings(demands: Demands) -> Tuning | None:
        found = tune(replace(plain, demands=demands))
        return found if found is not None and found.loops else None

    for each in broken:  # one that can stay is not to blame
        rest = tuple(other for other in way.broken if other is not each)
        found = settings(replace(way, broken=rest).demands(1.0)) if rest else None
        if found is not None:
            way = _Way(specification.demands, rest, found)
    low, high = 0.0, 1.0
    for _ in range(HALVINGS if any(math.isfinite(e.value) for e in way.broken) else 0):
        middle = 0.5 * (low + high)
        found = settings(way.demands(middle))
        if found is None:
            low = middle
        else:
            high, way = middle, replace(way, tuning=found)
    names = " and ".join(each.name for each in way.broken)
    relaxed = " and ".join(way.said(each, high) for each in way.broken)
    return (
        f"no settings were found that meet {names} as well; with {relaxed} there are some, with "
        f"tau_p = {way.tuning.tau_p:.6g}"
    )


@dataclass(frozen=True)
class _Way:
    """The demands to relax on the way to values that some settings have, and a tuning there."""

    asked: Demands
    broken: Sequence[DemandOutcome]
    tuning: Tuning

    def demands(self, share: float) -> Demands:
        """Return the demands with those to relax at a share of the way."""
        changes: dict[str, float | IntegrityDemand | None] = {}
        for each in self.broken:
            if each.name == INTEGRITY:
                changes[INTEGRITY] = IntegrityDemand.NONE
            else:
                changes[each.name] = self.limit(each, share)
        return replace(self.asked, **changes)  # type: ignore[arg-type]

    @staticmethod
    def limit(each: DemandOutcome, share: float) -> float | None:
        """Return the relaxed limit; None: no limit, since a loop is unstable alone."""
        if not math.isfinite(each.value):
            return None
        least = 1.0 if each.name == "max_sensitivity_alone" else 0.0
        start, end = each.limit - least, (each.value - least) * BEYOND
        return _rounded_up(least + start * (end / start) ** share)

    def said(self, each: DemandOutcome, share: float) -> str:
        """Say what becomes of a demand."""
        if each.name == INTEGRITY:
            if each.limit == 0 or math.isinf(each.value):
                return "no integrity (some sets of loops in service are unstable then)"
            return f"no robust stability of every set (mu up to {each.value:.4g} then)"
        limit = self.limit(each, share)
        if limit is None:
            return f"no {each.name} (a loop is unstable alone then)"
        return f"{each.name} {each.limit:g} relaxed to {limit:g}"


def _rounded_up(value: float) -> float:
    exact = Decimal(value)
    step = Decimal(1).scaleb(exact.adjusted() - DIGITS + 1)
    return float((exact / step).to_integral_value(ROUND_CEILING) * step)
