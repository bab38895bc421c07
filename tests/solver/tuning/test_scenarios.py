"""Scenarios: the same settings for further plants and sets of loops in service."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from solver.certificate.verify import verify
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.mu.sdp import upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.axis import proven_peaks
from solver.tuning.demands import Demands
from solver.tuning.record import Status
from solver.tuning.resolution import Resolution
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

USUAL = Uncertainty.from_error(0.2, 1)
FOUR = first_order(4, 1.0, 100.0, 0.6, 1.0)


def task(plant, scenarios, **options):
    """Tune with these scenarios."""
    options = {"arrangement": Arrangement.IDENTICAL, "starts": 4, **options}
    return tune(Specification(plant, USUAL, Performance(), scenarios=scenarios, **options))


def dense_peak(plant, loops, tau_p, units, omega):
    """The peak of mu of the loops of `units` on a grid, by semidefinite programs from numpy's N."""
    G = plant.response(omega)[:, units][:, :, units]
    n = len(units)
    C = np.stack([np.diag([loops[u].response(w)[0] for u in units]) for w in omega])
    S = np.linalg.inv(np.eye(n) + G @ C)
    w_I = USUAL.weight_of(0).response(omega)[:, None, None]
    w_P = Performance(tau_p=tau_p).weight.response(omega)[:, None, None]
    upper = np.concatenate([w_I * C @ S @ G, w_I * C @ S], axis=2)
    N = np.concatenate([upper, np.concatenate([w_P * S @ G, w_P * S], axis=2)], axis=1)
    return upper_bound(N, BlockStructure(tuple(range(n)), n)).mu.max()


def test_any_two_to_four_of_four_are_served_and_proven():
    """One set of settings; every one of the eleven sets keeps mu at 1, by other code too."""
    found = task(FOUR, [Scenario("any", any_in_service=(2, 3, 4))], certificate=True)
    assert found.status is Status.OPTIMAL
    assert found.demand_met
    assert [(each.name, each.sets) for each in found.scenarios] == [("as given", 1), ("any", 3)]
    for each in found.scenarios:
        assert each.guarantee.status == "proven"
        assert each.tau_p <= found.tau_p * (1 + 1e-6)
        assert len(each.certificates) == each.sets
        for certificate in each.certificates:
            assert verify(json.dumps(certificate.to_document())).ok
    omega = np.geomspace(1e-2, 1e1, 12)
    for k in (2, 3, 4):
        for units in itertools.islice(itertools.combinations(range(4), k), 2):
            assert dense_peak(FOUR, found.loops, found.tau_p, list(units), omega) <= 1 + 1e-6


def test_of_plants_that_decide_together_the_first_is_named():
    """Two scenarios with the weakest direction of the task's own plant, to rounding."""
    plant = first_order(2, 1.0, 100.0, 0.7, 3.0)
    matrix = MatrixPlant(plant.rows)
    found = task(plant, [Scenario("again", plant=matrix), Scenario("other", plant=matrix)])
    assert found.active == "as given"


def test_the_harder_plant_decides():
    """Two operating points: tau_P is at least that of the harder one alone, which binds."""
    easy, hard = first_order(2, 1.0, 100.0, 0.5, 1.0), first_order(2, 1.0, 100.0, 0.7, 3.0)
    alone = task(hard, [])
    both = task(easy, [Scenario("hard", plant=hard)])
    assert both.active == "hard"
    assert both.tau_p >= alone.tau_p * (1 - 1e-6)
    assert both.scenarios[1].tau_p == pytest.approx(both.tau_p, rel=1e-6)
    assert both.scenarios[0].tau_p < both.tau_p
    swapped = task(hard, [Scenario("easy", plant=easy)])
    assert swapped.tau_p == pytest.approx(both.tau_p, rel=1e-5)


def test_two_plants_that_pull_apart_cost_more_than_either():
    """Gains of 1 and 2: what serves both is slower than what serves the worse one."""
    low, high = first_order(2, 1.0, 100.0, 0.8), first_order(2, 2.0, 100.0, 0.8)
    best = max(task(plant, []).tau_p for plant in (low, high))
    assert task(low, [Scenario("high", plant=high)]).tau_p > 1.05 * best


def test_a_scenario_that_is_the_task_again_changes_nothing():
    """Duplicates are one case: the digits stay."""
    plain = task(FOUR, [])
    twice = task(FOUR, [Scenario("again"), Scenario("and again", plant=FOUR)])
    assert twice.tau_p == plain.tau_p
    assert twice.loops == plain.loops
    assert [each.peaks for each in twice.scenarios] == [plain.peaks] * 3


def test_named_units_stay_where_they_are():
    """With unit 1 out of service at times the units are no longer interchangeable."""
    plant = first_order(2, 1.0, 100.0, 0.949)
    scenarios = [Scenario("unit 2 out", in_service=(0,))]
    specification = Specification(plant, USUAL, Performance(), scenarios=scenarios)
    assert not specification.interchangeable
    found = task(plant, scenarios, arrangement=Arrangement.INDEPENDENT)
    mirrored = task(
        plant, [Scenario("unit 1 out", in_service=(1,))], arrangement=Arrangement.INDEPENDENT
    )
    assert found.tau_p == pytest.approx(mirrored.tau_p, rel=1e-4)


def test_unlike_units_are_a_matrix_scenario():
    """A scenario may be a matrix plant: one unit is worn."""
    elements = [[FOUR.element(r, c) for c in range(4)] for r in range(4)]
    worn = [
        [TransferFunction([1.3 * k for k in e.num], e.den, e.dead_time) if c == 0 else e
         for c, e in enumerate(row)]
        for row in elements
    ]  # fmt: skip
    found = task(FOUR, [Scenario("worn", plant=MatrixPlant(worn))])
    assert found.demand_met
    assert found.scenarios[1].peaks.robust_performance.value <= 1 + 1e-7


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_of_time_do_not_matter(unit):
    """All times in another unit: tau_P in that unit."""

    def run(scale):
        plants = [first_order(3, 1.0, 50.0 * scale, a, 1.0 * scale) for a in (0.4, 0.5)]
        return tune(
            Specification(
                plants[0], Uncertainty.from_error(0.2, scale), Performance(),
                scenarios=[Scenario("b", plant=plants[1], any_in_service=(2, 3))],
                arrangement=Arrangement.IDENTICAL, starts=4,
            )
        ).tau_p  # fmt: skip

    assert run(unit) / unit == pytest.approx(run(1.0), rel=1e-5)


def test_three_hundred_units_with_any_number_in_service():
    """299 sets by number: few are kept in sight by the search, all are looked at in the end."""
    plant = first_order(300, 1.0, 100.0, 0.002, 1.0)
    found = task(plant, [Scenario("any", any_in_service=tuple(range(200, 301)))], starts=2)
    assert found.demand_met
    assert found.scenarios[1].sets == 101


def test_demands_hold_on_every_plant():
    """The sensitivity of loops alone is limited on the plants of scenarios too."""
    low, high = first_order(2, 1.0, 100.0, 0.5, 1.0), first_order(2, 1.3, 100.0, 0.5, 2.0)
    demands = Demands(max_sensitivity_alone=1.3)
    found = task(low, [Scenario("high", plant=high)], demands=demands)
    (outcome,) = found.demands
    assert outcome.met
    c = found.loops[0]
    omega = np.geomspace(1e-3, 1e1, 4000)
    for plant in (low, high):
        S = 1 / (1 + plant.element(0, 0).response(omega) * c.response(omega))
        assert np.abs(S).max() <= outcome.value * (1 + 1e-6)


def test_a_plant_that_no_settings_serve_is_named():
    """A singular plant among the scenarios makes the task infeasible, by name."""
    found = task(FOUR, [Scenario("singular", plant=first_order(4, 1.0, 100.0, 1.0))])
    assert found.status is Status.INFEASIBLE
    assert "scenario 'singular'" in found.reason


@pytest.mark.parametrize(
    ("scenarios", "field"),
    [
        ([Scenario("a"), Scenario("a")], "/scenarios/1/name"),
        ([Scenario("a", plant=first_order(3, 1, 1, 0.1))], "/scenarios/0/plant"),
        ([Scenario("a", in_service=(0, 4))], "/scenarios/0/in_service"),
        ([Scenario("a", any_in_service=(5,))], "/scenarios/0/in_service"),
        (
            [Scenario("a", uncertainty=Uncertainty.from_error([0.1, 0.2], 1))],
            "/scenarios/0/uncertainty",
        ),
    ],
)
def test_scenarios_that_do_not_fit_are_refused(scenarios, field):
    """The pointer names the scenario and what is wrong with it."""
    with pytest.raises(InvalidInputError) as caught:
        Specification(FOUR, USUAL, Performance(), scenarios=scenarios)
    assert caught.value.field == field


def test_what_a_scenario_cannot_be_is_refused():
    """No loop, a loop twice, both ways to name them, the reserved name."""
    for fault in ({"in_service": ()}, {"in_service": (0, 0)}, {"any_in_service": ()},
                  {"in_service": (0,), "any_in_service": (1,)}):  # fmt: skip
        with pytest.raises(InvalidInputError) as caught:
            Scenario("a", **fault)
        assert caught.value.field == "/in_service"
    with pytest.raises(InvalidInputError, match="take another name"):
        replace(Scenario("a"), name="as given")


def test_too_many_cases_are_refused():
    """Independent settings of ten units have 1023 sets; they are not cut off silently."""
    plant = first_order(10, 1.0, 100.0, 0.01)
    scenarios = [Scenario("any", any_in_service=tuple(range(1, 11)))]
    with pytest.raises(InvalidInputError, match="more than 300 different cases"):
        task(plant, scenarios, arrangement=Arrangement.INDEPENDENT)


def test_typed_settings_and_those_of_today_serve_every_scenario():
    """Two digits keep the demand with either loop out of service; today's settings do not."""
    plant = first_order(2, 1.0, 100.0, 0.949)
    today = (Controller(46.3, 101.0), Controller(22.8, 3.15))
    scenarios = [Scenario("1 out", in_service=(1,)), Scenario("2 out", in_service=(0,))]
    found = tune(
        Specification(
            plant, USUAL, Performance(), scenarios=scenarios, resolution=Resolution(digits=2),
            as_found=today,
        )
    )  # fmt: skip
    assert found.demand_met
    assert found.resolution.tau_p_rounded == found.tau_p > found.resolution.tau_p_exact
    demand = Performance(tau_p=found.tau_p)
    for units in ((0, 1), (0,), (1,)):
        loops = [found.loops[unit] for unit in units]
        assert all(loop.gain == float(f"{loop.gain:.1e}") for loop in loops)
        axis = proven_peaks(plant.part(units), USUAL, demand, loops)
        assert axis.peaks.robust_performance.value <= 1 + 1e-6
    assert found.as_found.tau_p is None
    assert found.as_found.active == "1 out"
    alone = tune(Specification(plant, USUAL, Performance(), as_found=today, starts=4)).as_found
    assert alone.tau_p == pytest.approx(19.0109, rel=1e-5)
    assert alone.active is None
    assert found.settings_tolerance is not None
