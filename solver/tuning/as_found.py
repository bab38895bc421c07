"""Today's settings beside those that a tuning found."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError
from solver.model.neighbours import NeighbourPlant
from solver.robustness.axis import proven_peaks
from solver.robustness.margins import loop_margins
from solver.stability.closed_loop import is_stable
from solver.tuning.attained import Attained, attained, one_case, slowest_demand
from solver.tuning.beside import AsFound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.robustness.record import Peaks
    from solver.tuning.scenarios import Case
    from solver.tuning.specification import Specification

__all__ = ["as_found"]


def as_found(specification: Specification, performance: Performance | None) -> AsFound | None:
    """Return what today's settings do; None where the task names none.

    Parameters
    ----------
    specification : Specification
        The task.
    performance : Performance or None
        The demand with the tau_P of the result; None without a result.

    """
    loops = specification.as_found
    if loops is None:
        return None
    plant = specification.plant
    stable = is_stable(plant, loops)
    # Of more units than a matrix has, a ring or a row without one unit is none any more.
    many = isinstance(plant, NeighbourPlant)
    margins = () if many else loop_margins(plant, loops, stable=stable)
    if not stable:
        return AsFound(
            None, None, nominally_stable=False, margins=margins,
            reason="the loops are unstable together",
        )  # fmt: skip
    groups: dict[Controller, list[int]] = {}
    for unit, loop in enumerate(loops):
        groups.setdefault(loop, []).append(unit)
    cases = specification.cases(list(groups.values()))
    found = [_of_case(specification, case, loops, performance) for case in cases]
    # What decides first: no tau_P at all, the longest tau_P, the highest peak.
    worst = max(
        range(len(cases)),
        key=lambda index: (
            found[index].tau_p is None,
            found[index].tau_p or 0.0,
            _height(found[index].peaks),
        ),
    )
    return replace(
        found[worst],
        margins=margins,
        active=specification.name_of(cases[worst]) if len(cases) > 1 else None,
    )


def _height(peaks: Peaks | None) -> float:
    return math.inf if peaks is None else peaks.robust_performance.value


def _of_case(
    specification: Specification,
    case: Case,
    all_loops: Sequence[Controller],
    performance: Performance | None,
) -> AsFound:
    """Return what the loops do in one case, without their margins."""
    task, loops = one_case(specification, case), case.loops(all_loops)
    if not is_stable(case.plant, loops):
        return AsFound(
            None, None, nominally_stable=False, margins=(), reason="the loops are unstable together"
        )
    own = attained(task, loops)
    peaks = None if own is None else own.peaks
    met = own is not None and own.meets
    reason = None if met else _why(task, loops, own)
    if performance is not None:
        demand = replace(case.performance, tau_p=performance.tau_p)
        try:
            peaks = proven_peaks(case.plant, case.uncertainty, demand, loops).peaks
        except InvalidInputError as error:  # an offset where none is permitted
            peaks, reason = None, error.message
    return AsFound(
        tau_p=own.performance.tau_p if own is not None and met else None,
        peaks=peaks,
        nominally_stable=True,
        margins=(),
        reason=reason,
    )


def _why(specification: Specification, loops: Sequence[Controller], own: Attained | None) -> str:
    """Say why stable loops keep the demand at no tau_P, or not at the given one."""
    if own is not None:
        return f"mu reaches {own.peaks.robust_performance.value:.6g} at the given tau_p"
    slow = slowest_demand(specification, loops)
    if slow.value <= 1:
        return "they leave an offset that the demand does not permit"
    return (
        f"even an infinitely slow demand peaks at mu = {slow.value:.6g} near omega = "
        f"{slow.omega:.4g} rad per time unit"
    )
