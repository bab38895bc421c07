"""What given settings attain, and today's settings in a result."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.robustness.record import GuaranteeStatus
from solver.tuning.attained import attained
from solver.tuning.specification import Specification
from solver.tuning.tuner import tune

PLANT = first_order(2, 1, 100, 0.949)
TASK = Specification(PLANT, Uncertainty.from_error(0.2, 1), Performance())
# Skogestad, Lundstrom and Hovd (1989), table 2: tau_P about 19, with mu of 1.0003 there.
PUBLISHED = (Controller(46.3, 101), Controller(22.8, 3.15))


def test_least_time_constant_is_where_the_peak_is_one() -> None:
    """At the least tau_P the proven peak is 1, a little below it is above 1."""
    found = attained(TASK, PUBLISHED)
    assert found is not None
    assert found.performance.tau_p == pytest.approx(19.0109, abs=1e-3)
    assert found.guarantee.status is GuaranteeStatus.PROVEN
    assert found.peaks.robust_performance.value == pytest.approx(1, abs=1e-7)
    shorter = Performance(tau_p=0.999 * (found.performance.tau_p or 0))
    axis = proven_peaks(PLANT, TASK.uncertainty, shorter, PUBLISHED)
    assert axis.peaks.robust_performance.value > 1


def test_tuned_settings_attain_what_the_tuning_says() -> None:
    """The settings of a tuning attain its tau_P."""
    tuning = tune(TASK)
    found = attained(TASK, tuning.loops)
    assert found is not None
    assert found.performance.tau_p == pytest.approx(tuning.tau_p, rel=1e-6)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_unit_of_time_changes_nothing_but_times(unit: float) -> None:
    """In another unit of time the least tau_P is the same time."""
    plant = first_order(2, 1, 100 * unit, 0.949)
    task = Specification(plant, Uncertainty.from_error(0.2, unit), Performance())
    loops = [replace(each, integral_time=each.integral_time * unit) for each in PUBLISHED]  # type: ignore[operator]  # PI
    here, there = attained(TASK, PUBLISHED), attained(task, loops)
    assert here is not None
    assert there is not None
    assert here.performance.tau_p is not None
    assert there.performance.tau_p == pytest.approx(here.performance.tau_p * unit, rel=1e-6)


def test_unstable_loops_attain_nothing() -> None:
    """Loops that are unstable have no time constant."""
    plant = first_order(2, 1, 100, 0.949, 1.0)
    assert attained(replace(TASK, plant=plant), [Controller(1e4, 1.0)] * 2) is None


def test_today_is_judged_as_what_was_found() -> None:
    """A result tells tau_P, peaks and margins of today's settings, and advises."""
    tuning = tune(replace(TASK, as_found=PUBLISHED))
    today = tuning.as_found
    assert today is not None
    assert today.tau_p == pytest.approx(19.0109, abs=1e-3)
    assert today.peaks is not None
    assert today.peaks.robust_performance.value > 1
    assert len(today.margins) == 2
    assert any("Today's settings keep the demand from tau_P = 19.0" in a for a in tuning.advice)
    assert tuning.tau_p == tune(TASK).tau_p


def test_today_with_a_peak_above_one_whatever_the_demand_has_no_time_constant() -> None:
    """The published identical settings, rounded, exceed 1 at any tau_P: the reason says where."""
    tuning = tune(replace(TASK, as_found=(Controller(39.7, 65.1),) * 2))
    assert tuning.as_found is not None
    assert tuning.as_found.tau_p is None
    assert "mu = 1.0008" in str(tuning.as_found.reason)


def test_today_is_told_where_nothing_was_found() -> None:
    """An infeasible task still tells what today's settings do."""
    singular = replace(TASK, plant=first_order(2, 1, 100, 1.0), as_found=PUBLISHED)
    tuning = tune(singular)
    assert not tuning.loops
    assert tuning.as_found is not None
    assert not tuning.as_found.nominally_stable


def test_today_may_be_proportional() -> None:
    """P control leaves an offset where none is permitted: no tau_P, and the reason."""
    tuning = tune(replace(TASK, as_found=(Controller(10, None),) * 2))
    assert tuning.as_found is not None
    assert tuning.as_found.nominally_stable
    assert tuning.as_found.tau_p is None
    assert "offset" in str(tuning.as_found.reason)


def test_permuted_outputs_of_a_matrix_plant_change_nothing() -> None:
    """Numbering the loops otherwise does not change what settings attain."""
    elements = [
        [TransferFunction([2], [10, 1], 1), TransferFunction([0.5], [20, 1])],
        [TransferFunction([-0.4], [15, 1], 2), TransferFunction([1], [5, 1], 0.5)],
    ]
    loops = (Controller(1.0, 10.0), Controller(2.0, 5.0))
    values = []
    for order in itertools.permutations(range(2)):
        plant = MatrixPlant([[elements[r][c] for c in order] for r in order])
        found = attained(replace(TASK, plant=plant), [loops[unit] for unit in order])
        assert found is not None
        values.append(found.performance.tau_p)
    np.testing.assert_allclose(values[0], values[1], rtol=1e-9)


def test_wrong_number_of_loops_as_found_is_refused_by_name() -> None:
    """One loop for two units is no description of today."""
    with pytest.raises(InvalidInputError) as caught:
        replace(TASK, as_found=PUBLISHED[:1])
    assert caught.value.field == "/as_found"
