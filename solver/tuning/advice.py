"""How the result of a tuning may be read and used, in sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.relative_gain import relative_gain_at
from solver.model.measured import MeasuredPlant
from solver.model.plants import MAX_MATRIX_SIZE, ParallelPlant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance
    from solver.tuning.specification import Specification

__all__ = ["NEAR_ONE", "advice", "weights_factor"]

LARGE = 10.0  # relative gain from which a plant is called ill-conditioned, as in `interaction`
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
        Of mu of robust performance, the highest of all plants that the settings must serve.

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
        found += _difficulty(specification.plant, bandwidth)
    if abs(peak - 1) > NEAR_ONE:
        found.append(weights_factor(peak))
    return tuple(found)


def _difficulty(plant: Plant, bandwidth: float) -> list[str]:
    """Judge the relative gain where it matters, at the bandwidth (SLH, section 4.2)."""
    at = bandwidth * np.array([1e-4, 1.0])
    # One loop has no relative gain, and a measured plant no response at these frequencies.
    if plant.n == 1 or isinstance(plant, MeasuredPlant):
        return []
    if isinstance(plant, ParallelPlant):
        a = plant.interaction.response(at) / plant.process.response(at)
        with np.errstate(divide="ignore", invalid="ignore"):
            own = (1 + (plant.n - 2) * a) / ((1 + (plant.n - 1) * a) * (1 - a))  # eq. 13
        gains = np.abs(own)
    elif plant.n > MAX_MATRIX_SIZE:
        return []
    else:
        array = relative_gain_at(plant.response(at))
        gains = np.abs(np.diagonal(array, axis1=1, axis2=2)).max(axis=1)
    slow, there = gains.tolist()
    if not (math.isfinite(slow) and math.isfinite(there)) or max(slow, there) < LARGE:
        return []
    if there >= LARGE:
        text = (
            "large: the plant is difficult for every controller, and a decoupler would be fragile"
        )
    else:
        text = "moderate: what is difficult at rest is not so where the loops work"
    return [f"At that bandwidth the relative gain is {there:.3g} (at rest {slow:.3g}), {text}."]


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
