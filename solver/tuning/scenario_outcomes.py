"""What settings make of each scenario: its peaks, what is proven of them, its own tau_P."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.certificate.search import PROVEN_ABOVE, prove
from solver.model.loop_names import loops_text
from solver.robustness.record import Guarantee, GuaranteeStatus
from solver.tuning.record import ScenarioOutcome
from solver.tuning.scenarios import AS_GIVEN
from solver.tuning.specification import Objective
from solver.tuning.spread import SPREAD
from solver.tuning.together import Together

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.certificate.record import Certificate
    from solver.tuning.search import GroupingSearch
    from solver.tuning.settle import Settled
    from solver.tuning.specification import Specification

__all__ = ["binding", "of_spread", "overall", "scenario_outcomes"]

TOGETHER = 1e-6  # of tau_P or mu: scenarios that differ by rounding alone


def scenario_outcomes(
    specification: Specification,
    search: GroupingSearch,
    end: Settled,
    certificate: Certificate | None,
    interrupt: Callable[[], object],
) -> tuple[tuple[ScenarioOutcome, ...], list[str]]:
    """Return the outcome of each scenario, the task's own plant first, and warnings.

    None where there are no scenarios. Each case is computed once, whichever scenarios it is in;
    `certificate` is that of the task's own plant.
    """
    if not specification.scenarios and specification.spread is None:
        return (), []
    values, certificates, warnings = [], [], []
    for index, (case, axis) in enumerate(zip(search.cases, end.axes, strict=True)):
        values.append(_own_tau_p(specification, search, end, index))
        proof = certificate if index == 0 else None
        if specification.certificate and index:
            performance = replace(case.performance, tau_p=end.performance.tau_p)
            level = PROVEN_ABOVE * axis.peaks.robust_performance.value
            proof, reasons = prove(
                case.plant, case.uncertainty, performance, case.loops(end.loops), level,
                interrupt=interrupt,
            )  # fmt: skip
            warnings += [f"{loops_text(case.units)} in service: {reason}" for reason in reasons]
        certificates.append(proof)
    names = [AS_GIVEN, *(scenario.name for scenario in specification.scenarios)]
    if specification.spread is not None:
        names.append(SPREAD)
    found = []
    for number, name in enumerate(names):
        mine = [index for index, case in enumerate(search.cases) if number in case.scenarios]
        if not mine:  # nothing spreads, or the corners are plants that are there already
            continue
        guarantee = overall([end.axes[index].guarantee for index in mine])
        if number > len(specification.scenarios):
            guarantee = of_spread(end, guarantee)
        worst = max(mine, key=lambda index: end.axes[index].peaks.robust_performance.value)
        taus = [values[index] for index in mine]
        found.append(
            ScenarioOutcome(
                name,
                search.cases[worst].units,
                len(mine),
                None if None in taus else max(tau for tau in taus if tau is not None),
                end.axes[worst].peaks,
                end.axes[worst].curves,
                guarantee,
                tuple(each for each in (certificates[index] for index in mine) if each),
            )
        )
    return tuple(found), list(dict.fromkeys(warnings))


def of_spread(end: Settled, of_cases: Guarantee) -> Guarantee:
    """Return what is proven of all plants of the spread; `of_cases`: of those that are cases."""
    plants = 0 if end.spread is None else end.spread.plants
    proof = None if end.spread is None else end.spread.proof
    if proof is not None and proof.proven:
        if of_cases.status is GuaranteeStatus.OPEN:
            return of_cases
        return Guarantee(GuaranteeStatus.PROVEN, max(proof.level, of_cases.level))
    reason = (
        f"the spread was searched at {plants} plants beside its corners; between them not all is "
        "proven"
    )
    if proof is not None:
        reason += f": {proof.reason}"
    return Guarantee(GuaranteeStatus.OPEN, of_cases.level, reason)


def overall(guarantees: Sequence[Guarantee]) -> Guarantee:
    """Return what is proven of all: proven if each is, at the highest level."""
    level = max(each.level for each in guarantees)
    reasons = [each.reason for each in guarantees if each.status is GuaranteeStatus.OPEN]
    if reasons:
        return Guarantee(GuaranteeStatus.OPEN, level, reasons[0])
    return Guarantee(GuaranteeStatus.PROVEN, level)


def binding(outcomes: Sequence[ScenarioOutcome]) -> str | None:
    """Return the name of the scenario that decides the result; None without scenarios.

    Of those that do so together, as where they share the weakest direction, the first one.
    """
    values = [
        each.peaks.robust_performance.value if each.tau_p is None else each.tau_p
        for each in outcomes
    ]
    top = max(values, default=0.0) * (1 - TOGETHER)
    return next((e.name for e, value in zip(outcomes, values, strict=True) if value >= top), None)


def _own_tau_p(
    specification: Specification, search: GroupingSearch, end: Settled, index: int
) -> float | None:
    """Return the tau_P that one case alone would permit these settings."""
    if specification.objective is not Objective.TAU_P:
        return None
    number = search.activate(index)
    part = search.objective.parts[number]
    exact = replace(search.exact, objective=Together((part,)))
    s = exact.measure(end.candidate.theta, end.candidate.value).value
    return math.exp(s) if math.isfinite(s) else None
