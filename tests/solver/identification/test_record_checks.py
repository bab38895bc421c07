"""Records that are refused, and how gaps are read."""

import math

import numpy as np
import pytest

from solver.identification.identify import identify
from solver.identification.problem import PlantStructure
from solver.identification.record import Record
from solver.identification.selection import Allowed
from solver.model.errors import InvalidInputError

TIME = np.arange(30.0)
STEP = np.where(TIME < 5, 0.0, 1.0)
WAVE = np.sin(TIME)


@pytest.mark.parametrize(
    ("time", "inputs", "outputs", "field", "words"),
    [
        (TIME[:10], {"u": STEP[:10]}, {"y": WAVE[:10]}, "/time", "20.."),
        (np.r_[TIME[:9], TIME[8:-1]], {"u": STEP}, {"y": WAVE}, "/time/9", "stands still"),
        (np.r_[TIME[:9], TIME[5:26]], {"u": STEP}, {"y": WAVE}, "/time/9", "backwards"),
        (np.r_[math.nan, TIME[1:]], {"u": STEP}, {"y": WAVE}, "/time/0", "finite"),
        (TIME, {"u": np.r_[STEP[:-1], math.nan]}, {"y": WAVE}, "/inputs/u/29", "gaps"),
        (TIME, {"u": STEP}, {"y": np.r_[math.inf, WAVE[1:]]}, "/outputs/y/0", "finite"),
        (TIME, {"u": STEP}, {"u": WAVE}, "/outputs/u", "an input and an output"),
        (TIME, {"u": STEP[:-1]}, {"y": WAVE}, "/inputs/u", "29 values"),
        (TIME, {}, {"y": WAVE}, "/inputs", "1.."),
        (TIME, {"u": STEP}, {"y": ["a"] * 30}, "/outputs/y", "numbers"),
        (TIME, {str(i): STEP for i in range(301)}, {"y": WAVE}, "/inputs", "300"),
    ],
)
def test_bad_records_are_refused(time, inputs, outputs, field, words):
    """The message names the value and says what would do."""
    with pytest.raises(InvalidInputError, match=words.replace(".", r"\.")) as caught:
        Record(time, inputs, outputs)
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("inputs", "field", "words"),
    [
        ({"a": STEP, "b": 0 * STEP}, "/records/0/inputs/b", "constant"),
        ({"a": STEP, "b": 3 * STEP + 1}, "/records/0/inputs/a", "together"),
    ],
)
def test_inputs_that_tell_nothing_are_refused(inputs, field, words):
    """An input at rest, and inputs that always move together."""
    with pytest.raises(InvalidInputError, match=words) as caught:
        identify([Record(TIME, inputs, {"c": WAVE, "d": WAVE})])
    assert caught.value.field == field


def test_constant_outputs_and_oblong_plants_are_refused():
    """A constant output is a wrong column; the plant must be square."""
    with pytest.raises(InvalidInputError, match="right column"):
        identify([Record(TIME, {"a": STEP}, {"c": 0 * TIME + 3})])
    with pytest.raises(InvalidInputError, match="square"):
        identify([Record(TIME, {"a": STEP}, {"c": WAVE, "d": WAVE})])


def test_output_that_rests_in_one_record_is_no_fault():
    """Another record moves it; where it rests there is nothing to explain, and no NaN."""
    still = np.zeros(TIME.size)
    rest = Record(TIME, {"a": STEP, "b": still}, {"c": WAVE, "d": still + 3}, "rest")
    moved = Record(TIME, {"a": still, "b": STEP}, {"c": still, "d": WAVE}, "moved")
    found = identify([rest, moved], allowed=Allowed(1, integrating=False), validation=[rest])
    told = [(p.record, p.output) for p in found.predictions]
    assert told == [("rest", "c"), ("moved", "d"), ("rest", "c")]
    assert np.isfinite([p.normalised_fit for p in found.predictions]).all()


def test_records_must_have_the_same_signals():
    """In the same order: nobody guesses which column is which."""
    one = Record(TIME, {"a": STEP}, {"c": WAVE}, "first")
    other = Record(TIME, {"x": STEP}, {"c": WAVE}, "second")
    with pytest.raises(InvalidInputError, match="second has the inputs x") as caught:
        identify([one, other], structure=PlantStructure.PARALLEL)
    assert caught.value.field == "/records/1/inputs"


def test_gaps_hold_inputs_and_leave_outputs_out():
    """NaN is a reading that was not made."""
    u = STEP.copy()
    u[[7, 8]] = math.nan
    y = WAVE.copy()
    y[3] = math.nan
    record = Record.with_gaps(TIME, {"u": u}, {"y": y})
    assert record.inputs["u"][8] == u[6]
    assert list(np.flatnonzero(~record.observed[0])) == [3]
    with pytest.raises(InvalidInputError, match="first reading"):
        Record.with_gaps(TIME, {"u": np.r_[math.nan, STEP[1:]]}, {"y": y})
