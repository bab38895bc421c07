"""Integrity as a demand: every set of loops in service is stable, or robustly stable."""

from __future__ import annotations

import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.integrity import service_classes
from solver.tuning.demands import Demands
from solver.tuning.record import Status
from solver.tuning.scenarios import Scenario, cases_of
from solver.tuning.service_sets import ServiceSets, integrity_value
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

USUAL = Uncertainty.from_error(0.2, 1)
MILD = Uncertainty.from_error(0.1, 0.5)
# Drawn at random: its loops are stable together and, with these signs of the gains, never in pairs.
HELPLESS = MatrixPlant(
    [
        [TransferFunction((k,), (lag, 1.0), delay) for k, lag, delay in row]
        for row in (
            ((1.0, 12.7, 1.5), (1.14, 17.6, 1.0), (-1.67, 17.3, 0.9)),
            ((1.08, 5.4, 0.5), (1.0, 5.8, 0.9), (1.12, 11.2, 0.8)),
            ((1.2, 5.3, 0.7), (-1.64, 5.2, 0.4), (1.0, 14.5, 0.5)),
        )
    ]
)


@pytest.mark.parametrize("integrity", ["stable", "robustly_stable"])
def test_integrity_that_is_there_already_costs_nothing(integrity):
    """The seed case: its best settings stay, and the outcome has the value of the worst set."""
    plant = first_order(2, 1.0, 100.0, 0.949)
    plain = tune(Specification(plant, USUAL, Performance(), starts=6))
    found = tune(
        Specification(plant, USUAL, Performance(), starts=6, demands=Demands(integrity=integrity))
    )
    assert found.tau_p == pytest.approx(plain.tau_p, rel=1e-6)
    (outcome,) = found.demands
    assert outcome.met
    demand = Performance(tau_p=found.tau_p)
    classes = service_classes(plant, USUAL, demand, found.loops)
    worst = max(each.robust_stability.value for each in classes)
    expected = worst if integrity == "robustly_stable" else 0.0
    assert outcome.value == pytest.approx(expected, rel=1e-5)


def test_where_no_settings_have_it_the_demand_is_named():
    """Loops that are stable together only: infeasible, and what there is without is told."""
    plain = tune(Specification(HELPLESS, MILD, Performance(), starts=3))
    assert plain.status is Status.OPTIMAL
    assert integrity_value(HELPLESS, MILD, plain.loops, robust=False) > 0
    assert integrity_value(HELPLESS, MILD, plain.loops, robust=True) == np.inf
    demands = Demands(integrity="stable")
    found = tune(Specification(HELPLESS, MILD, Performance(), starts=3, demands=demands))
    assert found.status is Status.INFEASIBLE
    assert "integrity" in found.reason
    assert "tau_p = " in found.reason


def test_gradients_of_the_sets_agree_with_differences():
    """Rows of robust stability answer to the settings as their gradients say."""
    plant = first_order(3, 1.0, 50.0, -0.3, 1.0)
    groups = ((0, 1), (2,))
    every = [Scenario("every", any_in_service=(1, 2, 3))]
    sets = ServiceSets.of(cases_of(every, plant, USUAL, Performance(), groups), robust=True)
    theta, signs = np.log([6.0, 30.0, 9.0, 20.0]), np.ones(2)
    _, gradient, stable = sets.levels(theta, signs, lead=False)
    assert stable
    assert len(sets.sets) == 5
    for index in range(theta.size):
        step = np.zeros_like(theta)
        step[index] = 1e-5
        up, down = (sets.levels(theta + s * step, signs, lead=False)[0] for s in (1, -1))
        slope = (up - down) / 2e-5
        # Where two scales meet the level bends.
        close = np.isclose(slope, gradient[:, index], rtol=1e-3, atol=1e-3)
        assert close.mean() > 0.97


def test_three_hundred_identical_units_have_it_by_number():
    """Sets of 1 to 300 loops in service: a few in sight of the search, all looked at in the end."""
    plant = first_order(300, 1.0, 100.0, 0.002, 1.0)
    found = tune(
        Specification(
            plant, USUAL, Performance(), arrangement=Arrangement.IDENTICAL, starts=2,
            demands=Demands(integrity="robustly_stable"),
        )
    )  # fmt: skip
    assert found.demands[0].met
    assert found.demands[0].value < 1


def test_unknown_integrity_is_refused():
    """By its pointer."""
    with pytest.raises(InvalidInputError) as caught:
        Demands(integrity="always")
    assert caught.value.field == "/integrity"
