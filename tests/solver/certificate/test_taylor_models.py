"""Taylor models enclose what is computed with them, tightly."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from flint import acb, acb_poly, arb, ctx
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from solver.certificate.taylor_models import (
    DEGREE,
    PRECISION,
    TaylorModel,
    UnenclosedError,
    control_points,
)

POSITIONS = st.floats(-1, 1)
COEFFICIENTS = st.lists(
    st.complex_numbers(max_magnitude=2, allow_nan=False), min_size=1, max_size=12
)


@pytest.fixture(autouse=True)
def _precision() -> Iterator[None]:
    with ctx.workprec(PRECISION):
        yield


def model_of(coefficients: list[complex]) -> TaylorModel:
    """The polynomial with these coefficients, ascending."""
    return TaylorModel.of_polynomial(acb_poly([acb(c) for c in coefficients]))


def polynomial_at(coefficients: list[complex], t: float) -> acb:
    """Its value."""
    return acb_poly([acb(c) for c in coefficients])(acb(t))


def value_at(model: TaylorModel, t: float) -> acb:
    """Polynomial plus rest at t."""
    return model.polynomial(acb(t)) + model.rest * arb(t) ** DEGREE


@settings(max_examples=200, deadline=None)
@given(COEFFICIENTS, COEFFICIENTS, POSITIONS)
def test_sums_products_and_conjugates_enclose_theirs(
    first: list[complex], second: list[complex], t: float
) -> None:
    """Of two polynomials, of degrees below and above that of the model."""
    f, g = polynomial_at(first, t), polynomial_at(second, t)
    F, G = model_of(first), model_of(second)
    assert value_at(F + G, t).overlaps(f + g)
    assert value_at(F - G, t).overlaps(f - g)
    assert value_at(F * G, t).overlaps(f * g)
    assert value_at(F.conjugate, t).overlaps(f.conjugate())
    assert value_at(F.scaled(acb(0, 3)), t).overlaps(f * acb(0, 3))
    assert (F * G).values.overlaps(f * g)


@settings(max_examples=200, deadline=None)
@given(COEFFICIENTS, POSITIONS)
def test_a_reciprocal_encloses_the_reciprocal(coefficients: list[complex], t: float) -> None:
    """Wherever it can be formed, even when the denominator comes near zero."""
    try:
        reciprocal = model_of(coefficients).reciprocal()
    except UnenclosedError:
        assume(condition=False)
    assert value_at(reciprocal, t).overlaps(1 / polynomial_at(coefficients, t))


@given(st.floats(-30, 30), POSITIONS)
def test_a_phasor_encloses_the_exponential(slope: float, t: float) -> None:
    """Of slopes small and so large that the polynomial says nothing."""
    start = acb(0, 1).exp()
    model = TaylorModel.phasor(start, arb(slope))
    assert value_at(model, t).overlaps(start * acb(0, arb(slope) * arb(t)).exp())


@settings(max_examples=100, deadline=None)
@given(COEFFICIENTS, POSITIONS)
def test_values_lie_in_the_hull_of_the_control_points(
    coefficients: list[complex], t: float
) -> None:
    """In every direction of the plane, no value lies beyond all control points."""
    points = control_points([model_of(coefficients)]).tolist()[0]
    value = polynomial_at(coefficients, t)
    for angle in (0.0, 0.7, 1.57, 2.5, 3.14, 4.0, 5.0, 6.0):
        turn = acb(0, angle).exp()
        highest = max((point * turn).real.upper() for point in points)
        assert not (value * turn).real.lower() > highest


def test_the_first_and_last_control_point_are_the_ends() -> None:
    """Of a polynomial below the model's degree they are its values at t = -1 and 1."""
    points = control_points([model_of([1, 2, 3j])]).tolist()[0]
    assert points[0].overlaps(acb(-1, 3))
    assert points[-1].overlaps(acb(3, 3))


def test_the_rest_of_a_quotient_falls_with_the_eighth_power_of_the_width() -> None:
    """1/(1 + h t) has the rest h^8/(1 + h t)."""
    wide, narrow = (float(abs(model_of([1, h]).reciprocal().rest).upper()) for h in (0.02, 0.01))
    assert wide / narrow == pytest.approx(2**8, rel=0.05)
    assert wide == pytest.approx(0.02**8, rel=0.1)


def test_a_denominator_that_may_vanish_is_refused() -> None:
    """1/t has no model; 1/(2 + t) has."""
    with pytest.raises(UnenclosedError):
        model_of([0, 1]).reciprocal()
    assert math.isfinite(float(abs(model_of([2, 1]).reciprocal().rest).upper()))


def test_series_that_flint_cuts_off_are_refused() -> None:
    """With flint's global cap below the degree a quotient would lose terms: it is not formed."""
    model = model_of([2, 1])
    cap = ctx.cap
    ctx.cap = 4
    try:
        with pytest.raises(UnenclosedError):
            model.reciprocal()
    finally:
        ctx.cap = cap


def test_a_denominator_may_fall_to_a_tenth_of_its_highest_value() -> None:
    """1 + 0.8 t, between 0.2 and 1.8, is inverted: its ball is wide, and does not hold 0."""
    reciprocal = model_of([1, 0.8]).reciprocal()
    for t in (-1.0, -0.9, 0.3, 1.0):
        assert value_at(reciprocal, t).contains(1 / acb(1 + 0.8 * arb(t)))
