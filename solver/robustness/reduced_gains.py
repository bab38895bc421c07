"""Whether loops stay stable for all factors on their gains, not only for those that were tried.

det(I + P C K) with K = diag(kappa) is affine in each factor kappa_i alone, so its values over a box
of factors lie in the convex hull of those at the corners (the mapping theorem of Zadeh and Desoer,
Linear System Theory (1963), section 9.17). Where that hull leaves out zero at every frequency, no
closed-loop pole can cross the imaginary axis anywhere in the box, and the loops are as stable as at
any one point of it. Boxes whose hull holds zero are halved.

The factors end at a least one above zero. Towards zero the integrators' poles go to s = 0, with or
without a loop that crosses the axis: what happens there is a matter of the static gain, and
decentralised integral controllability answers it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.robustness.margins import loop_frequencies
from solver.stability.closed_loop import is_stable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["LEAST", "MAX_LOOPS", "ReducedGains", "reduced_gains"]

LEAST = 1e-4  # a loop ten thousand times slower is as good as in manual
MAX_LOOPS = 5  # 32 corners a box
_MAX_BOXES = 4000
_MARGIN = 0.05  # rad by which the corners must leave a half plane free: room between frequencies


@dataclass(frozen=True)
class ReducedGains:
    """Stability with gains times any factors in `least`..1.

    Attributes
    ----------
    proven : bool
        Whether no combination of factors is unstable, at each of the frequencies looked at.
    least : float
        Lower end of the factors.
    frequencies : int
        How many frequencies were looked at: those of the margins, which resolve the loops; between
        them the corners of the boxes leave a margin of angle, not a proof.
    boxes : int
        Boxes of factors that it took.

    """

    proven: bool
    least: float
    frequencies: int
    boxes: int


def reduced_gains(
    plant: Plant, loops: Sequence[Controller], least: float = LEAST
) -> ReducedGains | None:
    """Prove that the loops are stable for all factors on their gains, or fail to.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : sequence of Controller
        One a unit, with integral action.
    least : float
        Least factor.

    Returns
    -------
    ReducedGains or None
        None for more than `MAX_LOOPS` loops, and where a loop has no integral action.

    """
    if len(loops) > MAX_LOOPS or any(loop.integral_time is None for loop in loops):
        return None
    omega = loop_frequencies(plant, loops)
    if not is_stable(plant, loops):
        return ReducedGains(proven=False, least=least, frequencies=omega.size, boxes=0)
    minors = _minors(plant, loops, omega)
    n = len(loops)
    subsets = np.array(list(itertools.product((0, 1), repeat=n)), dtype=bool)
    # Each box with the frequencies at which its hull is not yet known to leave out zero.
    boxes = [(np.full(n, least), np.ones(n), np.arange(omega.size))]
    count = 0
    while boxes:
        low, high, open_ = boxes.pop()
        count += 1
        corners = np.where(subsets, high, low)
        powers = np.array([np.prod(np.where(subsets, k, 1.0), axis=1) for k in corners])
        left = open_[_holds_zero(minors[open_] @ powers.T)]
        if not left.size:
            continue
        if count + len(boxes) >= _MAX_BOXES:
            return ReducedGains(proven=False, least=least, frequencies=omega.size, boxes=count)
        side = int(np.argmax(high / low))
        middle = float(np.sqrt(low[side] * high[side]))
        for end, other in ((high, low), (low, high)):
            cut = end.copy()
            cut[side] = middle
            boxes.append((other, cut, left) if end is high else (cut, other, left))
    return ReducedGains(proven=True, least=least, frequencies=omega.size, boxes=count)


def _minors(
    plant: Plant, loops: Sequence[Controller], omega: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Principal minors of P C, (k, 2^n), those of the subsets in the order of binary numbers.

    det(I + P C K) is the sum of the minors times the products of their factors.
    """
    n = len(loops)
    L = plant.response(omega) * np.stack([loop.response(omega) for loop in loops], axis=1)[:, None]
    columns = []
    for chosen in itertools.product((0, 1), repeat=n):
        units = [unit for unit, inside in enumerate(chosen) if inside]
        columns.append(np.linalg.det(L[:, units][:, :, units]) if units else np.ones(omega.size))
    return np.stack(columns, axis=1)


def _holds_zero(values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Tell for which rows the convex hull may hold zero: no open half plane holds all values."""
    angles = np.sort(np.angle(values), axis=1)
    gaps = np.diff(angles, axis=1, append=angles[:, :1] + 2 * np.pi)
    return np.asarray(gaps.max(axis=1) <= np.pi + _MARGIN)
