"""Today's settings beside those that a tuning found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError
from solver.robustness.axis import proven_peaks
from solver.robustness.margins import loop_margins
from solver.stability.closed_loop import is_stable
from solver.tuning.attained import Attained, attained, slowest_demand
from solver.tuning.beside import AsFound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
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
    margins = loop_margins(plant, loops, stable=stable)
    if not stable:
        return AsFound(
            None, None, nominally_stable=False, margins=margins,
            reason="the loops are unstable together",
        )  # fmt: skip
    own = attained(specification, loops)
    peaks = None if own is None else own.peaks
    met = own is not None and own.meets
    reason = None if met else _why(specification, loops, own)
    if performance is not None:
        try:
            peaks = proven_peaks(plant, specification.uncertainty, performance, loops).peaks
        except InvalidInputError as error:  # an offset where none is permitted
            peaks, reason = None, error.message
    return AsFound(
        tau_p=own.performance.tau_p if own is not None and met else None,
        peaks=peaks,
        nominally_stable=True,
        margins=margins,
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
        f"{slow.omega:.4g}"
    )
