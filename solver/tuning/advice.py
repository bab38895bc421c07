"""How the result of a tuning may be read and used, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.tuning.specification import Specification

__all__ = ["NEAR_ONE", "advice", "weights_factor"]

NEAR_ONE = 1e-3  # of mu: the factor is 1 to the digits that matter


def advice(
    specification: Specification,
    performance: Performance,
    loops: Sequence[Controller],
    peak: float,
) -> tuple[str, ...]:
    """Return what is worth knowing of settings that were found.

    Parameters
    ----------
    specification : Specification
        What was asked for.
    performance : Performance
        The demand with the tau_P of the result.
    loops : sequence of Controller
        The settings, one a unit.
    peak : float
        Of mu of robust performance.

    """
    found = []
    if specification.interchangeable and len(set(loops)) > 1:
        # Permuting units permutes the rows and columns of N, mu stays: SLH, section 2.
        unit = "either unit" if len(loops) == 2 else "any unit"
        found.append(
            f"The units are identical, so the settings may be interchanged: {unit} may take any of "
            "them."
        )
    if performance.tau_p is not None:
        bandwidth = 1 / performance.max_peak / performance.tau_p  # SLH eq. 29
        found.append(
            f"As a bandwidth this tau_P asks for omega_B = 1/(M tau_P) = {bandwidth:.4g} rad per "
            f"time unit in every direction, M = {performance.max_peak:g}."
        )
    if abs(peak - 1) > NEAR_ONE:
        found.append(weights_factor(peak))
    return tuple(found)


def weights_factor(peak: float) -> str:
    """Say by which factor both weights together may grow, or must shrink.

    Both weights times c are N times c, so mu times c (SLH, section 5).

    Parameters
    ----------
    peak : float
        Of mu of robust performance, > 0.

    """
    factor = 1 / peak
    if peak <= 1:
        return (
            f"Both weights, of uncertainty and of performance, may grow to {factor:.4g} times "
            "(1/mu) before mu reaches 1."
        )
    return (
        f"Both weights, of uncertainty and of performance, must shrink to {factor:.4g} times "
        "(1/mu) for mu to be 1."
    )
