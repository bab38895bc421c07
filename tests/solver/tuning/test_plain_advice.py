"""Sentences made from the numbers of a result."""

from __future__ import annotations

from dataclasses import replace

import pytest

from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.tuning.plain_advice import plain_advice
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.spread import Spread
from solver.tuning.tuner import tune

TASK = Specification(first_order(2, 1, 100, 0.949), Uncertainty.from_error(0.2, 1), Performance())


def said(task: Specification, words: str) -> list[str]:
    """Return the sentences of a result that hold these words."""
    return [sentence for sentence in tune(task).advice if words in sentence]


def test_loop_that_overshoots_alone_is_named() -> None:
    """The optimum's second loop, in service alone, overshoots by some 40 per cent (SLH fig. 6)."""
    (sentence,) = said(TASK, "in manual")
    assert sentence.startswith("With loop 1 in manual put loop 2 in manual too")
    percent = int(sentence.rsplit(" by ", 1)[1].removesuffix(" %."))
    assert percent == pytest.approx(40, abs=2)


def test_calm_loops_are_not_named() -> None:
    """Identical settings of the same plant overshoot little alone."""
    assert not said(replace(TASK, arrangement=Arrangement.IDENTICAL), "in manual")


def test_identical_settings_suffice_where_unlike_ones_gain_nothing() -> None:
    """Three units with a positive interaction gain nothing from unlike settings."""
    assert said(replace(TASK, plant=first_order(3, 1, 100, 0.8)), "Identical settings suffice")
    assert not said(TASK, "Identical settings suffice")


def test_times_in_two_units_are_doubted() -> None:
    """Seconds of the plant beside minutes of the errors, and hours beside seconds, are told."""
    for tau, theta, told in ((6000, 1, True), (100, 1, False), (0.01, 1, True), (10, 1, False)):
        task = Specification(
            first_order(2, 1, tau, 0.5), Uncertainty.from_error(0.2, theta), Performance(),
            arrangement=Arrangement.IDENTICAL,
        )  # fmt: skip
        words = [each for each in tune(task).warnings if "same unit" in each]
        assert bool(words) is told


def test_unit_that_limits_is_the_slow_one() -> None:
    """Of two units that hardly interact the one with the long dead time limits tau_P."""
    rows = [
        [TransferFunction([1], [10, 1], 1), TransferFunction([0.01], [10, 1])],
        [TransferFunction([0.01], [10, 1]), TransferFunction([1], [10, 1], 8)],
    ]
    task = replace(TASK, plant=MatrixPlant(rows), starts=2)
    found = tune(task)
    (sentence,) = [each for each in found.advice if "is limited by" in each]
    assert "loop 2 at" in sentence
    (case,) = task.cases(((0,), (1,)))
    assert "tau_P is limited by loop 2 at rest." in plain_advice(task, found, case, 1e-12)


def test_advice_is_that_of_the_scenario_that_decides() -> None:
    """Where a spread decides, mu of the plant as given leaves no room for larger weights."""
    task = replace(TASK, spread=Spread(interaction=0.02), starts=6)
    found = tune(task)
    assert found.active == "spread"
    assert found.peaks is not None
    assert found.peaks.robust_performance.value < 0.999
    assert not any("may grow" in sentence for sentence in found.advice)
    worse = Scenario("out", in_service=(0,), uncertainty=Uncertainty.from_error(0.4, 5))
    task = replace(TASK, plant=first_order(2, 1, 100, 0.2), scenarios=(worse,), starts=6)
    (sentence,) = said(task, "is limited by")
    assert "loop 1 at" in sentence
    assert sentence.endswith("in scenario 'out'.")


def test_no_unit_is_named_where_all_are_alike() -> None:
    """Identical loops of identical units have no weakest unit."""
    task = replace(TASK, plant=first_order(3, 1, 100, 0.8), arrangement=Arrangement.IDENTICAL)
    assert not said(task, "is limited by")


def test_one_unit_and_many_units_have_advice_too() -> None:
    """One unit, and 300 identical ones, end without an error and without nonsense."""
    for n, a in ((1, 0.0), (300, 0.5)):
        task = replace(TASK, plant=first_order(n, 1, 100, a), arrangement=Arrangement.IDENTICAL)
        assert not said(task, "is limited by")


def test_integral_action_that_the_demand_does_not_need_is_named() -> None:
    """An integrating process, and a permitted offset: without it mu is no higher; else silence."""
    integrator = ParallelPlant(
        1, TransferFunction((1.0,), (1.0, 0.0), 1.0), TransferFunction((0.0,), (1.0,))
    )
    uncertainty = Uncertainty.from_error(0.2, 1)
    found = tune(Specification(integrator, uncertainty, Performance(), starts=4))
    assert any("Integral action is not needed" in each for each in found.advice)
    assert found.tau_p is not None
    without = [replace(loop, integral_time=None) for loop in found.loops]
    axis = proven_peaks(integrator, uncertainty, Performance(tau_p=found.tau_p), without)
    assert axis.peaks.robust_performance.value <= 1 + 1e-4
    offset = replace(TASK, performance=Performance(offset=0.3), starts=4)
    assert any("Integral action in loop" in each for each in tune(offset).advice)
    assert not any("Integral action" in each for each in tune(replace(TASK, starts=4)).advice)
