"""A record with holes goes on after each with a start of its own."""

import numpy as np
from drawn import Lag, record

from solver.identification.identify import identify
from solver.identification.record import Record
from solver.identification.selection import Allowed
from solver.identification.stretches import holes, stretches

HOLE = slice(250, 330)
CLEAN = record([[Lag(2.0, 15.0, 0.0, 3.0)]], np.random.default_rng(7), noise=0.02)


def without(rows):
    """Return the record without some samples."""
    kept = np.delete(np.arange(CLEAN.time.size), np.r_[rows])
    return Record(CLEAN.time[kept], {"u0": CLEAN.inputs["u0"][kept]},
                  {"y0": CLEAN.outputs["y0"][kept]}, "a")  # fmt: skip


def test_moves_in_a_hole_are_not_made_up():
    """The input moved where nothing was written: the plant is found, and it is told."""
    cut = without(HOLE)
    assert CLEAN.inputs["u0"][HOLE].std() > 0
    found = identify([cut], allowed=Allowed(1))
    element = found.elements[0].element
    assert abs(element.gains[0] / 2 - 1) < 0.02
    assert abs(element.dead_time - 3) < 0.3
    assert {one.record for one in found.predictions} == {"a, part 1 of 2", "a, part 2 of 2"}
    assert min(one.normalised_fit for one in found.predictions) > 90
    assert "no samples of a from 249 to 330" in found.advice[0]


def test_lost_readings_of_every_signal_are_a_hole_too():
    """Whether rows are missing or empty, the same stretches are fitted."""
    empty = {key: values.copy() for key, values in {**CLEAN.inputs, **CLEAN.outputs}.items()}
    for values in empty.values():
        values[HOLE] = np.nan
    lost = Record.with_gaps(CLEAN.time, {"u0": empty["u0"]}, {"y0": empty["y0"]}, "a")
    for one, other in zip(stretches([lost]), stretches([without(HOLE)]), strict=True):
        assert np.array_equal(one.time, other.time)
        assert np.array_equal(one.outputs["y0"], other.outputs["y0"])


def test_what_is_written_when_it_changes_has_no_holes():
    """Samples far apart are no holes where they never came regularly, or a few only are missing."""
    logged = np.flatnonzero(np.random.default_rng(1).random(600) < 0.2)
    assert holes(without(np.setdiff1d(np.arange(600), logged))).size == 0
    assert holes(without(slice(250, 254))).size == 0
    rare = np.full(600, np.nan)
    rare[::20] = CLEAN.inputs["u0"][::20]
    held = Record.with_gaps(CLEAN.time, {"u0": rare}, {"y0": CLEAN.outputs["y0"]})
    assert held.time.size == 600


def test_a_part_with_too_few_readings_is_left_out():
    """Ten samples between two holes tell nothing; a record of nothing else stays whole."""
    first, second = stretches([without(np.r_[250:330, 340:400])])
    assert (first.time[-1], second.time[0]) == (249, 400)
    scraps = without(np.setdiff1d(np.arange(600), np.r_[0:15, 100:115, 200:215]))
    assert stretches([scraps]) == [scraps]
