"""What closing one loop does to another: Example 11.1 of Astrom and Hagglund, in general.

With loop j under proportional control u_j = -k y_j and all other loops open, input i acts on
output i by

    g_cl(s) = p_ii - p_ij k p_ji / (1 + k p_jj).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq, fmpq_poly

from solver.interaction.loop_effect_query import LoopEffectQuery
from solver.interaction.rational_matrix import (
    Rational,
    decimal,
    least_common_multiple,
    roots_of,
    to_float,
)
from solver.model.controllers import DERIVATIVE_FILTER, Controller
from solver.model.equality import ByValue
from solver.model.validation import instance, square_matrix

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = [
    "GainInterval",
    "LoopEffect",
    "StaticEffect",
    "loop_effect",
    "rational_controller",
    "static_effects",
]


@dataclass(frozen=True)
class StaticEffect:
    """How the static gain of loop `loop` changes as the gain of loop `other` grows.

    Attributes
    ----------
    loop, other : int
        The two loops, from 0.
    open_gain : float
        Gain with the other loop open.
    closed_gain : float
        Limit for a very high gain of the other loop (or integral action there): the open gain
        over the relative gain of the two. Infinite where that is zero.
    reversal_gain : float or None
        Gain of the other loop, with the sign of its process, at which the gain of this loop
        passes through zero: beyond it the loop's controller acts the wrong way. None: never.

    """

    loop: int
    other: int
    open_gain: float
    closed_gain: float
    reversal_gain: float | None


@dataclass(frozen=True)
class GainInterval:
    """Open interval of gains; an end may be infinite."""

    low: float
    high: float


@dataclass(frozen=True, eq=False)
class LoopEffect(ByValue):
    """Effect of a proportional gain k in loop `other` on loop `loop`, per gain in `gains`.

    Attributes
    ----------
    gains : (m,)
        The gains k.
    static_gains : (m,)
        g_cl(0); infinite for an integrating process, NaN where 1 + k p_jj(0) = 0.
    poles : tuple of (p,) complex
        Closed-loop poles for each gain, loop i under its controller (or open).
    stable : tuple of bool
        Whether all of them lie in the left half plane.
    stable_gains : tuple of GainInterval
        All gains k of the sign of p_jj(0) for which the two loops together are stable.

    """

    loop: int
    other: int
    gains: NDArray[np.float64]
    static_gains: NDArray[np.float64]
    poles: tuple[NDArray[np.complex128], ...]
    stable: tuple[bool, ...]
    stable_gains: tuple[GainInterval, ...]


def static_effects(gain: NDArray[np.float64]) -> tuple[StaticEffect, ...]:
    """Return the static effect of every loop on every other one.

    Parameters
    ----------
    gain : (n, n)
        P(0), finite.

    """
    gain = square_matrix(gain)
    effects = []
    for loop, other in itertools.permutations(range(len(gain)), 2):
        own, far = float(gain[loop, loop]), float(gain[other, other])
        determinant = own * far - float(gain[loop, other] * gain[other, loop])
        closed = determinant / far if far else math.inf
        reversal = None
        if determinant and far and own:
            zero = -own / determinant  # p_ii + k (p_ii p_jj - p_ij p_ji) = 0
            # A gain of the wrong sign would make the other loop itself unstable.
            reversal = zero if zero * far > 0 else None
        effects.append(StaticEffect(loop, other, own, closed, reversal))
    return tuple(effects)


def loop_effect(query: LoopEffectQuery) -> LoopEffect:
    """Return the effect of loop `other`, under proportional control, on loop `loop`.

    The characteristic polynomial is A(s) + k B(s); the gains at which roots cross the imaginary
    axis follow from the real roots of Im A(jw) conj B(jw) in w, in rational arithmetic up to
    the roots.

    Parameters
    ----------
    query : LoopEffectQuery
        The plant, the two loops and the gains.

    Raises
    ------
    InvalidInputError
        No such query, which checks itself.

    """
    instance(query, LoopEffectQuery, "")
    loop, other, gains = query.loop, query.other, query.gains
    elements = query.elements
    p = {key: Rational.from_transfer_function(element) for key, element in elements.items()}
    own, far = p[loop, loop], p[other, other]
    determinant = own * far + (p[loop, other] * p[other, loop]).scaled(-1)
    c = rational_controller(query.controller)
    one = Rational(fmpq_poly([1]), fmpq_poly([1]))
    # (1 + k p_jj)(1 + c g_cl) = 1 + c p_ii + k (p_jj + c (p_ii p_jj - p_ij p_ji)), times the
    # pole polynomials of plant and controller so that no hidden mode is lost.
    poles = least_common_multiple(e.den for e in (*p.values(), determinant)) * c.den
    A = _cleared(one + c * own, poles)
    B = _cleared(far + c * determinant, poles)
    closed = [_closed_poles(A, B, decimal(k)) for k in gains]
    sign = -1 if elements[other, other].static_gain < 0 else 1
    return LoopEffect(
        loop=loop,
        other=other,
        gains=np.array(gains, dtype=float),
        static_gains=np.array([_static_gain(own, far, determinant, k) for k in gains]),
        poles=tuple(closed),
        stable=tuple(bool(np.all(values.real < 0)) for values in closed),
        stable_gains=_stable_gains(A, B, sign),
    )


def rational_controller(controller: Controller | None) -> Rational:
    """Return the controller as a rational function, zero where there is none."""
    if controller is None:
        return Rational(fmpq_poly(), fmpq_poly([1]))
    num, den = fmpq_poly([decimal(controller.gain)]), fmpq_poly([1])
    if controller.integral_time is not None:
        tau_i = decimal(controller.integral_time)
        num, den = num * fmpq_poly([1, tau_i]), fmpq_poly([0, tau_i])
    tau_f = decimal(controller.filter_time or 0.0)
    if controller.derivative_time is not None:
        tau_d = decimal(controller.derivative_time)
        num = num * fmpq_poly([1, tau_d])
        if controller.filter_time is None:
            tau_f = decimal(DERIVATIVE_FILTER) * tau_d
    return Rational.reduced(num, den * fmpq_poly([1, tau_f]))


def _cleared(function: Rational, poles: fmpq_poly) -> fmpq_poly:
    return function.num * (poles // function.den)


def _closed_poles(A: fmpq_poly, B: fmpq_poly, gain: fmpq) -> NDArray[np.complex128]:
    roots = roots_of(A + B * gain)
    return np.array([root.value for root in roots for _ in range(root.multiplicity)], dtype=complex)


def _static_gain(own: Rational, far: Rational, determinant: Rational, k: float) -> float:
    """Return g_cl(0) = (p_ii + k det)/(1 + k p_jj) at s = 0."""
    one = Rational(fmpq_poly([1]), fmpq_poly([1]))
    gain = Rational(fmpq_poly([decimal(k)]), fmpq_poly([1]))
    top, bottom = own + gain * determinant, one + gain * far
    if bottom.is_zero:
        return math.nan
    quotient = Rational.reduced(top.num * bottom.den, top.den * bottom.num)
    value, pole = quotient.num[0], quotient.den[0]
    return math.copysign(math.inf, value) if pole == 0 else to_float(value / pole)


def _stable_gains(A: fmpq_poly, B: fmpq_poly, sign: int) -> tuple[GainInterval, ...]:
    """Intervals of gains of the given sign, from 0 outwards, with all roots of A + k B stable."""
    limits = sorted({abs(k) for k in _crossings(A, B) if k * sign > 0})
    edges = [0.0, *limits, math.inf]
    intervals: list[GainInterval] = []
    for low, high in itertools.pairwise(edges):
        inside = (low + high) / 2 if math.isfinite(high) else 2 * low + 1
        if np.any(_closed_poles(A, B, decimal(sign * inside)).real >= 0):
            continue
        if intervals and intervals[-1].high == low:  # a crossing that only touched the axis
            low = intervals.pop().low  # noqa: PLW2901 - the two intervals are one
        intervals.append(GainInterval(low, high))
    if sign > 0:
        return tuple(intervals)
    return tuple(GainInterval(-interval.high, -interval.low) for interval in reversed(intervals))


def _crossings(A: fmpq_poly, B: fmpq_poly) -> list[float]:
    """Gains k at which a root of A + k B is on the imaginary axis or at infinity.

    With A(jw) = a0(x) + jw a1(x), x = w^2, and B likewise: k is real where a1 b0 = a0 b1, and
    then k = -(a0 b0 + x a1 b1)/(b0^2 + x b1^2).
    """
    a0, a1 = _even_odd(A)
    b0, b1 = _even_odd(B)
    condition = a1 * b0 - a0 * b1
    squares = [0.0] + [root.value.real for root in roots_of(condition) if root.value.imag == 0]
    found = []
    for x in (decimal(value) for value in squares if 0 <= value < math.inf):
        bottom = b0(x) ** 2 + x * b1(x) ** 2
        if bottom > 0:
            found.append(to_float(-(a0(x) * b0(x) + x * a1(x) * b1(x)) / bottom))
    if A.degree() == B.degree():
        ratio = A[A.degree()] / B[B.degree()]
        found.append(-to_float(ratio))
    return found


def _even_odd(polynomial: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
    """Return a0, a1 with polynomial(jw) = a0(w^2) + jw a1(w^2)."""
    coefficients = polynomial.coeffs()
    signed = [value * fmpq((-1) ** (power // 2)) for power, value in enumerate(coefficients)]
    return fmpq_poly(signed[0::2]), fmpq_poly(signed[1::2])
