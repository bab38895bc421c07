import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.model.controllers import Controller, IdealForm, ParallelForm
from solver.model.errors import InvalidInputError

sizes = st.floats(1e-3, 1e3)


@given(sizes, sizes, sizes, st.sampled_from([1e-3, 0.1, 2.0, 50.0]))
def test_ideal_form_is_the_same_transfer_function(gain, integral_time, ratio, s):
    """Where the ideal form exists it has the cascade form's value, filter included."""
    cascade = Controller(gain, integral_time, integral_time / max(ratio, 0.11))
    if cascade.integral_time < 0.1 * cascade.derivative_time:
        with pytest.raises(InvalidInputError):
            cascade.to_ideal()
        return
    ideal = cascade.to_ideal()
    value = ideal.gain * (
        1 + 1 / (ideal.integral_time * s) + ideal.derivative_time * s / (1 + ideal.filter_time * s)
    )
    assert value == pytest.approx(cascade(s), rel=1e-9)


@given(sizes, sizes, st.floats(0.15, 100))
def test_conversions_return_to_the_same_controller(gain, integral_time, ratio):
    """Cascade to ideal to cascade, and through the parallel form, change nothing."""
    cascade = Controller(-gain, integral_time, integral_time / ratio)
    for back in (
        Controller.from_ideal(cascade.to_ideal()),
        Controller.from_parallel(cascade.to_parallel()),
    ):
        assert back.gain == pytest.approx(cascade.gain, rel=1e-6)
        assert back.integral_time == pytest.approx(cascade.integral_time, rel=1e-6)
        assert back.derivative_time == pytest.approx(cascade.derivative_time, rel=1e-6)


def test_pi_forms_are_simple():
    """A PI controller has the same gain and integral time in all forms."""
    assert Controller(2, 5).to_ideal() == IdealForm(2, 5)
    assert Controller(2, 5).to_parallel() == ParallelForm(2, 0.4)
    assert Controller.from_parallel(ParallelForm(2, 0.4)) == Controller(2, 5)


@pytest.mark.parametrize(
    ("ideal", "field"),
    [
        (IdealForm(1, 1, 0.3), "/derivative_time"),
        (IdealForm(1, 1, 0.1, 0.6), "/derivative_time"),
        (IdealForm(1, -1), "/integral_time"),
        (IdealForm(0, 1), "/gain"),
    ],
)
def test_ideal_controllers_without_a_cascade_form_say_so(ideal, field):
    """A derivative time too long, with or without a filter, a time or gain out of range."""
    with pytest.raises(InvalidInputError) as error:
        Controller.from_ideal(ideal)
    assert error.value.field == field


def test_pid_matches_eq_26():
    """SLH eq. 26 at one point, written out."""
    s = 0.3j
    expected = 7 * (1 + 20 * s) / (20 * s) * (1 + 2 * s) / (1 + 0.2 * s)
    assert Controller(7, 20, 2)(s) == pytest.approx(expected, rel=1e-15)
    assert Controller(7, 20, 2).response(np.array([0.3]))[0] == pytest.approx(expected, rel=1e-15)


@given(sizes, st.none() | sizes, st.none() | sizes, st.none() | sizes)
def test_a_filter_of_its_own_converts_in_every_direction(
    gain, integral_time, derivative_time, filter_time
):
    """Where the ideal form exists, it and its cascade form have the controller's value at any s."""
    cascade = Controller(gain, integral_time, derivative_time, filter_time)
    try:
        ideal = cascade.to_ideal()
    except InvalidInputError:
        lead, lag = derivative_time or 0.0, cascade.lag_time
        integral = np.inf if integral_time is None else integral_time
        assert integral + lead <= lag or (integral < lag) != (lead < lag)
        return
    back = Controller.from_ideal(ideal)
    for s in (2e-3, 0.3, 70.0):
        integral = 0 if ideal.integral_time is None else 1 / (ideal.integral_time * s)
        derivative = ideal.derivative_time * s / (1 + ideal.filter_time * s)
        assert ideal.gain * (1 + integral + derivative) == pytest.approx(cascade(s), rel=1e-8)
        assert back(s) == pytest.approx(cascade(s), rel=1e-6)


def test_an_ordinary_pid_converts_back_to_the_default_filter():
    """The default filter stays None through the ideal form, also where tau_D exceeds tau_I."""
    for cascade in (Controller(3, 20, 2), Controller(3, 2, 15)):
        back = Controller.from_ideal(cascade.to_ideal())
        assert back.filter_time is None
        assert back.derivative_time == pytest.approx(cascade.derivative_time, rel=1e-9)


def test_p_and_pd_are_controllers_without_integral_time():
    """P is its gain; PD has the lead and the default filter; both have a parallel form."""
    assert Controller(3, None)(0.2j) == 3
    assert Controller(3, None, 2)(0.2j) == pytest.approx(3 * (1 + 0.4j) / (1 + 0.04j), rel=1e-15)
    assert Controller(3, None).to_parallel() == ParallelForm(3, 0)
    assert Controller.from_parallel(ParallelForm(3, 0)) == Controller(3, None)


@pytest.mark.parametrize("name", ["integral_time", "derivative_time", "filter_time"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_times_out_of_range_are_named(name, value):
    """Zero, negative and infinite times are refused; the field is named."""
    times = {"integral_time": 5.0, "derivative_time": 1.0, "filter_time": 0.1, name: value}
    with pytest.raises(InvalidInputError) as error:
        Controller(2, **times)
    assert error.value.field == f"/{name}"
