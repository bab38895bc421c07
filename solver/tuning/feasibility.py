"""What forbids any settings, told before the search: conditions at steady state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.plants import MatrixPlant, ParallelPlant

if TYPE_CHECKING:
    from solver.model.plants import Plant
    from solver.tuning.specification import Specification

__all__ = ["Obstacle", "obstacle"]

SINGULAR = 1e-12  # relative size of a steady-state gain that is rounding only


@dataclass(frozen=True)
class Obstacle:
    """Why no settings exist, and the frequency (rad per time unit) that forbids them."""

    reason: str
    omega: float


def obstacle(specification: Specification) -> Obstacle | None:
    """Return what forbids every setting with integral action, or None.

    Integral action makes T(0) = I, so robust stability needs |w_I(0)| < 1; it needs a steady-state
    gain that is regular and, for a closed loop that is stable with all loops in service,
    det G(0) of the sign of the product of its diagonal (Niederlinski 1971). A parallel plant must
    satisfy the stricter -1/(n-1) < a(0) < 1 (Skogestad, Lundstrom and Hovd 1989, eq. 24), outside
    of which taking loops out of service destabilises it.
    """
    error = float(specification.uncertainty.magnitude(1e-9 * _slowest(specification))[0])
    if error >= 1:
        return Obstacle(
            f"the uncertainty is {100 * error:.4g} % at steady state, where integral action needs "
            "less than 100 %",
            0.0,
        )
    return _steady_state(specification.plant)


def _slowest(specification: Specification) -> float:
    poles = np.abs(specification.uncertainty.weight.poles)
    return float(poles.min()) if poles.size else 1.0


def _steady_state(plant: Plant) -> Obstacle | None:
    if isinstance(plant, ParallelPlant):
        return _parallel(plant)
    return _matrix(plant)


def _parallel(plant: ParallelPlant) -> Obstacle | None:
    if plant.n == 1:
        if plant.process.static_gain == 0:
            return Obstacle("the process has no steady-state gain", 0.0)
        return None
    omega = 1e-9 * _slowest_root(plant)
    a = float((plant.interaction.response(omega) / plant.process.response(omega))[0].real)
    low = -1 / (plant.n - 1)
    if low + SINGULAR < a < 1 - SINGULAR:
        if plant.process.static_gain == 0:
            return Obstacle("the process has no steady-state gain", 0.0)
        return None
    if abs(a - 1) <= SINGULAR or abs(a - low) <= SINGULAR:
        reason = (
            f"the steady-state interaction is a = {a:.6g}: the gain matrix is singular, so the "
            "outputs cannot be controlled independently"
        )
    else:
        reason = (
            f"the steady-state interaction a = {a:.6g} lies outside {low:.6g} < a < 1: the plant "
            "is not decentralised integral controllable"
        )
    return Obstacle(reason, 0.0)


def _matrix(plant: MatrixPlant) -> Obstacle | None:
    G = plant.response(1e-9 * _slowest_root(plant))[0]
    sizes = np.linalg.svd(G, compute_uv=False)
    if sizes[-1] <= SINGULAR * sizes[0]:
        return Obstacle("the steady-state gain matrix is singular", 0.0)
    diagonal = np.diag(G)
    if (np.abs(diagonal) <= SINGULAR * sizes[0]).any():
        loop = int(np.abs(diagonal).argmin())
        return Obstacle(f"loop {loop} has no steady-state gain of its own: pair it anew", 0.0)
    if float((np.linalg.det(G) / np.prod(diagonal)).real) < 0:
        return Obstacle(
            "the Niederlinski index is negative: with this pairing integral action in all loops "
            "is unstable",
            0.0,
        )
    return None


def _slowest_root(plant: Plant) -> float:
    roots = np.abs([root for f in plant.elements for root in (*f.poles, *f.zeros)])
    positive = roots[roots > 0]
    return float(positive.min()) if positive.size else 1.0
