"""A lower bound that no linear controller can pass, on any plant.

T = G Q with eigenvalues t_k. For Delta = diag(delta I, e U), U unitary, the eigenvalues of N Delta
are delta w_I t_k + e w_P (1 - t_k): T and S = I - T commute. Hence, at every frequency,

    mu(N_RP) >= rho(delta w_I T + e w_P S),      |delta| = |e| = 1.

The logarithm of the spectral radius of an analytic matrix is subharmonic (Vesentini 1968), so with
minimum-phase weights and a dead time theta common to all elements, T = exp(-theta s) T', the peak
of mu is no less than the value inside the right half plane, at any point z, for any t:

    sup mu >= min_t |w_I t| + |w_P (1 - exp(-theta z) t)| = min(|w_P(z)|, |w_I(z)| exp(theta Re z)).

A zero z_0 that all elements share leaves T as an all-pass factor, and divides the last term by
|z - z_0|/|z + z_0|. At any other transmission zero of G in the right half plane T is singular,
which leaves |w_P(z)|. On the imaginary axis this reads: not both |w_I| > 1 and |w_P| > 1. The
point z is the certificate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.zeros import transmission_zeros
from solver.limits.search import least_tau_p
from solver.model.frequencies import corners, grid, resonances_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Uncertainty

__all__ = ["Limitation", "LowerBound", "lower_bound", "unlimited"]

POINTS_PER_DECADE = 60  # any point is a certificate; more of them give a slightly better one
ROUNDING = 1e-6  # of an element beside its zero: what a double zero, known to 8 digits, leaves
REAL = 1e-6  # of a root: its imaginary part where two are one but for rounding
FAR = 700.0  # exponents beyond this overflow, and are far above any weight


class Limitation(StrEnum):
    """What a lower bound rests on."""

    UNCERTAINTY = "uncertainty"
    DEAD_TIME = "dead_time"
    ZERO = "right_half_plane_zero"
    NONE = "none"


@dataclass(frozen=True)
class LowerBound:
    """No controller has a smaller value.

    Attributes
    ----------
    value : float
        Of tau_P (time units) or of mu; 0 where nothing is known, infinite where no controller
        meets the demand however slow.
    point : complex or None
        z, 1 per time unit: the certificate.
    limitation : Limitation
        What acts there.

    """

    value: float
    point: complex | None
    limitation: Limitation


@dataclass(frozen=True)
class _Points:
    """Points z, and beyond what |w_P(z)| a mu above it is certain."""

    z: NDArray[np.complex128]
    ceiling: NDArray[np.float64]
    limitation: tuple[Limitation, ...]


def lower_bound(plant: Plant, uncertainty: Uncertainty, performance: Performance) -> LowerBound:
    """Return the lower bound of mu, or of tau_P where `performance` has none.

    Parameters
    ----------
    plant : Plant
        Stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights.

    """
    points = _points(plant, uncertainty)

    def values(tau_p: float) -> NDArray[np.float64]:
        w_P = performance.with_tau_p(tau_p).weight
        return np.minimum(_outer(w_P, points.z), points.ceiling)

    tau_p = performance.tau_p
    if tau_p is not None:
        here = values(tau_p)
        best = int(here.argmax())
        return LowerBound(float(here[best]), complex(points.z[best]), points.limitation[best])
    if abs(complex(uncertainty.weight_of(0)(0.0))) > 1:  # |w_P(0)| = 1/A > 1 whatever tau_P is
        return LowerBound(math.inf, 0j, Limitation.UNCERTAINTY)
    start = 1 / float(corners(plant, uncertainty).max())
    least = least_tau_p(lambda tau_p, among: values(tau_p)[among], points.z.size, start)
    here = values(least * (1 - 1e-6))
    best = int(here.argmax())
    if not here[best] > 1:
        return LowerBound(0.0, None, Limitation.NONE)
    return LowerBound(least * (1 - 1e-6), complex(points.z[best]), points.limitation[best])


def unlimited(plant: Plant, uncertainty: Uncertainty) -> bool:
    """Whether nothing in the model ends the bandwidth: any tau_P is reached by more gain."""
    if any(element.dead_time > 0 for element in plant.elements):
        return False
    omega = _grid(plant, uncertainty)
    if uncertainty.magnitude(omega).max() >= 1:
        return False
    zeros = transmission_zeros(plant).zeros
    return not any(zero.right_half_plane for zero in zeros)


def _points(plant: Plant, uncertainty: Uncertainty) -> _Points:
    axis = _grid(plant, uncertainty)
    z = np.concatenate([1j * axis, axis.astype(complex)])
    common = min(element.dead_time for element in plant.elements if not element.is_zero)
    w_I = _outer(uncertainty.weight_of(0), z)
    by_dead_time = np.exp(np.minimum(common * z.real, FAR))
    zeros = {zero.value for zero in transmission_zeros(plant).zeros if zero.right_half_plane}
    # A zero on the axis is such a frequency; at s = 0 the plant would be singular.
    points = np.array([zero for zero in zeros if zero != 0], dtype=complex)
    inside = points[points.real > 0]
    by_zeros = np.ones(z.shape)
    for zero in inside[_shared(plant, inside)]:
        with np.errstate(divide="ignore"):  # at the zero itself T = 0
            by_zeros = by_zeros * np.abs(z + zero.conjugate()) / np.abs(z - zero)
    ceiling = w_I * by_dead_time * by_zeros
    limitation = [
        Limitation.UNCERTAINTY
        if max(dead, zero) < 2  # neither does as much as the uncertainty
        else Limitation.DEAD_TIME
        if dead >= zero
        else Limitation.ZERO
        for dead, zero in zip(by_dead_time, by_zeros, strict=True)
    ]
    return _Points(
        np.concatenate([z, points]),
        np.concatenate([ceiling, np.full(points.size, np.inf)]),
        (*limitation, *[Limitation.ZERO] * points.size),
    )


def _shared(plant: Plant, zeros: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Whether every element vanishes at each of the points `zeros` (r,)."""
    shared = np.ones(zeros.shape, dtype=bool)
    for element in set(plant.elements):
        if not element.is_zero and zeros.size:
            beside = np.abs(element(zeros * 1.1))
            shared &= np.abs(element(zeros)) < ROUNDING * beside
    return shared


def _grid(plant: Plant, uncertainty: Uncertainty) -> NDArray[np.float64]:
    bends = corners(plant, uncertainty)
    axis = grid(
        1e-3 * float(bends.min()),
        1e3 * float(bends.max()),
        POINTS_PER_DECADE,
        [bends, resonances_of(uncertainty.weights)],
    )
    return np.union1d(axis, np.concatenate([_about_one(each) for each in uncertainty.weights]))


def _about_one(weight: TransferFunction) -> NDArray[np.float64]:
    """Frequencies where |w_I| passes 1, and one on either side and between any two of them."""
    squares = [np.polymul(part, _reversed(part)) for part in (weight.num, weight.den)]
    # num(s) num(-s) - den(s) den(-s), even in s: a polynomial in s^2 = -omega^2.
    roots = np.roots(np.polysub(*squares)[::2])
    passed = np.sqrt([-root.real for root in roots if abs(root.imag) < REAL * -root.real])
    if not passed.size:
        return passed
    passed.sort()
    return np.concatenate(
        [passed, passed[:1] / 2, np.sqrt(passed[1:] * passed[:-1]), passed[-1:] * 2]
    )


def _reversed(polynomial: tuple[float, ...]) -> NDArray[np.float64]:
    """Return p(-s) of p(s)."""
    signs = np.power(-1.0, np.arange(len(polynomial) - 1, -1, -1))
    return np.asarray(signs * polynomial)


def _outer(weight: TransferFunction, z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Magnitude at `z` of the minimum-phase function with the weight's magnitude on the axis."""
    zeros = weight.zeros
    value = np.full(z.shape, abs(weight.num[0] / weight.den[0]))
    for root in zeros:
        value = value * np.abs(z + abs(root.real) - 1j * root.imag)
    for root in weight.poles:
        value = value / np.abs(z - root)
    return value
