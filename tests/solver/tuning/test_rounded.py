"""Settings among the numbers that a controller accepts, and how far settings may be moved."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.robustness.curves import LoopAnalysis
from solver.robustness.record import GuaranteeStatus
from solver.tuning.attained import attained
from solver.tuning.record import Status
from solver.tuning.resolution import Resolution
from solver.tuning.specification import Bounds, Objective, Specification
from solver.tuning.tuner import tune

PLANT = first_order(2, 1, 100, 0.949)
TASK = Specification(PLANT, Uncertainty.from_error(0.2, 1), Performance())
EXACT = tune(TASK)


@pytest.mark.parametrize("digits", [1, 2, 3])
def test_settings_have_the_digits_and_keep_the_demand_as_they_are(digits: int) -> None:
    """Every setting has so many digits, and mu is proven for exactly these numbers."""
    tuning = tune(replace(TASK, resolution=Resolution(digits=digits)))
    assert tuning.status is Status.OPTIMAL
    for loop in tuning.loops:
        for value in (loop.gain, loop.integral_time):
            assert value is not None
            assert value == float(f"{value:.{digits - 1}e}")
    performance = replace(TASK.performance, tau_p=tuning.tau_p)
    axis = proven_peaks(PLANT, TASK.uncertainty, performance, tuning.loops)
    assert axis.guarantee.status is GuaranteeStatus.PROVEN
    assert axis.peaks.robust_performance.value <= 1 + 1e-7
    assert tuning.resolution is not None
    assert tuning.resolution.tau_p_exact == EXACT.tau_p
    assert tuning.resolution.tau_p_rounded == tuning.tau_p
    assert tuning.tau_p is not None
    assert EXACT.tau_p is not None
    assert tuning.tau_p >= EXACT.tau_p * (1 - 1e-6)


def test_two_digits_are_the_best_two_digits_there_are() -> None:
    """No other numbers of two digits around the optimum attain less, all being tried."""
    tuning = tune(replace(TASK, resolution=Resolution(digits=2)))
    assert tuning.tau_p is not None
    shorter = Performance(tau_p=tuning.tau_p * (1 - 1e-4))
    omega = np.geomspace(1e-4, 1e2, 400)
    around = itertools.product(range(45, 50), (98, 99, 100, 110), range(17, 21), range(21, 28))
    for k1, t1, k2, t2 in around:
        loops = (Controller(k1, t1), Controller(k2, t2 / 10))
        blocks = group_loops(PLANT, loops)
        mu = LoopAnalysis(*blocks, TASK.uncertainty, shorter).robust_performance(omega)
        assert mu.max() > 1, (k1, t1, k2, t2)


def test_where_time_is_over_the_best_so_far_is_rounded() -> None:
    """A search that is stopped with exact settings at hand returns numbers around them."""
    stop = lambda progress: progress.best is not None  # noqa: E731 - a line
    task = replace(TASK, resolution=Resolution(digits=2), starts=40)
    tuning = tune(task, stop)
    assert tuning.status is Status.TIME_LIMIT
    for loop in tuning.loops:
        assert loop.gain == float(f"{loop.gain:.1e}")
    performance = replace(TASK.performance, tau_p=tuning.tau_p)
    axis = proven_peaks(PLANT, TASK.uncertainty, performance, tuning.loops)
    assert axis.peaks.robust_performance.value <= 1 + 1e-7


def test_steps_of_gain_and_time_are_kept() -> None:
    """Gains are multiples of the gain's step, times of the time's, to the last bit."""
    tuning = tune(replace(TASK, resolution=Resolution(gain=0.1, time=0.05)))
    for loop in tuning.loops:
        assert loop.integral_time is not None
        assert Decimal(repr(loop.gain)) % Decimal("0.1") == 0
        assert Decimal(repr(loop.integral_time)) % Decimal("0.05") == 0


def test_settings_that_need_no_rounding_are_tuned_to_the_others() -> None:
    """With steps of 100 for the times alone the gains are the best ones beside such times."""
    tuning = tune(replace(TASK, resolution=Resolution(time=100)))
    assert [loop.integral_time for loop in tuning.loops] == [100, 100]
    fixed = replace(TASK, start=tuning.loops)
    assert tuning.tau_p is not None
    for loop in tuning.loops:
        for factor in (0.99, 1.01):
            moved = tuple(
                replace(each, gain=each.gain * factor) if each is loop else each
                for each in tuning.loops
            )
            beside = attained(fixed, moved)
            assert beside is None or (beside.performance.tau_p or 0) > tuning.tau_p


def test_resolution_coarser_than_what_is_feasible_is_told() -> None:
    """Where no numbers keep the demand the status is infeasible, and exact ones are named."""
    tuning = tune(replace(TASK, resolution=Resolution(gain=50, time=10)))
    assert tuning.status is Status.INFEASIBLE
    assert not tuning.loops
    assert "resolution" in str(tuning.reason)
    assert "18.4455" in str(tuning.reason)


def test_bounds_hold_for_rounded_settings() -> None:
    """Rounding does not leave the bounds that the user gave."""
    task = replace(TASK, bounds=Bounds(gain=(1, 47.3)), resolution=Resolution(digits=2))
    assert max(loop.gain for loop in tune(task).loops) <= 47.3


def test_objective_mu_is_rounded_too() -> None:
    """At a given tau_P the typed numbers have the least peak of mu, no less than exact ones."""
    task = replace(TASK, objective=Objective.MU, performance=Performance(tau_p=25))
    tuning = tune(replace(task, resolution=Resolution(digits=2)))
    assert tuning.resolution is not None
    assert tuning.peaks is not None
    assert tuning.resolution.mu_rounded == tuning.peaks.robust_performance.value
    assert tuning.resolution.mu_exact <= tuning.resolution.mu_rounded * (1 + 1e-6)


def test_negative_gains_are_rounded_by_magnitude() -> None:
    """A plant of the other sign has the same settings with the other sign."""
    mirrored = replace(TASK, plant=first_order(2, -1, 100, 0.949), resolution=Resolution(digits=2))
    usual = tune(replace(TASK, resolution=Resolution(digits=2)))
    assert [-loop.gain for loop in tune(mirrored).loops] == [loop.gain for loop in usual.loops]


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({}, ""),
        ({"digits": 3, "gain": 0.1}, ""),
        ({"digits": 0}, "/digits"),
        ({"digits": 9}, "/digits"),
        ({"gain": 0.0}, "/gain"),
        ({"time": math.inf}, "/time"),
    ],
)
def test_nonsense_is_refused_by_name(given: dict[str, float], field: str) -> None:
    """A resolution is digits or steps, each in its range."""
    with pytest.raises(InvalidInputError) as caught:
        Resolution(**given)  # type: ignore[arg-type]  # on purpose
    assert caught.value.field == field


def test_ranges_end_where_mu_exceeds_the_level() -> None:
    """Inside its range a setting keeps mu at 1 at the longer tau_P; just outside it does not."""
    near = EXACT.settings_tolerance
    assert near is not None
    assert EXACT.tau_p is not None
    assert near.tau_p == pytest.approx(1.05 * EXACT.tau_p)
    performance = Performance(tau_p=near.tau_p)
    for each in near.alone:
        for end, way in ((each.low, -1), (each.high, 1)):
            assert end is not None
            for outside in (False, True):
                value = end * (1 + (5e-3 if outside else -1e-4) * way)
                loops = list(EXACT.loops)
                loops[each.group] = replace(loops[each.group], **{each.parameter: value})
                axis = proven_peaks(PLANT, TASK.uncertainty, performance, loops)
                # A peak between the points of the grid may exceed them by 1e-4.
                slack = 0.0 if outside else 1e-4
                assert (axis.peaks.robust_performance.value > 1 + slack) is outside


def test_joint_move_exceeds_the_level_and_is_no_longer_than_any_single_one() -> None:
    """The joint move of a result exceeds the level when it is a little longer."""
    near = EXACT.settings_tolerance
    assert near is not None
    moves = np.array([1 + each.change for each in near.together])
    length = np.linalg.norm(np.log(moves))
    for each in near.alone:
        for end in (each.low, each.high):
            assert end is not None
            assert length <= abs(math.log(end / each.value)) * (1 + 1e-9)
    loops = [
        Controller(loop.gain * (1 + 3 * k.change), (loop.integral_time or 0) * (1 + 3 * t.change))
        for loop, k, t in zip(EXACT.loops, near.together[::2], near.together[1::2], strict=True)
    ]
    axis = proven_peaks(PLANT, TASK.uncertainty, Performance(tau_p=near.tau_p), loops)
    assert axis.peaks.robust_performance.value > 1


def test_lower_gains_are_not_safer_and_it_is_said() -> None:
    """45, 100, 18, 2.4 in the place of the optimum has mu of 1.037; the result warns."""
    loops = (Controller(45, 100), Controller(18, 2.4))
    axis = proven_peaks(PLANT, TASK.uncertainty, Performance(tau_p=EXACT.tau_p), loops)
    assert axis.peaks.robust_performance.value == pytest.approx(1.037, abs=1e-3)
    assert any("Lower gains are not safer here" in sentence for sentence in EXACT.advice)


def test_lower_gains_that_are_safer_are_not_warned_of() -> None:
    """Where mu is far below 1, lower gains exceed nothing."""
    task = replace(TASK, objective=Objective.MU, performance=Performance(tau_p=200))
    assert not any("Lower gains" in sentence for sentence in tune(task).advice)
