"""Enclosures of transfer functions over frequency intervals, as Taylor models.

The variable is s on a finite interval and 1/s on one that reaches infinity. Functions are
multiplied by as many factors sigma as cancel their poles at s = 0, where sigma = s on a finite
interval and sigma = 1 elsewhere: both ends of the frequency axis are regular. On an interval
that reaches infinity a dead time has no limit; there exp(-theta s) stands for every number of
modulus at most 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from flint import acb, acb_poly, arb, fmpq, fmpq_poly

from solver.certificate.taylor_models import TaylorModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.transfer_function import TransferFunction

__all__ = ["ExactResponse", "Frame", "Interval", "Ratio", "exact", "is_hurwitz"]


def exact(value: float) -> fmpq:
    """Return the rational number that `value` is."""
    return fmpq(*float(value).as_integer_ratio())


@dataclass(frozen=True)
class Interval:
    """Frequencies low..high in rad per time unit, both included; `high` may be infinite."""

    low: float
    high: float

    @property
    def unbounded(self) -> bool:
        """Whether the interval reaches infinity."""
        return math.isinf(self.high)

    @property
    def axis(self) -> Frame:
        """All frequencies of the interval."""
        if self.unbounded:
            half = acb(0, -1 / (2 * arb(self.low)))
            return Frame(acb_poly([half, half]), inverse=True, any_phase=True)
        low, high = acb(0, self.low), acb(0, self.high)
        variable = acb_poly([(high + low) / 2, (high - low) / 2])
        return Frame(variable, inverse=False, any_phase=False)

    @property
    def tail(self) -> Frame:
        """All s with |s| >= low and Re s >= 0; for an unbounded interval."""
        reach = 1 / arb(self.low)
        half_disk = acb(reach * arb(0.5, 0.5), reach * arb(0, 1))
        return Frame(acb_poly([half_disk]), inverse=True, any_phase=True)


@dataclass(frozen=True, eq=False)
class Frame:
    """A set of values of s over which functions are enclosed.

    Parameters
    ----------
    variable : acb_poly
        s, or 1/s where `inverse`, as a polynomial of degree 1 or 0 in t; -1 <= t <= 1.
    inverse : bool
        Whether the variable is 1/s.
    any_phase : bool
        Whether exp(-theta s) stands for every number of modulus at most 1, as where s may be
        infinite. An enclosure then holds for each such number.

    """

    variable: acb_poly
    inverse: bool
    any_phase: bool

    @classmethod
    def at(cls, omega: float, *, inverse: bool) -> Frame:
        """Return the one frequency `omega` (rad per time unit), in the variable s or 1/s."""
        s = acb(0, omega)
        return cls(acb_poly([1 / s if inverse else s]), inverse=inverse, any_phase=False)

    @cached_property
    def sigma(self) -> TaylorModel:
        """The factor that cancels a pole at s = 0."""
        return TaylorModel.constant(acb(1)) if self.inverse else TaylorModel(self.variable)

    def delay(self, dead_time: fmpq) -> TaylorModel:
        """Return the enclosure of exp(-dead_time s)."""
        if self.any_phase:
            return TaylorModel.constant(acb(arb(0, 1), arb(0, 1)))
        if self.inverse:
            return TaylorModel.constant((-acb(dead_time) / self.variable[0]).exp())
        start = (-acb(dead_time) * self.variable[0]).exp()
        return TaylorModel.phasor(start, -arb(dead_time) * self.variable[1].imag)


@dataclass(frozen=True, eq=False)
class Ratio:
    """A proper rational function num/(s^integrators den) with exact coefficients, den(0) != 0."""

    num: fmpq_poly
    den: fmpq_poly
    integrators: int

    @classmethod
    def reduced(cls, num: fmpq_poly, den: fmpq_poly) -> Ratio:
        """Return num/den in lowest terms."""
        common = num.gcd(den)
        num, den = num // common, den // common
        integrators = next(power for power, c in enumerate(den.coeffs()) if c != 0)
        return cls(num, den.right_shift(integrators), integrators)

    @cached_property
    def _in_s(self) -> tuple[acb_poly, acb_poly]:
        return acb_poly(self.num), acb_poly(self.den)

    @cached_property
    def _in_inverse(self) -> tuple[acb_poly, acb_poly]:
        degree = self.den.degree()
        return _reversed(self.num, degree + self.integrators), _reversed(self.den, degree)

    def enclose(self, frame: Frame, factors: int) -> TaylorModel:
        """Return the enclosure of sigma^factors times this function, factors >= integrators.

        Raises
        ------
        UnenclosedError
            A pole may lie in the frame.

        """
        num, den = self._in_inverse if frame.inverse else self._in_s
        value = TaylorModel.of_polynomial(num(frame.variable))
        if den.degree() > 0:
            value = value * TaylorModel.of_polynomial(den(frame.variable)).reciprocal()
        else:
            value = value.scaled(1 / den[0])
        for _ in range(factors - self.integrators):
            value = value * frame.sigma
        return value


def _reversed(polynomial: fmpq_poly, degree: int) -> acb_poly:
    """Return v^degree polynomial(1/v)."""
    coefficients = polynomial.coeffs()
    return acb_poly([0] * (degree + 1 - len(coefficients)) + coefficients[::-1])


@dataclass(frozen=True, eq=False)
class ExactResponse:
    """A sum of rational functions, each with its dead time."""

    terms: tuple[tuple[fmpq, Ratio], ...]

    @classmethod
    def combined(cls, parts: Sequence[tuple[int, TransferFunction]]) -> ExactResponse:
        """Return the sum of factor times transfer function over `parts`.

        Parts with equal dead time are added exactly, so that nothing which cancels, such as an
        integrator, remains.
        """
        sums: dict[float, tuple[fmpq_poly, fmpq_poly]] = {}
        for factor, function in parts:
            num = factor * _polynomial(function.num)
            den = _polynomial(function.den)
            if function.dead_time in sums:
                other_num, other_den = sums[function.dead_time]
                num, den = num * other_den + other_num * den, den * other_den
            sums[function.dead_time] = num, den
        return cls(
            tuple(
                (exact(dead_time), Ratio.reduced(num, den))
                for dead_time, (num, den) in sums.items()
                if num != 0
            )
        )

    @property
    def integrators(self) -> int:
        """Number of poles at s = 0."""
        return max((ratio.integrators for _, ratio in self.terms), default=0)

    def enclose(self, frame: Frame, factors: int) -> TaylorModel:
        """Return the enclosure of sigma^factors times this function, factors >= integrators.

        Raises
        ------
        UnenclosedError
            A pole may lie in the frame.

        """
        total = TaylorModel.constant(acb(0))
        for dead_time, ratio in self.terms:
            term = ratio.enclose(frame, factors)
            total = total + (term * frame.delay(dead_time) if dead_time else term)
        return total


def _polynomial(descending: Sequence[float]) -> fmpq_poly:
    return fmpq_poly([exact(c) for c in reversed(descending)])


def is_hurwitz(descending: Sequence[float]) -> bool:
    """Whether all roots but those at 0 lie in the open left half plane: Routh's array, exact."""
    coefficients = [exact(c) for c in descending]
    while coefficients[-1] == 0:
        coefficients.pop()
    upper, lower = coefficients[0::2], coefficients[1::2]
    while lower:
        if lower[0] * upper[0] <= 0:
            return False
        factor = upper[0] / lower[0]
        padded = lower + [fmpq(0)] * (len(upper) - len(lower))
        upper, lower = lower, [u - factor * p for u, p in zip(upper[1:], padded[1:], strict=True)]
    return True
