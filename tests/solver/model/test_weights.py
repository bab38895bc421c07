import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty


def test_uncertainty_weight_is_the_corrected_eq_27():
    """0.2 (5 s + 1)/(0.5 s + 1) for epsilon = 0.2, theta = 1 (SLH eq. 27 is misprinted)."""
    omega = np.array([1e-3, 0.2, 1.0, 50.0])
    s = 1j * omega
    expected = np.abs(0.2 * (5 * s + 1) / (0.5 * s + 1))
    assert Uncertainty.from_error(0.2, 1).magnitude(omega) == pytest.approx(expected, rel=1e-14)


def test_performance_weight_is_eq_29():
    """(1/M)(tau_P s + 1)/(tau_P s + A/M): 1/A at steady state, 1/M at high frequency."""
    demand = Performance(max_peak=2, offset=0.1, tau_p=10)
    assert demand.magnitude([1e-9, 1e9]) == pytest.approx([10, 0.5], rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ((0, 1), "/epsilon"),
        ((0.2, -1), "/theta"),
        ((float("nan"), 1), "/epsilon"),
        ((1e-308, 1), "/epsilon"),
        ((0.2, 1e-308), "/theta"),
    ],
)
def test_uncertainty_out_of_range_is_refused(arguments, field):
    """The faulty number is named."""
    with pytest.raises(InvalidInputError) as error:
        Uncertainty.from_error(*arguments)
    assert error.value.field == field


def test_unstable_or_zero_weights_are_refused():
    """A weight is stable and not zero."""
    with pytest.raises(InvalidInputError):
        Uncertainty(TransferFunction([1], [1, -1]))
    with pytest.raises(InvalidInputError):
        Uncertainty(TransferFunction([0], [1, 1]))


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"max_peak": 1.0}, "/max_peak"),
        ({"offset": -0.1}, "/offset"),
        ({"offset": 1.0}, "/offset"),
        ({"tau_p": 0.0}, "/tau_p"),
        ({"tau_p": 1e-308}, "/tau_p"),
        ({"offset": 1e-308}, "/offset"),
    ],
)
def test_performance_out_of_range_is_refused(arguments, field):
    """The faulty number is named."""
    with pytest.raises(InvalidInputError) as error:
        Performance(**arguments)
    assert error.value.field == field
