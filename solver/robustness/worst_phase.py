"""Loops with dead time and direct feedthrough, at and near infinity: any phase.

There the loop gain L = G C need not settle: its phases take every value. With bounds B of the
magnitudes of its elements, |S| <= (I - B)^-1 = X, element by element, where B has a spectral radius
below one (Neumann's series), and |S L| <= X B. Scales d_i = 1/|c_i| turn C S G into S L, so that

    |D N D^-1| <= [[|w_I| X B, a |w_I| X], [|w_P| X B/a, |w_P| X]]    for any a > 0,

whose norm bounds mu. Of one loop it is (|w_I| |L| + |w_P|)/(1 - |L|): the worst phase attains it.
The magnitudes are those of rational functions, enclosed up to infinity as polynomials in
1/omega^2.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from solver.model.weights import Structure
from solver.mu.recomputed import NOMINAL, STABILITY

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
MOST_UNITS = 12
RESIDUAL, LEAST_SURE = 1e-13, 1e-6  # of an inverse: rounding of its check, and what is too much
WIDEST = 30.0  # log of the scale between inputs and outputs: 13 decades to either side


def any_phase(plant: Plant) -> list[float]:
    """Return the dead times with which something is fed through directly; ascending."""
    found = {
        element.dead_time
        for element in plant.elements
        if element.dead_time > 0 and element.feedthrough
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
    loops: Sequence[Controller],
    *,
    curve: int,
    end: float,
) -> float:
    """Return a bound of a curve over all omega >= `end` (rad per time unit), whatever the phases.

    Parameters
    ----------
    plant : Plant
        n <= `MOST_UNITS`, else there is no bound.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit.
    curve : int
        ROBUST, STABILITY or NOMINAL.
    end : float
        Where the bound begins.

    Returns
    -------
    float
        Rounding included; infinite where the loop gain may reach one.

    """
    if plant.n > MOST_UNITS:
        return math.inf
    units = range(plant.n)
    B = np.array(
        [
            [_greatest([*_element(plant, i, j), *_factors(loops[j])], end) for j in units]
            for i in units
        ]
    )
    X = _neumann(B)
    if X is None:
        return math.inf
    w_I = np.array([_greatest(_of(uncertainty.weight_of(unit)), end) for unit in units])[:, None]
    w_P = _greatest(_of(performance.weight), end)
    e = np.array(performance.output_scale or (1.0,) * plant.n)
    through, freely = X @ B, X
    if uncertainty.structure is Structure.FULL:  # one scale for all inputs
        c = np.array([_greatest(_factors(loop), end) for loop in loops])[:, None]
        G = np.array([[_greatest(_element(plant, i, j), end) for j in units] for i in units])
        top = np.hstack([w_I * c * (X @ G), w_I * c * X * e])
        through = X @ G
    else:
        top = np.hstack([w_I * through, w_I * freely * e])
    bottom = w_P * np.hstack([through, freely * e]) / e[:, None]
    if not (np.isfinite(top).all() and np.isfinite(bottom).all()):
        return math.inf
    if curve == STABILITY:
        return (1 + SLACK) * _norm(top[:, : plant.n])
    if curve == NOMINAL:
        return (1 + SLACK) * _norm(bottom[:, plant.n :])
    scale = np.ones(2 * plant.n)

    def norm(log_a: float) -> float:
        scale[plant.n :] = math.exp(log_a)
        return _norm(np.vstack([top, bottom]) * scale / scale[:, None])

    least = minimize_scalar(norm, bounds=(-WIDEST, WIDEST), method="bounded")
    return (1 + SLACK) * norm(float(least.x))


def _neumann(B: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return a matrix above (I - B)^-1, element by element; None where the series may diverge."""
    if not np.isfinite(B).all():
        return None
    identity = np.eye(len(B))
    try:
        X = np.abs(np.linalg.inv(identity - B))
    except np.linalg.LinAlgError:
        return None
    # A positive vector that I - B leaves positive: the spectral radius of B is below one.
    y = X.sum(axis=1)
    if not (y > 0).all() or not (y - B @ y > 0.5).all():
        return None
    # (I - B)^-1 = X (I - R)^-1, R = I - (I - B) X: no element of R^k exceeds r^k.
    r = float(np.abs(identity - (identity - B) @ X).sum(axis=1).max()) + RESIDUAL
    if not r < LEAST_SURE:
        return None
    return np.asarray(X + r / (1 - r) * X.sum(axis=1, keepdims=True))


def _norm(matrix: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(matrix, ord=2))


def _element(plant: Plant, row: int, column: int) -> list[tuple[Sequence[float], Sequence[float]]]:
    element = plant.element(row, column)
    return [(element.num, element.den)]


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
