"""Smith-McMillan zeros: known by construction from unimodular factors."""

import random

import pytest
from flint import fmpq_poly
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.interaction.rational_matrix import Rational, common_degree, transmission_zeros_of
from solver.model.transfer_function import TransferFunction

X = fmpq_poly([0, 1])
ONE = fmpq_poly([1])


def _product(left: list[list[Rational]], right: list[list[Rational]]) -> list[list[Rational]]:
    zero = Rational(fmpq_poly(), ONE)
    result = []
    for row in left:
        entries = []
        for column in zip(*right, strict=True):
            total = zero
            for a, b in zip(row, column, strict=True):
                total = total + Rational.reduced(a.num * b.num, a.den * b.den)
            entries.append(total)
        result.append(entries)
    return result


def _unimodular(n: int, draw: random.Random) -> list[list[Rational]]:
    """Return a unit triangular polynomial matrix with shuffled rows: determinant 1 or -1."""
    rows = []
    for r in range(n):
        row = []
        for c in range(n):
            entry = ONE if r == c else fmpq_poly()
            if c > r:
                entry = fmpq_poly([draw.randint(-2, 2), draw.randint(-2, 2)])
            row.append(Rational(entry, ONE))
        rows.append(row)
    draw.shuffle(rows)
    return rows


@given(n=st.integers(1, 4), seed=st.integers(0, 10**9))
@settings(max_examples=60, deadline=None)
def test_zeros_are_those_built_in(n: int, seed: int) -> None:
    """U diag(zeros/poles) V with unimodular U and V has the zeros of the diagonal, no others.

    The diagonal follows the divisibility rule of the Smith-McMillan form, and zeros are put at
    places where other directions have poles.
    """
    draw = random.Random(seed)  # noqa: S311 - test data
    places = [draw.randint(-3, 3) for _ in range(3)]
    diagonal, expected = [], {}
    # Exponents of each place rise along the diagonal: poles first, zeros last.
    exponents = {place: sorted(draw.randint(-2, 2) for _ in range(n)) for place in places}
    for position in range(n):
        num, den = ONE, ONE
        for place, powers in exponents.items():
            power = powers[position]
            if power > 0:
                num *= (X - place) ** power
                expected[place] = expected.get(place, 0) + power
            else:
                den *= (X - place) ** -power
        diagonal.append(Rational.reduced(num, den))
    zero = Rational(fmpq_poly(), ONE)
    middle = [[diagonal[r] if r == c else zero for c in range(n)] for r in range(n)]
    matrix = _product(_product(_unimodular(n, draw), middle), _unimodular(n, draw))
    found = transmission_zeros_of(matrix)
    assert found is not None
    assert {root.value: root.multiplicity for root in found} == {
        complex(place): count for place, count in expected.items()
    }


def test_zero_hidden_behind_a_pole() -> None:
    """diag(1/(s+1), (s+1)/(s+2)^2): the determinant has lost the zero at -1, the form has not."""
    none = TransferFunction([0], [1])
    rows = [
        [TransferFunction([1], [1, 1]), none],
        [none, TransferFunction([1, 1], [1, 4, 4])],
    ]
    matrix = [[Rational.from_transfer_function(element) for element in row] for row in rows]
    found = transmission_zeros_of(matrix)
    assert found is not None
    assert [(root.value, root.multiplicity) for root in found] == [(-1, 1)]
    assert common_degree(matrix) == 3


def test_decimals_are_read_as_typed() -> None:
    """(s + 0.1)(s + 0.2) typed as decimals cancels against its factors exactly."""
    element = Rational.from_transfer_function(TransferFunction([1, 0.1], [1, 0.3, 0.02]))
    assert element.num.degree() == 0
    assert element.den == X + fmpq_poly([1]) / 5


def test_vanishing_determinant() -> None:
    """Proportional rows have no zeros: None."""
    g = Rational.from_transfer_function(TransferFunction([1], [1, 1]))
    h = Rational.from_transfer_function(TransferFunction([1], [1, 2]))
    assert transmission_zeros_of([[g, h], [g.scaled(2), h.scaled(2)]]) is None
    zero = Rational(fmpq_poly(), ONE)
    assert zero.is_zero
    assert transmission_zeros_of([[zero, g], [zero, h]]) is None


def test_large_zero_multiplicity_is_found_by_raising_the_power() -> None:
    """A zero of order 7 at a pole needs more terms than the poles alone suggest."""
    lag = Rational(ONE, X + 1)
    many = Rational((X + 1) ** 7, (X + 2) ** 8)
    zero = Rational(fmpq_poly(), ONE)
    found = transmission_zeros_of([[lag, zero], [zero, many]])
    assert found is not None
    assert found[0].value == pytest.approx(-1)
    assert found[0].multiplicity == 7
