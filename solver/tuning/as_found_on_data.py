"""Today's settings on a measured plant, at the frequencies of its data."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from solver.model.measured import MeasuredPlant
from solver.robustness.on_data import data_analysis, peaks_of
from solver.stability.on_data import Undecided, unstable_poles_on_data
from solver.tuning.beside import AsFound
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.model.weights import Performance
    from solver.robustness.record import Peaks
    from solver.tuning.specification import Specification

__all__ = ["as_found_on_data"]

SLOWEST, FASTEST = 1e6, 1e-6  # tau_P beyond the first and the last frequency, over their periods
UNSTABLE = "the loops are unstable together"
HALVINGS = 60  # of log tau_P: to the last digits


def as_found_on_data(
    specification: Specification, performance: Performance | None, gain: NDArray[np.float64]
) -> AsFound | None:
    """Return what today's settings do at these frequencies; None where the task names none.

    Parameters
    ----------
    specification : Specification
        Of a `MeasuredPlant`.
    performance : Performance or None
        The demand with the tau_P of the result; None without a result.
    gain : (n, n)
        The static gain.

    """
    plant, loops = specification.plant, specification.as_found
    assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker: who calls knows
    if loops is None:
        return None
    unstable = unstable_poles_on_data(plant, gain, loops)
    if unstable != 0:
        undecided = isinstance(unstable, Undecided)
        why = f"stability cannot be decided on these data: {unstable}" if undecided else UNSTABLE
        return AsFound(None, None, nominally_stable=False, margins=(), reason=why)

    def peaks(demand: Performance) -> Peaks:
        analysis = data_analysis(plant, specification.uncertainty, demand, loops)
        return peaks_of(analysis.curves(plant.omega))

    def height(log_tau: float) -> float:
        return peaks(
            specification.performance.with_tau_p(math.exp(log_tau))
        ).robust_performance.value

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
        value = peaks(specification.performance).robust_performance.value
        own = specification.performance.tau_p if value <= 1 else None
        reason = None if own is not None else f"mu reaches {value:.6g} at the given tau_p"
    demand = performance
    if demand is None and own is not None:
        demand = specification.performance.with_tau_p(own)
    return AsFound(
        own, None if demand is None else peaks(demand), nominally_stable=True, margins=(),
        reason=reason,
    )  # fmt: skip
