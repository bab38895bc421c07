import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import TransferFunction


@pytest.mark.parametrize(
    ("num", "den", "dead_time", "field"),
    [
        ([], [1], 0, "/num"),
        ([1], [], 0, "/den"),
        ([1], [0], 0, "/den"),
        ([1], [0, 0], 0, "/den"),
        ([1, 2, 3], [1, 1], 0, "/num"),
        ([math.nan], [1, 1], 0, "/num/0"),
        ([1], [1, math.inf], 0, "/den/1"),
        ([1e308], [1, 1], 0, "/num/0"),
        ([1], [5e-324, 1], 0, "/den/0"),
        ([1], [1, 1], -1, "/dead_time"),
        ([1], [1, 1], math.nan, "/dead_time"),
        ([1], [1] * 40, 0, "/den"),
    ],
)
def test_refuses_what_is_no_proper_transfer_function(num, den, dead_time, field):
    """Each faulty part is named by its pointer."""
    with pytest.raises(InvalidInputError) as error:
        TransferFunction(num, den, dead_time)
    assert error.value.field == field


@pytest.mark.parametrize("omega", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_high_orders_evaluate_at_extreme_frequencies(omega):
    """A twentieth-order lag equals the product of its factors from 1e-6 to 1e6 rad."""
    roots = np.geomspace(1e-2, 1e2, 20)
    value = TransferFunction([1], np.poly(-roots)).response(omega)[0]
    factors = np.prod(1 / (1j * omega + roots))
    assert value == pytest.approx(factors, rel=1e-9)


@given(st.floats(-6, 6), st.floats(0, 5))
def test_dead_time_turns_the_phase_only(exponent, dead_time):
    """Dead time multiplies by exp(-j omega dead_time)."""
    omega = 10**exponent
    plain = TransferFunction([2, 1], [3, 4, 5])
    late = TransferFunction([2, 1], [3, 4, 5], dead_time)
    expected = plain.response(omega) * np.exp(-1j * omega * dead_time)
    assert late.response(omega) == pytest.approx(expected, rel=1e-12)


def test_static_gains():
    """Gains at s = 0 are exact, common roots at the origin cancel, integrators are infinite."""
    assert TransferFunction([3], [2, 4]).static_gain == 0.75
    assert TransferFunction([3, 0], [2, 4, 0]).static_gain == 0.75
    assert TransferFunction([-1], [1, 0]).static_gain == -math.inf
    assert TransferFunction([0], [1, 0]).static_gain == 0
    assert TransferFunction([1, 0], [1, 1]).static_gain == 0


def test_derivative_at_zero_is_exact_with_dead_time():
    """Wood and Berry's first element: 12.8 exp(-s)/(16.7 s + 1) has slope -12.8 (16.7 + 1)."""
    element = TransferFunction([12.8], [16.7, 1], 1)
    assert element.derivative_at_zero() == pytest.approx(-12.8 * 17.7, rel=1e-14)


def test_integrators_are_counted_after_cancellation():
    """Roots at the origin cancel between numerator and denominator."""
    assert TransferFunction([1], [1, 0, 0]).integrators == 2
    assert TransferFunction([1, 0], [1, 1, 0, 0]).integrators == 1


@pytest.mark.parametrize(
    ("num", "den", "kept"),
    [
        ([0, 0, 1], [0, 2, 1], ((1.0,), (2.0, 1.0))),
        ([0, 0], [1, 1], ((0.0,), (1.0, 1.0))),
        ([1, 0], [1, 1, 0], ((1.0, 0.0), (1.0, 1.0, 0.0))),
    ],
)
def test_leading_zeros_are_dropped(
    num: list[float], den: list[float], kept: tuple[tuple[float, ...], tuple[float, ...]]
) -> None:
    """Converters pad polynomials with zeros in front; those at the end mean something."""
    function = TransferFunction(num, den)
    assert (function.num, function.den) == kept
    assert function.remarks == ()


@pytest.mark.parametrize(
    ("den", "integrators"),
    [
        ([1, 0.5, -1e-18], 1),
        ([1, 0.5, 1e-18], 1),
        ([1, 1, 1e-18, 1e-36], 2),
        ([3600, 1e-15, -1e-30], 0),  # two slow poles, none to be small beside
        ([1e-15, 1, 1], 0),  # a fast pole beyond doubt
        ([1, 1e6, 1], 0),
        ([1, 1e-12], 0),
        ([1e12, 1e-3], 0),
        ([100, -1e-18], 1),  # no process, and no controller, runs away so slowly
        ([100, 1e-18], 0),
    ],
)
def test_poles_within_rounding_of_zero_are_integrators(den: list[float], integrators: int) -> None:
    """What is 1e-13 of the next pole, and was typed so small, is an integrator, with a remark."""
    function = TransferFunction([1], den)
    assert function.integrators == integrators
    assert len(function.remarks) == bool(integrators)
    assert math.isinf(function.static_gain) is bool(integrators)


def test_leading_rounding_of_a_numerator_is_left_out() -> None:
    """A zero 1e14 times beyond all poles is what a conversion left of a zero coefficient."""
    function = TransferFunction([-1.4e-17, 5.2e-4, 3e-5], [1, 0.1, 3.6e-3, 5.1e-5])
    assert function.num == (5.2e-4, 3e-5)
    (remark,) = function.remarks
    assert "left out" in remark
    # A right-half-plane zero at 1e3 is none.
    assert TransferFunction([-1e-3, 1], [1, 1]).num == (-1e-3, 1.0)


def test_functions_are_equal_whatever_was_made_of_them() -> None:
    """A function read from rounded coefficients is the one that is meant."""
    assert TransferFunction([1], [1, 0.5, -1e-18]) == TransferFunction([1], [1, 0.5, 0])
