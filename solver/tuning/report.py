"""The result of a tuning, every number of it computed anew from the settings."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.certificate.search import PROVEN_ABOVE, prove
from solver.model.loop_names import loops_text
from solver.model.remarks import plant_remarks
from solver.robustness.integrity import in_one_line
from solver.robustness.model_tolerance import model_tolerances, tolerance_remark
from solver.tuning.advice import advice
from solver.tuning.as_found import as_found
from solver.tuning.bounds import gain_signs
from solver.tuning.clock import OutOfTimeError
from solver.tuning.demand_checks import outcomes
from solver.tuning.endless import remarks
from solver.tuning.goals import LARGEST_S
from solver.tuning.nearby import tolerance
from solver.tuning.output_units import output_units_warning
from solver.tuning.plain_advice import plain_advice
from solver.tuning.record import (
    Comparison,
    LocalOptimum,
    ScenarioOutcome,
    SearchSummary,
    Status,
    Tuning,
)
from solver.tuning.rounded import rounded, too_coarse
from solver.tuning.scenario_outcomes import binding, of_spread, overall, scenario_outcomes
from solver.tuning.settle import Settled, settled
from solver.tuning.specification import Objective
from solver.tuning.spread_proof import proven_spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from solver.certificate.record import Certificate
    from solver.model.controllers import Controller
    from solver.optimality.record import Optimality
    from solver.robustness.model_tolerance import ModelTolerance
    from solver.robustness.record import Guarantee
    from solver.tuning.beside import PriceOfResolution
    from solver.tuning.clock import Clock
    from solver.tuning.groupings import Groups
    from solver.tuning.search import GroupingSearch
    from solver.tuning.solutions import Solution, Solutions
    from solver.tuning.specification import Specification

__all__ = ["infeasible", "report"]

TO_ROUND = 1.0  # seconds after the end, in which the best so far is made what can be typed in
ALIKE = 1e-6  # of the objective, in log: what rounding may make of equal settings
OTHER_SIGNS = (
    "{loops}: gain of the sign opposite to that of the own process: stable only together with the "
    "others, never alone"
)


def report(
    specification: Specification,
    solutions: Solutions,
    clock: Clock,
    chosen: Solution,
    status: Status,
) -> Tuning:
    """Return the result of a tuning that found settings.

    Raises
    ------
    InvalidInputError
        The best tau_P is too large a number.

    """
    end, late = _ended(specification, chosen, clock)
    alike = _better_alike(specification, solutions, chosen.search, end)
    search, end = (chosen.search, end) if alike is None else alike
    status = Status.TIME_LIMIT if late else status
    if end is None:
        return _none_kept(specification, search, chosen, clock, status)
    price = None
    if specification.resolution is not None:
        found, status = _rounded(specification, solutions, search, end, clock, status=status)
        if found is None:
            return _none_rounded(specification, search, end, clock, status)
        end, price = found
    demands = outcomes(
        specification.demands, specification.plants, end.loops, specification.uncertainties
    )
    unmet = [each for each in demands if not each.met]
    if unmet:
        return _unmet(specification, search, clock, unmet[0].name, status)
    warnings = [
        *plant_remarks(specification.plant),
        *filter(None, [output_units_warning(specification.plant, specification.performance)]),
        *_sign_warnings(specification, search),
        *remarks(search, end.candidate.theta),
        *search.specification.absent_from_spread,
        *filter(None, [tolerance_remark(specification.plant)] * specification.model_tolerance),
    ]
    certificate = None
    if specification.certificate:
        try:
            certificate, reasons = _prove(specification, end, clock)
            warnings += reasons
        except OutOfTimeError:  # the settings are what they are without it
            warnings.append(
                "the proof is not on file as a certificate: the search was stopped or time was up"
            )
    end = replace(end, spread=proven_spread(search, end, clock.tick))
    scenarios: tuple[ScenarioOutcome, ...] = ()
    try:
        scenarios, said = scenario_outcomes(specification, search, end, certificate, clock.tick)
        warnings += said
    except OutOfTimeError:
        status = Status.TIME_LIMIT
        warnings.append(
            "no outcome of each scenario: the search was stopped or its time limit came first"
        )
    deciding = end.deciding
    result = Tuning(
        status=status,
        objective=specification.objective.value,
        tau_p=end.performance.tau_p,
        peaks=end.peaks,
        loops=end.loops,
        groups=search.groups,
        nominally_stable=True,
        search=_summary(specification, search, clock),
        curves=end.axes[0].curves,
        guarantee=_guarantee(end, scenarios),
        demands=demands,
        scenarios=scenarios,
        active=binding(scenarios),
        spread=end.spread,
        comparison=_comparison(solutions, search, end, clock, instead=alike is not None),
        certificate=certificate,
        optimality=_optimality(specification, solutions, end, clock),
        integrity=None if specification.brief else _integrity(specification, end),
        resolution=price,
        settings_tolerance=None if specification.brief else tolerance(specification, search, end),
        model_tolerance=_model_tolerance(specification, end),
        as_found=as_found(specification, end.performance),
        advice=advice(
            specification,
            end.performance,
            end.loops,
            end.axes[deciding].peaks.robust_performance.value,
        ),
        warnings=tuple(warnings),
    )
    if specification.brief:
        return result
    sentences = plain_advice(
        specification, result, search.cases[deciding],
        end.axes[deciding].peaks.robust_performance.omega,
    )  # fmt: skip
    return replace(result, advice=(*result.advice, *sentences))


def _rounded(
    specification: Specification,
    solutions: Solutions,
    search: GroupingSearch,
    end: Settled,
    clock: Clock,
    *,
    status: Status,
) -> tuple[tuple[Settled, PriceOfResolution] | None, Status]:
    """Return settings that controllers accept, if there are; where time is over those nearby."""
    try:
        return rounded(specification, solutions, search, end, clock), status
    except OutOfTimeError:
        clock.grant(TO_ROUND)
    found = None
    with suppress(OutOfTimeError):
        found = rounded(specification, solutions, search, end, clock, hurried=True)
    clock.end()
    return found, Status.TIME_LIMIT


def _none_rounded(
    specification: Specification, search: GroupingSearch, end: Settled, clock: Clock, status: Status
) -> Tuning:
    """Return that no numbers that the controllers accept were found."""
    if status is not Status.TIME_LIMIT:
        return infeasible(specification, search.groups, clock, too_coarse(end), None)
    reason = "the time limit came before numbers that the controllers accept were found"
    return infeasible(specification, search.groups, clock, reason, None, status=status)


def _none_kept(
    specification: Specification,
    search: GroupingSearch,
    chosen: Solution,
    clock: Clock,
    status: Status,
) -> Tuning:
    """Return that no settings keep the level on the whole axis."""
    if status is Status.TIME_LIMIT:
        return _cut_short(specification, search, clock)
    assert chosen.candidate is not None  # noqa: S101 - for the type checker
    slow, _ = search.slowest_demand(search.nearly_feasible(chosen.candidate.theta))
    reason = (
        "none were found that keep mu <= 1 on the whole axis: for the nearest ones even an "
        f"infinitely slow demand peaks at mu = {slow.value:.6g} near omega = {slow.omega:.4g} "
        "rad per time unit"
    )
    return infeasible(specification, search.groups, clock, reason, slow.omega)


def _unmet(
    specification: Specification, search: GroupingSearch, clock: Clock, name: str, status: Status
) -> Tuning:
    """Return that a demand is not met after all."""
    if status is Status.TIME_LIMIT:
        return _cut_short(specification, search, clock)
    reason = f"none were found that keep {name} on the whole frequency axis"
    return infeasible(specification, search.groups, clock, reason, None)


def _cut_short(specification: Specification, search: GroupingSearch, clock: Clock) -> Tuning:
    """Return that no settings are left in the end, which a whole search might have found."""
    reason = (
        "the search was stopped or its time limit came before settings were found that keep what "
        "is asked at all frequencies"
    )
    return infeasible(specification, search.groups, clock, reason, None, status=Status.TIME_LIMIT)


def _guarantee(end: Settled, scenarios: Sequence[ScenarioOutcome]) -> Guarantee:
    """Return what is proven of all plants, those of a spread included."""
    found = [axis.guarantee for axis in end.axes] + [each.guarantee for each in scenarios]
    if end.spread is not None:
        found.append(of_spread(end, overall(found)))
    return overall(found)


def infeasible(
    specification: Specification,
    groups: Groups,
    clock: Clock,
    reason: str,
    omega: float | None,
    *,
    status: Status = Status.INFEASIBLE,
) -> Tuning:
    """Return the result of a tuning that has no settings to show."""
    return Tuning(
        status=status,
        objective=specification.objective.value,
        tau_p=None,
        peaks=None,
        loops=(),
        groups=groups,
        nominally_stable=False,
        search=SearchSummary(clock.done, (), specification.seed, clock.elapsed),
        curves=None,
        as_found=as_found(specification, None),
        reason=reason,
        omega=omega,
    )


def _prove(
    specification: Specification, end: Settled, clock: Clock
) -> tuple[Certificate | None, list[str]]:
    level = PROVEN_ABOVE * end.peaks.robust_performance.value
    return prove(
        specification.plant, specification.uncertainty, end.performance, end.loops, level,
        interrupt=clock.tick, ends=end.axes[0].ends(level),
    )  # fmt: skip


def _ended(
    specification: Specification, chosen: Solution, clock: Clock
) -> tuple[Settled | None, bool]:
    """Return the settings that keep the level on the whole axis, and whether time cut it short."""
    assert chosen.candidate is not None  # noqa: S101 - for the type checker
    searched_on = None if specification.rough else clock
    try:
        return settled(specification, chosen.search, chosen.candidate, searched_on), False
    except OutOfTimeError:
        return settled(specification, chosen.search, chosen.candidate, None), True


def _better_alike(
    specification: Specification, solutions: Solutions, search: GroupingSearch, end: Settled | None
) -> tuple[GroupingSearch, Settled] | None:
    """Return the best identical settings where they are better than the unlike ones found.

    They may always be used where unlike ones may. The search for those has missed them where its
    grid told less than the whole axis.
    """
    one = solutions.identical()
    if one is None or one.candidate is None or one.search is search:
        return None
    if end is not None and one.candidate.value >= end.candidate.value - ALIKE:
        return None
    found = settled(specification, one.search, one.candidate, None)
    if found is None or (end is not None and found.candidate.value >= end.candidate.value):
        return None
    return one.search, found


def _integrity(specification: Specification, end: Settled) -> str | None:
    whole = (end.peaks, end.axes[0].guarantee)
    return in_one_line(
        specification.plant, specification.uncertainty, end.performance, end.loops, whole=whole
    )


def _model_tolerance(specification: Specification, end: Settled) -> tuple[ModelTolerance, ...]:
    if not specification.model_tolerance:
        return ()
    omega = end.axes[0].curves.omega
    return model_tolerances(specification.plant, end.performance, end.loops, omega)


def _sign_warnings(specification: Specification, search: GroupingSearch) -> list[str]:
    usual = gain_signs(specification.plant, search.groups)
    turned = [
        unit
        for group, mine, its in zip(search.groups, search.objective.signs, usual, strict=True)
        for unit in group
        if mine != its
    ]
    return [OTHER_SIGNS.format(loops=loops_text(turned))] if turned else []


def _comparison(
    solutions: Solutions, search: GroupingSearch, end: Settled, clock: Clock, *, instead: bool
) -> Comparison | None:
    one = solutions.identical()
    alone = len(search.groups) == 1 and not instead
    if one is None or one.candidate is None or alone:
        return None
    identical = clock.as_objective(one.candidate.value)
    loop = one.search.objective.controllers(one.candidate.theta)[0]
    gain = 100 * (1 - clock.as_objective(end.candidate.value) / identical)
    return Comparison(identical, loop, gain)


def _summary(specification: Specification, search: GroupingSearch, clock: Clock) -> SearchSummary:
    def loops(theta: NDArray[np.float64]) -> tuple[Controller, ...]:
        return search.blocks.expand(search.objective.controllers(search.canonical(theta)))

    return SearchSummary(
        starts=clock.done,
        local_optima=tuple(
            LocalOptimum(clock.as_objective(optimum.value), optimum.count, loops(optimum.theta))
            for optimum in search.optima
            if optimum.value < LARGEST_S  # else what it lacks, not what it reaches
        ),
        seed=specification.seed,
        elapsed_seconds=clock.elapsed,
    )


def _optimality(
    specification: Specification, solutions: Solutions, end: Settled, clock: Clock
) -> Optimality | None:
    if not specification.optimality_gap:
        return None
    from solver.optimality.bound import BranchAndBound  # noqa: PLC0415 - few tunings ask for it

    # The grouping that permits most; 'best' may have kept identical settings.
    searches = [each for each in solutions.searches if each.freedom.kind is specification.kind]
    search = max(searches, key=lambda each: len(each.groups))
    value = end.performance.tau_p
    if value is None or specification.objective is Objective.MU:
        value = end.peaks.robust_performance.value
    bound = BranchAndBound(search.problem, peaks=end.candidate.peaks[0], value=value)
    try:
        return bound.run(clock.tick)
    except OutOfTimeError:  # the search was not cut short: what is proven is enough
        return bound.result()
