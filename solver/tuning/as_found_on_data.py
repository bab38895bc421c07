"""Today's settings on a measured plant, at the frequencies of its data."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.model.measured import MeasuredPlant
from solver.robustness.on_data import data_analysis, peaks_of
from solver.stability.on_data import Undecided, at_rest, unstable_poles_on_data
from solver.tuning.beside import AsFound
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.robustness.curves import LoopAnalysis
    from solver.robustness.record import Peaks
    from solver.tuning.scenarios import Case
    from solver.tuning.specification import Specification

__all__ = ["as_found_on_data"]

SLOWEST, FASTEST = 1e6, 1e-6  # tau_P beyond the first and the last frequency, over their periods
UNSTABLE = "the loops are unstable together"
HALVINGS = 60  # of log tau_P: to the last digits


def as_found_on_data(
    specification: Specification, performance: Performance | None, gain: NDArray[np.float64]
) -> AsFound | None:
    """Return what today's settings do at these frequencies; None where the task names none.

    With scenarios, or a spread, of the plant that decides.

    Parameters
    ----------
    specification : Specification
        Of `MeasuredPlant`s.
    performance : Performance or None
        The demand with the tau_P of the result; None without a result.
    gain : (n, n)
        The static gain of the task's own plant.

    """
    loops = specification.as_found
    if loops is None:
        return None
    groups: dict[Controller, list[int]] = {}
    for unit, loop in enumerate(loops):
        groups.setdefault(loop, []).append(unit)
    cases = specification.cases(list(groups.values()))
    found = [
        _of_case(specification, case, loops, performance, gain if index == 0 else None)
        for index, case in enumerate(cases)
    ]
    # What decides first: no tau_P at all, the longest tau_P, the highest peak.
    worst = max(
        range(len(cases)),
        key=lambda index: (
            found[index].tau_p is None,
            found[index].tau_p or 0.0,
            _height(found[index].peaks),
        ),
    )
    if len(cases) == 1:
        return found[0]
    return replace(found[worst], active=specification.name_of(cases[worst]))


def _height(peaks: Peaks | None) -> float:
    return math.inf if peaks is None else peaks.robust_performance.value


def _of_case(
    specification: Specification,
    case: Case,
    all_loops: Sequence[Controller],
    performance: Performance | None,
    gain: NDArray[np.float64] | None,
) -> AsFound:
    """Return what the loops do in one case; `gain`: its static gain, where it is known."""
    plant, loops = case.plant, case.loops(all_loops)
    assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker: who calls knows
    unstable = unstable_poles_on_data(plant, at_rest(plant) if gain is None else gain, loops)
    if unstable != 0:
        undecided = isinstance(unstable, Undecided)
        why = f"stability cannot be decided on these data: {unstable}" if undecided else UNSTABLE
        return AsFound(None, None, nominally_stable=False, margins=(), reason=why)

    def at(demand: Performance) -> LoopAnalysis:
        own = replace(case.performance, tau_p=demand.tau_p)
        return data_analysis(plant, case.uncertainty, own, loops)

    def height(log_tau: float) -> float:
        demand = specification.performance.with_tau_p(math.exp(log_tau))
        return float(at(demand).robust_performance(plant.omega).max())

    reason: str | None = None
    own: float | None = None
    if specification.objective is Objective.TAU_P:
        # |w_P| falls as tau_P grows, and mu with it.
        low = math.log(FASTEST / plant.omega[-1])
        high = math.log(SLOWEST / plant.omega[0])
        slow = height(high)
        if slow > 1:
            reason = f"even an infinitely slow demand peaks at mu = {slow:.6g}"
        else:
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if height(middle) <= 1 else (middle, high)
            own = math.exp(high)
    else:
        value = float(at(specification.performance).robust_performance(plant.omega).max())
        own = specification.performance.tau_p if value <= 1 else None
        reason = None if own is not None else f"mu reaches {value:.6g} at the given tau_p"
    demand = performance
    if demand is None and own is not None:
        demand = specification.performance.with_tau_p(own)
    return AsFound(
        own, None if demand is None else peaks_of(at(demand).curves(plant.omega)),
        nominally_stable=True, margins=(), reason=reason,
    )  # fmt: skip
