"""A single loop with dead time and direct feedthrough, at and near infinity: any phase.

There the loop gain L need not settle: its phase takes every value. Of one loop the worst phase is
that at which 1 + L is shortest, so that over all of them

    |w_I T| + |w_P S| = (|w_I| |L| + |w_P|)/(1 - |L|),   |L| < 1,

and the same with one of the terms for robust stability and nominal performance. The magnitudes
are those of rational functions, which are enclosed up to infinity as polynomials in 1/omega^2.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.robustness.enclosed_forms import NOMINAL, STABILITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Uncertainty

__all__ = ["any_phase", "bound_beyond", "far_phases", "phases_beside"]

PHASES = 64  # of each dead time that feeds through
FAR = 1e8  # over the grid's end: what is not fed through has died away, phases still have digits
ROUNDING = 1e-13  # of some hundred operations on positive numbers, each right to 1e-16
SLACK = 1e-10  # above what is computed


def any_phase(plant: Plant) -> list[float]:
    """Return the dead times with which something is fed through directly; ascending."""
    found = {
        element.dead_time
        for element in plant.elements
        if element.dead_time > 0 and not element.is_zero and element.relative_degree == 0
    }
    return sorted(found)


def far_phases(plant: Plant, end: float) -> NDArray[np.float64]:
    """Frequencies beyond `end` that stand for infinity: one turn of each dead time fed through."""
    turns = [
        FAR * max(end, 1 / dead_time) + 2 * math.pi * np.arange(PHASES) / PHASES / dead_time
        for dead_time in any_phase(plant)
    ]
    return np.unique(np.concatenate(turns)) if turns else np.empty(0)


def phases_beside(plant: Plant, omega: float, share: float) -> NDArray[np.float64]:
    """Frequencies around `omega`, each dead time's phase up to a share of a step aside."""
    steps = share * np.linspace(-1, 1, PHASES + 1) * 2 * math.pi / PHASES
    return np.unique(np.concatenate([omega + steps / each for each in any_phase(plant)]))


def bound_beyond(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loop: Controller,
    *,
    curve: int,
    end: float,
) -> float:
    """Return a bound of a curve of one loop over all omega >= `end` (rad per time unit).

    Parameters
    ----------
    plant : Plant
        n = 1.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loop : Controller
        Its controller.
    curve : int
        ROBUST, STABILITY or NOMINAL.
    end : float
        Where the bound begins.

    Returns
    -------
    float
        Rounding included; infinite where the loop gain may reach one.

    """
    gain = _greatest([(plant.element(0, 0).num, plant.element(0, 0).den), *_factors(loop)], end)
    if not gain < 1:
        return math.inf
    uncertain = 0.0 if curve == NOMINAL else _greatest(_of(uncertainty.weight_of(0)), end) * gain
    demanded = 0.0 if curve == STABILITY else _greatest(_of(performance.weight), end)
    return (1 + SLACK) * (uncertain + demanded) / (1 - gain)


def _of(function: TransferFunction) -> list[tuple[Sequence[float], Sequence[float]]]:
    return [(function.num, function.den)]


def _factors(loop: Controller) -> list[tuple[Sequence[float], Sequence[float]]]:
    """Return the factors of the cascade form."""
    found: list[tuple[Sequence[float], Sequence[float]]] = [
        ((loop.gain * (loop.derivative_time or 0.0), loop.gain), (loop.lag_time, 1.0))
    ]
    if loop.integral_time is not None:
        found.append(((loop.integral_time, 1.0), (loop.integral_time, 0.0)))
    return found


def _greatest(factors: list[tuple[Sequence[float], Sequence[float]]], end: float) -> float:
    """Return a bound of the magnitude of a product over omega >= `end`; infinite if there is none.

    Magnitudes squared over omega^(2 degree) are polynomials in x = 1/omega^2, 0 <= x <= 1/end^2.
    """
    power, squared = 0, 1.0
    for num, den in factors:
        (above, p), (below, q) = _squared(num, end, upper=True), _squared(den, end, upper=False)
        if not 0 < below < math.inf or not above < math.inf:
            return math.inf
        power += p - q
        squared *= above / below
    # What is left over falls as omega^power.
    if power > 0 or not math.isfinite(squared):
        return math.inf
    return math.sqrt(squared) * end**power


def _squared(coefficients: Sequence[float], end: float, *, upper: bool) -> tuple[float, int]:
    """Bound |p(j omega)|^2/omega^(2 degree) from above or below; return the degree too."""
    p = np.trim_zeros(np.asarray(coefficients, dtype=float), "f")
    if not p.size:
        return 0.0, 0
    degree = p.size - 1
    scaled = p / end ** np.arange(p.size)  # in powers of end/s, so that x <= 1
    if not scaled[0] or not np.isfinite(scaled).all():
        return (math.inf if upper else 0.0), degree
    turned = scaled * 1j ** (degree - np.arange(p.size))
    # Odd powers cancel: what remains are those of x, highest power of omega first.
    terms = np.convolve(turned, turned.conj()).real[::2]
    error = ROUNDING * np.convolve(np.abs(scaled), np.abs(scaled))[::2]
    if upper:
        return float(terms[0] + error[0] + np.maximum(terms[1:] + error[1:], 0).sum()), degree
    return float(terms[0] - error[0] + np.minimum(terms[1:] - error[1:], 0).sum()), degree
