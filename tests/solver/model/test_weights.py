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


@pytest.mark.parametrize("r", [1e-6, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0])
def test_gain_and_dead_time_errors_are_covered_at_every_frequency(r):
    """|w_I| is above every |k e^(-j omega theta') - 1| with k in 1 -+ r, theta' in 0..theta."""
    theta = 3.0
    x = np.concatenate([np.geomspace(1e-6, 0.1, 500), np.linspace(0.1, 40, 8000), [1e3, 1e6]])
    weight = Uncertainty.from_gain_and_dead_time(r, theta).magnitude(x / theta)
    for gain in (1 - r, 1 + r):
        for share in (1.0, 0.9, 0.5, 0.1, 0.0):
            error = np.abs(gain * np.exp(-1j * share * x) - 1)
            assert (weight >= error * (1 - 1e-9)).all()


@pytest.mark.parametrize("theta", [0.0, 1e-12, 1e-3, 1.0, 1e6, 1e12])
def test_the_weight_of_gain_and_dead_time_scales_with_the_unit_of_time(theta):
    """The same in every unit of time: a function of omega theta alone."""
    weight = Uncertainty.from_gain_and_dead_time(0.2, theta)
    if theta == 0:
        assert weight.magnitude([1e-3, 1.0]).tolist() == [0.2, 0.2]
        return
    x = np.geomspace(1e-3, 1e3, 50)
    usual = Uncertainty.from_gain_and_dead_time(0.2, 1.0).magnitude(x)
    np.testing.assert_allclose(weight.magnitude(x / theta), usual, rtol=1e-12)


def test_the_published_weight_covers_a_dead_time_to_seven_tenths_only():
    """|e^(-j omega theta) - 1| passes |w_I| at omega theta = 0.71 for epsilon = 0.2."""
    weight = Uncertainty.from_error(0.2, 1.0)
    omega = np.linspace(0.6, 1.2, 601)
    short = np.abs(np.exp(-1j * omega) - 1) > weight.magnitude(omega)
    assert omega[short][0] == pytest.approx(0.71, abs=0.01)


@pytest.mark.parametrize(
    ("r", "theta", "field"),
    [(0.0, 1.0, "/gain_error"), (1.5, 1.0, "/gain_error"), (0.2, -1.0, "/dead_time_error")],
)
def test_errors_out_of_range_are_refused(r, theta, field):
    """Each by its name."""
    with pytest.raises(InvalidInputError) as error:
        Uncertainty.from_gain_and_dead_time(r, theta)
    assert error.value.field == field
