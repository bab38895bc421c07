"""Enclosures of transfer functions hold the true values."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from flint import acb, arb, ctx, fmpq
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from solver.certificate.enclosures import ExactResponse, Frame, Interval, exact, is_hurwitz
from solver.certificate.taylor_models import DEGREE, PRECISION, TaylorModel, UnenclosedError
from solver.model.transfer_function import TransferFunction

LAG = TransferFunction([1], [1, 1])


@pytest.fixture(autouse=True)
def _precision() -> Iterator[None]:
    with ctx.workprec(PRECISION):
        yield


def polynomials(low: float, high: float) -> st.SearchStrategy[list[float]]:
    """Polynomials with up to 6 roots whose real parts lie in low..high."""
    real = st.floats(low, high).map(lambda r: [1.0, -r])
    pair = st.tuples(st.floats(low, high), st.floats(0.01, 10)).map(
        lambda p: [1.0, -2 * p[0], p[0] ** 2 + p[1] ** 2]
    )
    return st.lists(real | pair, min_size=1, max_size=3).map(
        lambda factors: [float(c) for c in _product(factors)]
    )


def _product(factors: list[list[float]]) -> NDArray[np.float64]:
    product = np.ones(1)
    for factor in factors:
        product = np.convolve(product, factor)
    return product


@st.composite
def transfer_functions(draw: st.DrawFn) -> TransferFunction:
    """Stable, or with an integrator beside stable poles; some with dead time."""
    den = draw(polynomials(-10, -0.01))
    if draw(st.booleans()):
        den = [*den, 0.0]
    num = draw(st.lists(st.floats(0.1, 10), min_size=1, max_size=len(den)))
    return TransferFunction(num, den, draw(st.sampled_from([0.0, 0.3, 7.0])))


@st.composite
def finite_intervals(draw: st.DrawFn) -> Interval:
    """From zero or from further up, wide and narrow."""
    low = draw(st.just(0.0) | st.floats(1e-3, 30))
    return Interval(low, (low or 0.1) * (1 + draw(st.floats(1e-6, 1))))


def direct(function: TransferFunction, s: acb) -> acb:
    """Value at the ball s, by Horner's rule."""
    num = den = acb(0)
    for c in function.num:
        num = num * s + c
    for c in function.den:
        den = den * s + c
    return num / den * (-acb(function.dead_time) * s).exp()


def value_at(model: TaylorModel, t: arb) -> acb:
    """Polynomial plus rest at t."""
    return model.polynomial(acb(t)) + model.rest * t**DEGREE


def enclosed(function: TransferFunction, interval: Interval) -> TaylorModel:
    """The function over the interval; inapplicable where that is too wide for it."""
    response = ExactResponse.combined([(1, function)])
    try:
        return response.enclose(interval.axis, response.integrators)
    except UnenclosedError:
        reject()


@settings(max_examples=200, deadline=None)
@given(transfer_functions(), finite_intervals(), st.floats(0.001, 1))
def test_every_value_lies_in_its_enclosure(
    function: TransferFunction, interval: Interval, position: float
) -> None:
    """At any frequency, polynomial plus rest hold the value found by direct evaluation."""
    model = enclosed(function, interval)
    s = acb(0, interval.low + (arb(interval.high) - interval.low) * arb(position))
    value = direct(function, s) * s ** ExactResponse.combined([(1, function)]).integrators
    assert value_at(model, 2 * arb(position) - 1).overlaps(value)


@settings(max_examples=100, deadline=None)
@given(transfer_functions(), st.floats(0.1, 1e3), st.floats(0.001, 1))
def test_every_value_up_to_infinity_lies_in_its_enclosure(
    function: TransferFunction, low: float, position: float
) -> None:
    """The enclosure on low..infinity holds the value at low/position, whatever the dead time."""
    model = enclosed(function, Interval(low, math.inf))
    value = direct(function, acb(0, low / arb(position)))
    assert value_at(model, 2 * arb(position) - 1).overlaps(value)


@settings(max_examples=100, deadline=None)
@given(transfer_functions(), st.floats(1e3, 1e5), st.floats(1, 100), st.floats(-1.57, 1.57))
def test_the_tail_holds_the_values_in_the_right_half_plane(
    function: TransferFunction, low: float, factor: float, angle: float
) -> None:
    """Every s with |s| >= low and Re s >= 0 has its value in the tail's single ball."""
    tail = ExactResponse.combined([(1, function)]).enclose(Interval(low, math.inf).tail, 4)
    s = acb(low * factor) * acb(0, angle).exp()
    assert tail.values.overlaps(direct(function, s))


@settings(max_examples=100, deadline=None)
@given(transfer_functions(), st.floats(0.1, 1e3))
def test_one_frequency_has_one_value(function: TransferFunction, omega: float) -> None:
    """At a point both variables, s and 1/s, give the value itself, dead time included."""
    response = ExactResponse.combined([(1, function)])
    value = direct(function, acb(0, omega))
    factor = acb(0, omega) ** response.integrators
    for inverse, expected in ((False, value * factor), (True, value)):
        found = response.enclose(Frame.at(omega, inverse=inverse), response.integrators).values
        assert found.overlaps(expected)
        assert float(found.rad()) <= 1e-20 * (1 + float(abs(expected).upper()))


def test_a_pole_that_may_lie_on_the_interval_is_refused() -> None:
    """An undamped resonance inside cannot be enclosed; beside it, it can."""
    resonance = ExactResponse.combined([(1, TransferFunction([1], [1, 0, 1]))])
    with pytest.raises(UnenclosedError):
        resonance.enclose(Interval(0.9, 1.1).axis, 0)
    assert resonance.enclose(Interval(1.5, 1.6).axis, 0).rest.is_finite()


def test_an_integrator_that_cancels_in_a_difference_is_not_counted() -> None:
    """1/s + 1/(s+1) less 1/s integrates no more; their sum does, once."""
    g, i = TransferFunction([2, 1], [1, 1, 0]), TransferFunction([1], [1, 0])
    assert ExactResponse.combined([(1, g), (-1, i)]).integrators == 0
    assert ExactResponse.combined([(1, g), (1, i)]).integrators == 1


def test_equal_functions_cancel_to_zero() -> None:
    """A function less itself has no terms."""
    assert ExactResponse.combined([(1, LAG), (-1, LAG)]).terms == ()


@pytest.mark.parametrize("value", [0.1, 5e-324, 1e300, -101.0, 3])
def test_a_float_becomes_the_rational_number_that_it_is(value: float) -> None:
    """The conversion to a fraction and back changes nothing."""
    fraction = exact(value)
    assert int(fraction.p) / int(fraction.q) == value
    assert isinstance(fraction, fmpq)


@settings(max_examples=200, deadline=None)
@given(polynomials(-5, -0.05), polynomials(-5, 5))
def test_hurwitz_polynomials_are_told_from_others(stable: list[float], other: list[float]) -> None:
    """A product with known stable roots is Hurwitz exactly if the other factor is."""
    assert is_hurwitz(stable)
    assume(np.all(np.abs(np.roots(other).real) > 0.05))
    assert is_hurwitz(list(np.convolve(stable, other))) == bool(np.all(np.roots(other).real < 0))


def test_roots_at_the_origin_are_not_counted_and_those_on_the_axis_are() -> None:
    """An integrator with lag passes; an undamped oscillator does not."""
    assert is_hurwitz([1, 1, 0])
    assert not is_hurwitz([1, 0, 1])
