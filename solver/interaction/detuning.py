"""Integral gains that keep the interaction of decoupled loops below a bound.

The estimate |kappa_ij k_Ij| M_si of Astrom and Hagglund, eq. 11.10, looks at small s; where loops
have unlike bandwidths it is off by a factor of ten and more, to either side (Wood and Berry's
column: 5.88 and 1.27 for true peaks of 0.43 and 2.46). The true peaks of |h_ij| are at hand, so
they decide. A lower integral gain of loop j lowers what it does to the others, in proportion where
it is small: a fixed-point iteration on the logarithms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.interaction.pi_design import PIDesign

    Designs = Callable[[NDArray[np.float64]], list[PIDesign]]
    # Peaks of |h_ij| of the loops together; None where they are unstable.
    Peaks = Callable[[Sequence[PIDesign]], NDArray[np.float64] | None]

__all__ = ["detuned"]

_CLOSE = 0.98  # of the bound: near enough, settings have fewer digits
_ROUNDS = 30  # each needs a design of every loop; five to ten are usual
_ENDLESS = 1e9  # times the estimate: further off than that it is not
_LARGEST_STEP = 5.0  # factor on a gain in one round


def detuned(
    designs: Designs, peaks: Peaks, bound: float, start: NDArray[np.float64]
) -> list[PIDesign]:
    """Return designs whose peaks off the diagonal are at most `bound`, or the last ones tried.

    Parameters
    ----------
    designs : callable
        Designs of all loops for limits (n,) of their integral gains.
    peaks : callable
        Peaks (n, n) of what set point j does to output i, all loops closed.
    bound : float
        Greatest permitted peak off the diagonal.
    start : (n,)
        Limits to begin with; infinite where the loop's own optimum is finite.

    """
    limits = start
    kept = designs(limits)
    for _ in range(_ROUNDS):
        current = designs(limits)
        if any(design.gains is None for design in current):
            return current
        gains = np.array([abs(d.gains.integral_gain) for d in current if d.gains is not None])
        greatest = np.array([
            np.inf if d.greatest_integral_gain is None else abs(d.greatest_integral_gain)
            for d in current
        ])  # fmt: skip
        found = peaks(current)
        if found is None:
            limits = gains / _LARGEST_STEP
            continue
        kept = current
        others = found.copy()
        np.fill_diagonal(others, 0.0)
        worst = others.max(axis=0)  # what loop j does to any other
        with np.errstate(divide="ignore"):
            room = bound / worst
        at_optimum = gains >= greatest * (1 - 1e-9)
        if np.all(room >= 1) and np.all(at_optimum | (room * _CLOSE <= 1)):
            break
        rising = np.isinf(greatest) & (room * _CLOSE > 1)
        if rising.any() and np.all((gains > _ENDLESS * start)[rising]):
            # The peaks stay below the bound however high these gains.
            return designs(np.where(rising, np.inf, limits))
        # Towards the middle of what is near enough.
        factor = np.clip(0.99 * room, 1 / _LARGEST_STEP, _LARGEST_STEP)
        limits = np.minimum(gains * factor, greatest)
    return kept
