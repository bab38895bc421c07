"""Taylor enclosures of transfer functions over frequency intervals, in ball arithmetic.

A function of frequency is enclosed on an interval by a Taylor polynomial about the midpoint plus
a remainder: all coefficients but the last are expanded at the midpoint, the last one over the
whole interval (Lagrange's form), and every number is a ball that holds all rounding errors. In
Bernstein form such a polynomial lies in the convex hull of its control points, which decides
positivity and encirclement without a grid.

The variable is s on a finite interval and 1/s on one that reaches infinity. Functions are
multiplied by as many factors sigma as cancel their poles at s = 0, where sigma = s on a finite
interval and sigma = 1 elsewhere: both ends of the frequency axis are regular. On an interval
that reaches infinity a dead time has no limit; there exp(-theta s) stands for every number of
modulus at most 1.

Ball arithmetic: F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval
arithmetic", IEEE Trans. Computers 66 (2017), 1281-1292. Bernstein form: R. T. Farouki, "The
Bernstein polynomial basis: a centennial retrospective", Comput. Aided Geom. Des. 29 (2012).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

from flint import acb, acb_mat, acb_poly, acb_series, arb, ctx, fmpq, fmpq_mat, fmpq_poly

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.transfer_function import TransferFunction

__all__ = [
    "POINTS",
    "PRECISION",
    "Frame",
    "Interval",
    "Ratio",
    "Response",
    "UnenclosedError",
    "conjugate",
    "control_points",
    "exact",
    "is_hurwitz",
    "quotient",
]

PRECISION = 128  # bits; doubles would lose all their digits on polynomials of degree 20
DEGREE = 8  # of the remainder: even, and below the 10 terms at which python-flint cuts series off
POINTS = DEGREE  # control points of a polynomial of degree DEGREE - 1


class UnenclosedError(ArithmeticError):
    """A denominator may vanish on the interval: it must be split."""


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

    @cached_property
    def thin(self) -> Frame:
        """Expansions at the centre."""
        return Frame(self._variable, self.unbounded, arb(0), DEGREE, self.unbounded)

    @cached_property
    def fat(self) -> Frame:
        """Expansions at all points of the interval at once."""
        return Frame(self._variable, self.unbounded, arb(0, 1), DEGREE + 1, self.unbounded)

    @property
    def tail(self) -> Frame:
        """Values at all s with |s| >= low and Re s >= 0; for an unbounded interval."""
        reach = 1 / arb(self.low)
        half_disk = acb(reach * arb(0.5, 0.5), reach * arb(0, 1))
        return Frame(acb_poly([half_disk]), inverse=True, start=arb(0), terms=1, any_phase=True)

    def at(self, omega: float) -> Frame:
        """Return the values at the finite frequency `omega`, in this interval's variable."""
        s = acb(0, omega)
        variable = acb_poly([1 / s if self.unbounded else s])
        return Frame(variable, self.unbounded, start=arb(0), terms=1, any_phase=False)

    @cached_property
    def _variable(self) -> acb_poly:
        if self.unbounded:
            half = acb(0, -1 / (2 * arb(self.low)))
            return acb_poly([half, half])
        low, high = acb(0, self.low), acb(0, self.high)
        return acb_poly([(high + low) / 2, (high - low) / 2])


@dataclass(frozen=True, eq=False)
class Frame:
    """Where functions are expanded.

    Parameters
    ----------
    variable : acb_poly
        s, or 1/s where `inverse`, as a polynomial in t; the interval is -1 <= t <= 1.
    inverse : bool
        Whether the variable is 1/s.
    start : arb
        t about which to expand, a point or a ball.
    terms : int
        Length of the expansions.
    any_phase : bool
        Whether exp(-theta s) stands for every number of modulus at most 1, as where s may be
        infinite. The expansions then hold for each such number.

    """

    variable: acb_poly
    inverse: bool
    start: arb
    terms: int
    any_phase: bool

    @cached_property
    def sigma(self) -> acb_series:
        """The factor that cancels a pole at s = 0."""
        return self.constant(acb(1)) if self.inverse else self.polynomial(_IDENTITY)

    def constant(self, value: acb) -> acb_series:
        """Return the expansion of a constant."""
        return acb_series([value], self.terms)

    def polynomial(self, polynomial: acb_poly) -> acb_series:
        """Return the expansion of a polynomial in the variable."""
        # Centred form: a polynomial in t about the centre loses far less over a ball of t than
        # one in s about 0, where large powers of opposite sign cancel.
        in_t = polynomial(self.variable)
        if not self.start.is_zero():
            in_t = in_t(acb_poly([self.start, 1]))
        return acb_series(in_t.coeffs()[: self.terms], self.terms)

    def delay(self, dead_time: fmpq) -> acb_series:
        """Return the expansion of exp(-dead_time s)."""
        if self.any_phase:
            return self.constant(acb(arb(0, 1), arb(0, 1)))
        variable = self.polynomial(_IDENTITY)
        return ((1 / variable if self.inverse else variable) * acb(-dead_time)).exp()


_IDENTITY = acb_poly([0, 1])


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

    def expand(self, frame: Frame, factors: int) -> acb_series:
        """Return the expansion of sigma^factors times this function, factors >= integrators."""
        num, den = self._in_inverse if frame.inverse else self._in_s
        value = quotient(frame.polynomial(num), frame.polynomial(den))
        for _ in range(factors - self.integrators):
            value = value * frame.sigma
        return value


def _reversed(polynomial: fmpq_poly, degree: int) -> acb_poly:
    """Return v^degree polynomial(1/v)."""
    coefficients = polynomial.coeffs()
    return acb_poly([0] * (degree + 1 - len(coefficients)) + coefficients[::-1])


@dataclass(frozen=True, eq=False)
class Response:
    """A sum of rational functions, each with its dead time."""

    terms: tuple[tuple[fmpq, Ratio], ...]

    @classmethod
    def combined(cls, parts: Sequence[tuple[int, TransferFunction]]) -> Response:
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

    def expand(self, frame: Frame, factors: int) -> acb_series:
        """Return the expansion of sigma^factors times this function, factors >= integrators."""
        total = frame.constant(acb(0))
        for dead_time, ratio in self.terms:
            term = ratio.expand(frame, factors)
            total = total + (term * frame.delay(dead_time) if dead_time else term)
        return total


def _polynomial(descending: Sequence[float]) -> fmpq_poly:
    return fmpq_poly([exact(c) for c in reversed(descending)])


def quotient(num: acb_series, den: acb_series) -> acb_series:
    """Return num/den.

    Raises
    ------
    UnenclosedError
        The denominator may vanish.

    """
    if den[0].contains(0):
        message = "a denominator may vanish on the interval"
        raise UnenclosedError(message)
    return num / den


def conjugate(series: acb_series) -> acb_series:
    """Return the expansion of the complex conjugate, t being real."""
    return acb_series([c.conjugate() for c in series.coeffs()], series.prec)


def control_points(thin: Sequence[acb_series], fat: Sequence[acb_series]) -> acb_mat:
    """Return Bernstein control points, one function a row and `POINTS` columns.

    At every point of the interval all functions together are one convex combination of the
    columns.

    Parameters
    ----------
    thin, fat : sequence of acb_series
        Expansions of the functions in the two frames of an interval.

    """
    taylor = acb_mat([[series[power] for power in range(DEGREE)] for series in thin])
    # DEGREE is even, so that t^DEGREE runs over [0, 1].
    rest = [series[DEGREE] * arb(0.5, 0.5) for series in fat]
    return taylor * _bernstein_of_powers() + acb_mat([[r] * POINTS for r in rest])


@cache
def _bernstein_of_powers() -> acb_mat:
    """Row j: the Bernstein coefficients of t^j on [-1, 1] in degree DEGREE - 1."""
    degree = DEGREE - 1
    rows = []
    for power in range(DEGREE):
        in_u = fmpq_poly([-1, 2]) ** power  # t = 2u - 1, 0 <= u <= 1
        # b_k = sum_j C(k, j)/C(degree, j) a_j: Farouki (2012), eq. 13.
        rows.append(
            [
                sum(
                    (fmpq(math.comb(k, j), math.comb(degree, j)) * in_u[j] for j in range(k + 1)),
                    fmpq(0),
                )
                for k in range(POINTS)
            ]
        )
    with ctx.workprec(PRECISION):
        return acb_mat(fmpq_mat(rows))


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
