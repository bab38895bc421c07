"""Square matrices of rational functions, exactly: the zeros of the Smith-McMillan form.

Coefficients are read as the decimal numbers that the user typed and are rational, so poles and
zeros cancel exactly when they should and no tolerance decides on the order of the plant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from flint import fmpq, fmpq_poly, fmpz, fmpz_poly

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from solver.model.transfer_function import TransferFunction

__all__ = [
    "Rational",
    "Root",
    "common_degree",
    "decimal",
    "determinant_of",
    "least_common_multiple",
    "roots_of",
    "to_float",
    "transmission_zeros_of",
]

_ONE = fmpq_poly([1])


@dataclass(frozen=True)
class Root:
    """A root and how often it occurs."""

    value: complex
    multiplicity: int


@dataclass(frozen=True)
class Rational:
    """num/den over the rational numbers, without common factors, den monic."""

    num: fmpq_poly
    den: fmpq_poly

    @classmethod
    def reduced(cls, num: fmpq_poly, den: fmpq_poly) -> Rational:
        """Cancel common factors."""
        if num.degree() < 0:
            return cls(num, _ONE)
        common = num.gcd(den)
        num, den = num // common, den // common
        leading = den[den.degree()]
        return cls(num / leading, den / leading)

    @classmethod
    def from_transfer_function(cls, element: TransferFunction) -> Rational:
        """Read the rational part; the dead time is the caller's business."""
        return cls.reduced(_polynomial(element.num), _polynomial(element.den))

    @property
    def is_zero(self) -> bool:
        """Whether this is the zero function."""
        return bool(self.num.degree() < 0)

    def __add__(self, other: Rational) -> Rational:
        return Rational.reduced(self.num * other.den + other.num * self.den, self.den * other.den)

    def __mul__(self, other: Rational) -> Rational:
        return Rational.reduced(self.num * other.num, self.den * other.den)

    def scaled(self, factor: int) -> Rational:
        """Return `factor` times the function."""
        return Rational.reduced(self.num * fmpq(factor), self.den)


def transmission_zeros_of(matrix: Sequence[Sequence[Rational]]) -> tuple[Root, ...] | None:
    """Return the finite zeros of the Smith-McMillan form with their multiplicities.

    None where the determinant vanishes identically: the outputs depend on each other at every
    frequency.

    Away from the poles the zeros are those of the determinant. At a pole, where zeros may hide
    behind poles in other directions, the local form at the pole's minimal polynomial is
    computed by elimination with pivots of least order.

    Parameters
    ----------
    matrix : sequence of sequences of Rational
        Square.

    """
    n = len(matrix)
    denominators = _row_denominators(matrix)
    rows = [
        [element.num * (den // element.den) for element in row]
        for row, den in zip(matrix, denominators, strict=True)
    ]
    numerator = _determinant(rows)
    if numerator.degree() < 0:
        return None
    factors = _pole_factors(element for row in matrix for element in row)
    roots: list[Root] = []
    for factor in factors:
        while (numerator % factor).degree() < 0:
            numerator //= factor
        exponents = _local_exponents(matrix, factor, n)
        multiplicity = sum(exponent for exponent in exponents if exponent > 0)
        if multiplicity:
            roots.extend(Root(root.value, multiplicity) for root in roots_of(factor))
    roots.extend(roots_of(numerator))
    return tuple(sorted(roots, key=lambda root: (abs(root.value), root.value.imag)))


def common_degree(matrix: Sequence[Sequence[Rational]]) -> int:
    """Return the number of roots of the rows' common denominators: the work grows with it."""
    return sum(int(den.degree()) for den in _row_denominators(matrix))


def determinant_of(matrix: Sequence[Sequence[Rational]]) -> Rational:
    """Return the determinant of a square matrix, without common factors."""
    denominators = _row_denominators(matrix)
    rows = [
        [element.num * (den // element.den) for element in row]
        for row, den in zip(matrix, denominators, strict=True)
    ]
    common = _ONE
    for den in denominators:
        common = common * den
    return Rational.reduced(_determinant(rows), common)


def _row_denominators(matrix: Sequence[Sequence[Rational]]) -> list[fmpq_poly]:
    return [least_common_multiple(element.den for element in row) for row in matrix]


def _polynomial(coefficients: Sequence[float]) -> fmpq_poly:
    return fmpq_poly([decimal(value) for value in reversed(coefficients)])


def decimal(value: float) -> fmpq:
    """Return the decimal number that a float prints as, exactly."""
    exact = Fraction(repr(float(value)))
    return fmpq(exact.numerator, exact.denominator)


def to_float(value: fmpq) -> float:
    """Return the nearest float, infinite where the number is too large."""
    try:
        return int(value.p) / int(value.q)
    except OverflowError:
        return math.inf if value.p > 0 else -math.inf


def roots_of(polynomial: fmpq_poly) -> list[Root]:
    """Return the complex roots, correct to double precision; none of a constant."""
    if polynomial.degree() < 1:
        return []
    return [
        Root(complex(float(root.real.mid()), float(root.imag.mid())), int(count))
        for root, count in polynomial.numer().complex_roots()
    ]


def least_common_multiple(polynomials: Iterable[fmpq_poly]) -> fmpq_poly:
    """Return the least common multiple of monic polynomials."""
    result = _ONE
    for polynomial in polynomials:
        result = result * (polynomial // result.gcd(polynomial))
    return result


def _pole_factors(elements: Iterable[Rational]) -> list[fmpq_poly]:
    """Irreducible factors of all denominators, each once."""
    found: list[fmpz_poly] = []
    for den in {str(element.den): element.den for element in elements}.values():
        for factor, _ in den.numer().factor()[1]:
            if factor not in found:
                found.append(factor)
    return [fmpq_poly(factor) for factor in found]


def _determinant(rows: list[list[fmpq_poly]]) -> fmpq_poly:
    """Return the determinant by Bareiss' elimination, whose divisions are exact."""
    n = len(rows)
    work = [list(row) for row in rows]
    previous = _ONE
    sign = 1
    for step in range(n - 1):
        pivots = [row for row in range(step, n) if work[row][step].degree() >= 0]
        if not pivots:
            return fmpq_poly()
        pivot = min(pivots, key=lambda row: work[row][step].degree())
        if pivot != step:
            work[step], work[pivot] = work[pivot], work[step]
            sign = -sign
        for row in range(step + 1, n):
            for column in range(step + 1, n):
                work[row][column] = (
                    work[row][column] * work[step][step] - work[row][step] * work[step][column]
                ) // previous
        previous = work[step][step]
    return work[-1][-1] * fmpq(sign)


def _local_exponents(matrix: Sequence[Sequence[Rational]], factor: fmpq_poly, n: int) -> list[int]:
    """Exponents of `factor` in the Smith-McMillan form: zeros positive, poles negative.

    Elimination in the ring of polynomials modulo a power of the factor, raised until every
    pivot is found.
    """
    depth = max(_order(element.den, factor) for row in matrix for element in row)
    power = depth + 1
    while True:
        modulus = factor**power
        work = [[_local(element, factor, depth, modulus) for element in row] for row in matrix]
        exponents = _local_smith(work, factor, modulus, power)
        if len(exponents) == n:
            return [exponent - depth for exponent in exponents]
        power *= 2


def _local(element: Rational, factor: fmpq_poly, depth: int, modulus: fmpq_poly) -> fmpq_poly:
    """Return factor^depth element, modulo the given power of the factor."""
    order = _order(element.den, factor)
    rest = element.den // factor**order
    return element.num * factor ** (depth - order) * _inverse(rest, modulus) % modulus


def _local_smith(
    work: list[list[fmpq_poly]], factor: fmpq_poly, modulus: fmpq_poly, power: int
) -> list[int]:
    """Exponents of the pivots below `power`; fewer than n where the power does not show all."""
    exponents = []
    remaining = list(range(len(work)))
    columns = list(range(len(work)))
    while remaining:
        order, row, column = min(
            (_order(work[r][c], factor, power), r, c) for r in remaining for c in columns
        )
        if order >= power:
            break
        exponents.append(order)
        remaining.remove(row)
        columns.remove(column)
        unit = _inverse(work[row][column] // factor**order, modulus)
        for other in remaining:
            # Exact: no element here has a lower order than the pivot.
            multiplier = (work[other][column] // factor**order) * unit % modulus
            for position in columns:
                work[other][position] = (
                    work[other][position] - multiplier * work[row][position]
                ) % modulus
    return exponents


def _order(polynomial: fmpq_poly, factor: fmpq_poly, most: int | None = None) -> int:
    """How often the factor divides the polynomial; `most` for the zero polynomial."""
    if polynomial.degree() < 0:
        return 0 if most is None else most
    count = 0
    while True:
        quotient, remainder = divmod(polynomial, factor)
        if remainder.degree() >= 0:
            return count
        polynomial, count = quotient, count + 1


def _inverse(polynomial: fmpq_poly, modulus: fmpq_poly) -> fmpq_poly:
    """Inverse modulo a power of a factor that does not divide the polynomial."""
    common, inverse, _ = (polynomial % modulus).xgcd(modulus)
    return inverse / common[fmpz(0)]
