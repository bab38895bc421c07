"""Taylor models: a polynomial in t on -1 <= t <= 1 and a ball that holds the rest.

f(t) = p(t) + t^DEGREE r(t) with deg p < DEGREE and every value r(t) in a ball. All numbers are
balls that hold their rounding errors, so sums, products and quotients of such enclosures are
enclosures. In Bernstein form they lie in the convex hull of a few control points.

Taylor models: K. Makino and M. Berz, "Taylor models and other validated functional inclusion
methods", Int. J. Pure Appl. Math. 4 (2003). Ball arithmetic: F. Johansson, "Arb: efficient
arbitrary-precision midpoint-radius interval arithmetic", IEEE Trans. Computers 66 (2017).
Bernstein form: R. T. Farouki, "The Bernstein polynomial basis: a centennial retrospective",
Comput. Aided Geom. Des. 29 (2012).
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

from flint import acb, acb_mat, acb_poly, acb_series, arb, fmpq, fmpq_mat, fmpq_poly

from solver.model.precision import working_precision

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["DEGREE", "PRECISION", "TaylorModel", "UnenclosedError", "control_points"]

PRECISION = 128  # bits; doubles would lose all their digits on polynomials of degree 20
DEGREE = 8  # of the rest: even, and at most the 10 terms at which python-flint cuts series off

_SEGMENT = acb(arb(0, 1))  # every t
_EVEN_POWER = arb(0.5, 0.5)  # t^DEGREE for every t
_ZERO = acb(0)


class UnenclosedError(ArithmeticError):
    """No enclosure: a denominator may vanish on the segment, which must be split."""


class TaylorModel:
    """An enclosure of a function of t, -1 <= t <= 1.

    Parameters
    ----------
    polynomial : acb_poly
        p, of degree below DEGREE.
    rest : acb
        Holds r(t) for every t.

    """

    def __init__(self, polynomial: acb_poly, rest: acb = _ZERO) -> None:
        self.polynomial = polynomial
        self.rest = rest

    @classmethod
    def of_polynomial(cls, polynomial: acb_poly) -> TaylorModel:
        """Return the model of a polynomial in t of any degree."""
        if polynomial.length() <= DEGREE:
            return cls(polynomial)
        return cls(polynomial.truncate(DEGREE), polynomial.right_shift(DEGREE)(_SEGMENT))

    @classmethod
    def constant(cls, value: acb) -> TaylorModel:
        """Return the model of a constant, or of every function with values in a ball."""
        return cls(acb_poly([value]))

    @classmethod
    def phasor(cls, start: acb, slope: arb) -> TaylorModel:
        """Return the model of start exp(j slope t) for |start| = 1."""
        exponent = acb_series([_ZERO, acb(0, slope)], DEGREE)
        polynomial = _all_terms(exponent.exp()) * start
        # Lagrange's remainder: the derivatives have modulus |slope|^k.
        bound = (abs(slope) ** DEGREE / math.factorial(DEGREE)).upper()
        return cls(polynomial, acb(arb(0, bound), arb(0, bound)))

    @property
    def values(self) -> acb:
        """A ball that holds the function's values at every t."""
        return self.polynomial(_SEGMENT) + self.rest * _EVEN_POWER

    @property
    def conjugate(self) -> TaylorModel:
        """The complex conjugate."""
        coefficients = [c.conjugate() for c in self.polynomial.coeffs()]
        return TaylorModel(acb_poly(coefficients), self.rest.conjugate())

    def __add__(self, other: TaylorModel) -> TaylorModel:
        """Return the sum."""
        return TaylorModel(self.polynomial + other.polynomial, self.rest + other.rest)

    def __sub__(self, other: TaylorModel) -> TaylorModel:
        """Return the difference."""
        return TaylorModel(self.polynomial - other.polynomial, self.rest - other.rest)

    def __mul__(self, other: TaylorModel) -> TaylorModel:
        """Return the product."""
        product = self.polynomial * other.polynomial
        rest = product.right_shift(DEGREE)(_SEGMENT)
        rest += self.rest * other.values + other.rest * self.polynomial(_SEGMENT)
        return TaylorModel(product.truncate(DEGREE), rest)

    def scaled(self, factor: fmpq | acb) -> TaylorModel:
        """Return the product with a number."""
        number = acb(factor)
        return TaylorModel(self.polynomial * number, self.rest * number)

    def reciprocal(self) -> TaylorModel:
        """Return the reciprocal.

        Raises
        ------
        UnenclosedError
            The function may vanish.

        """
        values = self.values
        if not values.abs_lower() > 0:  # abs() of a ball squares it, and is 0 from 0.41 of it on
            message = "a denominator may vanish"
            raise UnenclosedError(message)
        inverse = _all_terms(acb_series(self.polynomial.coeffs(), DEGREE).inv())
        # p q = 1 + t^DEGREE e, hence 1/f = q - t^DEGREE (e + r q)/f.
        excess = (self.polynomial * inverse).right_shift(DEGREE)(_SEGMENT)
        return TaylorModel(inverse, -(excess + self.rest * inverse(_SEGMENT)) / values)


def _all_terms(series: acb_series) -> acb_poly:
    """Return the first DEGREE terms as a polynomial; flint.ctx.cap may have cut some."""
    if series.prec < DEGREE:
        message = "flint.ctx.cap is below the degree of the Taylor models"
        raise UnenclosedError(message)
    return acb_poly(series.coeffs())


def control_points(models: Sequence[TaylorModel]) -> acb_mat:
    """Return Bernstein control points, one function a row and DEGREE columns.

    At every t all functions together are one convex combination of the columns.

    Parameters
    ----------
    models : sequence of TaylorModel
        The functions.

    """
    powers = acb_mat([[model.polynomial[k] for k in range(DEGREE)] for model in models])
    rests = [model.rest * _EVEN_POWER for model in models]
    return powers * _bernstein_of_powers() + acb_mat([[rest] * DEGREE for rest in rests])


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
                for k in range(DEGREE)
            ]
        )
    with working_precision(PRECISION):
        return acb_mat(fmpq_mat(rows))
