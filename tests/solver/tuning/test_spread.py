"""A spread of parameters: every plant in a box under the same settings."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.tuning.record import Status
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.spread import SPREAD, Spread
from solver.tuning.tuner import tune

SLH = first_order(2, 1.0, 100.0, 0.949)
USUAL = Uncertainty.from_error(0.2, 1)


def task(plant, spread, **options):
    """Tune with this spread."""
    options = {"arrangement": Arrangement.IDENTICAL, "starts": 4, **options}
    return tune(Specification(plant, USUAL, Performance(), spread=spread, **options))


@pytest.mark.parametrize("arrangement", [Arrangement.IDENTICAL, Arrangement.INDEPENDENT])
def test_two_per_cent_of_interaction_are_served(arrangement):
    """a = 0.949: plants drawn from the box keep mu at 1; without the spread they do not."""
    spread = Spread(interaction=0.02)
    plain = task(SLH, None, arrangement=arrangement)
    found = task(SLH, spread, arrangement=arrangement)
    assert found.demand_met
    assert found.active == "spread"
    assert found.tau_p > 1.4 * plain.tau_p
    assert found.guarantee.status == "proven"
    assert found.spread.proof.proven
    assert found.spread.proof.level == pytest.approx(1.0001, abs=2e-5)
    peaks = {}
    for name, result in (("plain", plain), ("found", found)):
        demand = Performance(tau_p=result.tau_p)
        peaks[name] = max(
            proven_peaks(
                first_order(2, 1.0, 100.0, 0.949 * (1 + error)), USUAL, demand, result.loops
            ).peaks.robust_performance.value
            for error in (-0.02, -0.0137, 0.0004, 0.0119, 0.02)
        )
    assert peaks["plain"] > 1.1
    assert peaks["found"] <= 1 + 1e-5


def test_plants_drawn_from_a_box_of_four_parameters_keep_the_demand():
    """No corner, no point of the lattice: still mu <= 1 to the tolerance of the search."""
    plant = first_order(3, 1.0, 50.0, 0.3, 2.0)
    spread = Spread(0.1, 0.2, 0.3, 0.1)
    found = task(plant, spread)
    assert found.demand_met
    assert found.spread.plants > 600
    rng = np.random.default_rng(1)
    for _ in range(8):
        g, t, d, i = 1 + np.array([0.1, 0.2, 0.3, 0.1]) * rng.uniform(-1, 1, 4)
        beside = first_order(3, g, 50.0 * t, 0.3 * i, 2.0 * d)
        axis = proven_peaks(beside, USUAL, Performance(tau_p=found.tau_p), found.loops)
        assert axis.peaks.robust_performance.value <= 1 + 1e-4


def test_a_matrix_plant_spreads_alike():
    """The same plant as a matrix has the same tau_P."""
    rows = [[SLH.element(r, c) for c in range(2)] for r in range(2)]
    spread = Spread(gain=0.05, interaction=0.01)
    there = task(SLH, spread)
    here = task(MatrixPlant(rows), spread)
    assert here.tau_p == pytest.approx(there.tau_p, rel=1e-4)


def test_what_was_cut_short_is_neither_impossible_nor_proven():
    """Whatever the time limit: no "infeasible", and no guarantee without the spread's proof."""
    spread = Spread(gain=0.1, time_constant=0.2, interaction=0.02)
    for limit in (0.02, 0.3, 1.0):
        found = task(SLH, spread, arrangement=Arrangement.INDEPENDENT, time_limit=limit)
        assert found.status in {Status.TIME_LIMIT, Status.OPTIMAL}
        if found.loops:
            sure = found.spread is not None and found.spread.proof.proven
            assert (found.guarantee.status == "proven") == sure
        else:
            assert "time limit" in found.reason


def test_a_wider_box_costs_more():
    """tau_P rises with the deviation; none is the plain task."""
    values = [task(SLH, Spread(gain=width)).tau_p for width in (0.0, 0.05, 0.1)]
    assert values[0] == task(SLH, None).tau_p
    assert all(a < b for a, b in itertools.pairwise(values))


def test_parameters_that_the_plant_has_not_are_left_out():
    """A single unit has no interaction, a plant without dead time none to spread."""
    alone = first_order(1, 1.0, 100.0, 0.0)
    assert Spread(interaction=0.5, dead_time=0.5).axes(alone) == ()
    found = task(alone, Spread(interaction=0.5))
    assert found.tau_p == task(alone, None).tau_p
    assert any("no interaction that could spread" in text for text in found.warnings)


def test_a_box_that_holds_a_singular_plant_is_infeasible():
    """0.949 + 6 per cent passes 1: said to be the spread's fault."""
    found = task(SLH, Spread(interaction=0.06))
    assert found.status is Status.INFEASIBLE
    assert "scenario 'spread'" in found.reason


def test_the_plants_of_scenarios_spread_too():
    """Each scenario has its corners."""
    other = first_order(2, 1.0, 100.0, 0.9)
    plain = task(other, Spread(gain=0.1), scenarios=[Scenario("given", plant=SLH)])
    assert [(each.name, each.sets) for each in plain.scenarios] == [
        ("as given", 1), ("given", 1), ("spread", 4),
    ]  # fmt: skip
    assert plain.tau_p >= task(SLH, Spread(gain=0.1)).tau_p * (1 - 1e-6)


@pytest.mark.parametrize("value", [-0.1, 1.0, float("nan")])
def test_deviations_out_of_range_are_refused(value):
    """By their pointer."""
    with pytest.raises(InvalidInputError) as caught:
        Spread(interaction=value)
    assert caught.value.field == "/interaction"


def test_units_that_deviate_by_themselves_are_served_one_by_one():
    """A unit 10 % weaker beside one 10 % stronger keeps mu at 1; together they ask for less."""
    together = task(SLH, Spread(gain=0.1))
    each = task(SLH, Spread(gain=0.1, each_unit=True), arrangement=Arrangement.INDEPENDENT)
    assert each.demand_met
    assert {name for name, _ in each.spread.worst} == {"gain of unit 1", "gain of unit 2"}
    for weaker, stronger in itertools.permutations((0.9, 1.1)):
        rows = [
            [
                TransferFunction(tuple(c * factor for c in element.num), element.den)
                for factor, element in zip((weaker, stronger), row, strict=True)
            ]
            for row in SLH.rows
        ]
        axis = proven_peaks(MatrixPlant(rows), USUAL, Performance(tau_p=each.tau_p), each.loops)
        assert axis.peaks.robust_performance.value <= 1 + 1e-5
    assert together.spread.worst == (("gain", pytest.approx(-0.1)),)


def test_a_unit_changes_what_its_own_input_acts_on():
    """Its gain is its column; its interaction is the column without its own output."""
    for name, changed in (("gain", {(0, 1), (1, 1)}), ("interaction", {(0, 1)})):
        spread = Spread(each_unit=True, **{name: 0.5})
        other = spread.plant_at(SLH, (0.0, 1.0))
        for row, column in itertools.product(range(2), repeat=2):
            factor = 1.5 if (row, column) in changed else 1.0
            ratio = other.element(row, column).num[-1] / SLH.element(row, column).num[-1]
            assert ratio == pytest.approx(factor)


def test_the_delay_of_a_scan_does_not_spread():
    """Of dead time 2 beside the delay 3/2 of a scan, 30 % are 0.6; without it nothing spreads."""
    late = first_order(2, 1.0, 100.0, 0.9, 2.0)
    seen = Specification(
        late, USUAL, Performance(), spread=Spread(dead_time=0.3), scan_time=1.0
    ).arranged(None)
    plant = seen.spread.plant_at(seen.plant, (1.0,))
    assert plant.process.dead_time == pytest.approx(2.0 * 1.3 + 1.5)
    none = Specification(
        SLH, USUAL, Performance(), spread=Spread(dead_time=0.3), scan_time=1.0
    ).arranged(None)
    assert none.spread.axes(none.plant) == ()


def test_more_parameters_than_can_be_searched_are_refused():
    """Four units of two parameters each are eight axes."""
    with pytest.raises(InvalidInputError) as caught:
        Specification(
            first_order(4, 1.0, 10.0, 0.1), USUAL, Performance(),
            spread=Spread(gain=0.1, time_constant=0.1, each_unit=True),
        )  # fmt: skip
    assert caught.value.field == "/spread/each_unit"


def test_cases_that_mirror_each_other_are_not_mistaken() -> None:
    """Either loop out and a box of two: the other loop's plant in it joins, not its mirror image.

    Identical settings reach 39.9; the unlike ones were lost.
    """
    found = task(
        SLH, Spread(gain=0.05, interaction=0.01), arrangement=Arrangement.INDEPENDENT,
        scenarios=(Scenario("out", any_in_service=(1,)),), scan_time=0.1,
    )  # fmt: skip
    assert found.demand_met
    assert found.tau_p == pytest.approx(30.14, abs=0.05)


def test_a_scenario_is_not_called_like_the_spread() -> None:
    """Else nobody could tell which of them decides."""
    with pytest.raises(InvalidInputError) as caught:
        Specification(SLH, USUAL, Performance(), spread=Spread(0.1), scenarios=(Scenario(SPREAD),))
    assert caught.value.field == "/scenarios/0/name"
