"""What is typed into a control system makes the controller that was found."""

from __future__ import annotations

import re

import numpy as np
import pytest

from solver.hand_over.conversion import MAX_DIGITS, Scales, typed
from solver.hand_over.known import KNOWN, KnownController
from solver.hand_over.law import FilterEntry, Form, GainEntry, IntegralEntry, Law
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError

OMEGA = np.geomspace(1e-4, 1e3, 60)
LOOPS = {
    "PI": Controller(46.3, 101.0),
    "negative PI": Controller(-0.0123, 3.15),
    "PID": Controller(2.5, 40.0, 6.0),
    "negative PID": Controller(-2.5, 40.0, 6.0),
    "equal times": Controller(1.7, 9.0, 9.0),
    "long derivative": Controller(0.8, 3.0, 8.0),
    "own filter": Controller(3.0, 20.0, 4.0, 1.5),
    "PD": Controller(3.0, None, 4.0),
}
SCALES = Scales(gain=250.0 / 80.0, time=60.0)  # degC of 250 over % of 80; minutes typed in seconds


def evaluated(equation: str, symbols: dict[str, float], s: np.ndarray) -> np.ndarray:
    """Value of an equation in the names of the system; a time that is not there is huge."""
    assert re.fullmatch(r"[\w\s.()+*/]+", equation)
    value: np.ndarray = eval(equation, {"__builtins__": {}}, {**symbols, "s": s})  # noqa: S307
    return value


def symbols_of(law: Law, loop: Controller, digits: int = MAX_DIGITS) -> dict[str, float]:
    """Typed values by name, with the value that stands for no such action."""
    found = typed(loop, law, scales=SCALES, digits=digits)
    names = law.names
    sums = law.form is Form.PARALLEL or law.integral is IntegralEntry.REPEATS
    return {
        names.gain: found.gain,
        names.integral: found.integral if found.integral is not None else (0.0 if sums else 1e30),
        names.derivative: found.derivative or 0.0,
        names.filter: found.filter if found.filter is not None else float(law.lowest or 1.0),
    }


def action(law: Law, loop: Controller) -> float:
    """Sign that the switch for direct and reverse action gives the whole law."""
    return -1.0 if loop.gain < 0 and not law.signed else 1.0


def fitting(law: Law, loop: Controller) -> bool:
    """Whether the law has this very controller, filter included."""
    try:
        return not typed(loop, law, scales=SCALES, digits=MAX_DIGITS).notes
    except InvalidInputError:
        return False


@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)
@pytest.mark.parametrize("known", KNOWN, ids=lambda known: known.name)
def test_the_makers_equation_has_the_response_of_the_controller(
    known: KnownController, loop: Controller
) -> None:
    """The maker's equation with the typed values is the controller, in per cent and its unit."""
    try:
        found = typed(loop, known.law, scales=SCALES, digits=MAX_DIGITS)
    except InvalidInputError as error:
        assert "no ideal form" in error.message  # noqa: PT017 - the only reason there may be
        return
    per = SCALES.time
    value = evaluated(known.equation, symbols_of(known.law, loop), 1j * OMEGA / per)
    value = value * action(known.law, loop)
    made = SCALES.gain * found.controller.response(OMEGA)
    if loop.derivative_time is None and known.law.filter is FilterEntry.MEASUREMENT:
        value = value * (1 + 1j * OMEGA / per)  # no filter is typed: take out the one put in above
    np.testing.assert_allclose(value, made, rtol=1e-8)
    if not found.notes:
        np.testing.assert_allclose(made, SCALES.gain * loop.response(OMEGA), rtol=1e-5)


LAWS = [
    Law(form=form, gain=gain, integral=integral, filter=lag)
    for form in Form
    for gain in GainEntry
    for integral in IntegralEntry
    for lag in FilterEntry
    if form is not Form.PARALLEL or (gain, integral) == (GainEntry.GAIN, IntegralEntry.TIME)
]


@pytest.mark.parametrize(
    "law", LAWS, ids=lambda law: f"{law.form}-{law.gain}-{law.integral}-{law.filter}"
)
def test_every_law_says_its_own_equation(law: Law) -> None:
    """The equation that goes with typed values has the response of the controller."""
    for name, loop in LOOPS.items():
        if loop.derivative_time is None:
            continue
        if not fitting(law, loop):
            assert law.form is not Form.CASCADE, name
            continue
        symbols = symbols_of(law, loop)
        value = evaluated(law.equation, symbols, 1j * OMEGA / SCALES.time)
        value = value * action(law, loop)
        np.testing.assert_allclose(value, SCALES.gain * loop.response(OMEGA), rtol=1e-5)


@pytest.mark.parametrize("digits", [1, 2, 3, 5])
@pytest.mark.parametrize(
    "law", LAWS, ids=lambda law: f"{law.form}-{law.gain}-{law.integral}-{law.filter}"
)
def test_typed_values_have_so_many_digits_and_still_make_a_controller(
    law: Law, digits: int
) -> None:
    """Rounded values are what makes the controller that comes back, near the one asked for."""
    for loop in LOOPS.values():
        try:
            found = typed(loop, law, scales=SCALES, digits=digits)
        except InvalidInputError as error:
            assert "no ideal form" in error.message  # noqa: PT017 - the only reason there may be
            continue
        for value in (found.gain, found.integral, found.derivative, found.filter):
            assert value is None or float(f"{value:.{digits}g}") == value
        near = abs(found.controller.response(OMEGA) / loop.response(OMEGA) - 1)
        assert near.max() < 40 * 10.0**-digits


def test_a_fixed_filter_keeps_gain_and_zeros_and_is_told() -> None:
    """Where the system fixes the filter, only the filter differs, and a note says by how much."""
    known = {each.name: each for each in KNOWN}["fieldbus_standard"]
    loop = Controller(2.5, 40.0, 6.0, 2.0)
    found = typed(loop, known.law, scales=Scales(), digits=MAX_DIGITS)
    made = found.controller
    assert found.filter is None
    np.testing.assert_allclose([made.gain, made.integral_time, made.derivative_time], [2.5, 40, 6])
    assert made.to_ideal().filter_time == pytest.approx(0.1 * made.to_ideal().derivative_time)
    assert len(found.notes) == 1
    assert "fixes it" in found.notes[0]


def test_direct_action_is_said_once() -> None:
    """A negative gain is direct action: typed as such where the system has no action switch."""
    loop = Controller(-2.0, 10.0)
    plain = typed(loop, Law(form=Form.IDEAL), scales=Scales(), digits=4)
    signed = typed(loop, Law(form=Form.IDEAL, signed=True), scales=Scales(), digits=4)
    assert (plain.gain, plain.reverse) == (2.0, False)
    assert (signed.gain, signed.reverse) == (-2.0, False)
    assert plain.controller == signed.controller == loop


def test_units_of_model_and_system_cancel() -> None:
    """The same loop in seconds and volts is typed as the one in minutes and per cent."""
    law = Law(form=Form.IDEAL, gain=GainEntry.PROPORTIONAL_BAND, filter=FilterEntry.TIME)
    one = typed(Controller(2.0, 10.0, 1.0), law, scales=Scales(gain=4.0, time=60.0), digits=6)
    other = typed(Controller(200.0, 600.0, 60.0), law, scales=Scales(gain=0.04), digits=6)
    assert (one.gain, one.integral, one.derivative, one.filter) == pytest.approx(
        (other.gain, other.integral, other.derivative, other.filter)
    )


def test_a_filter_without_derivative_needs_the_measurement() -> None:
    """PI with a filter has no place in a law that filters its derivative only."""
    loop = Controller(2.0, 10.0, None, 0.5)
    with pytest.raises(InvalidInputError, match="filter the measurement"):
        typed(loop, Law(form=Form.IDEAL), scales=Scales(), digits=4)
    found = typed(
        loop, Law(form=Form.IDEAL, filter=FilterEntry.MEASUREMENT), scales=Scales(), digits=4
    )
    assert found.filter == 0.5
    assert found.controller == loop


def test_the_parallel_law_has_gains() -> None:
    """A proportional band or repeats in the parallel form is refused by name."""
    with pytest.raises(InvalidInputError, match="proportional band"):
        Law(form=Form.PARALLEL, gain=GainEntry.PROPORTIONAL_BAND)
    with pytest.raises(InvalidInputError, match="repeats"):
        Law(form=Form.PARALLEL, integral=IntegralEntry.REPEATS)


def test_known_controllers_are_told_apart_and_sourced() -> None:
    """Names are unique, and each says where its law is published."""
    assert len({known.name for known in KNOWN}) == len(KNOWN) >= 15
    assert all(known.source and known.filter_rule for known in KNOWN)


@pytest.mark.parametrize(
    ("loop", "field"),
    [
        (Controller(1.0, 10.0, 1e-12), "/derivative_time"),
        (Controller(1.0, 1e-12, 1e-12, 1e-12), "/filter_time"),
    ],
)
def test_what_no_request_takes_back_is_refused(loop: Controller, field: str) -> None:
    """Times at the edge of what is permitted, and a filter that cancels the derivative."""
    law = Law(form=Form.IDEAL, filter=FilterEntry.RATIO)
    with pytest.raises(InvalidInputError) as refused:
        typed(loop, law, scales=Scales(time=60.0), digits=3)
    assert refused.value.field == field
