"""Tasks that no search serves are refused at once, by the field that is at fault."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from service.schemas import parse_tuning_request
from solver.model.errors import InvalidInputError
from solver.model.measured import MeasuredPlant
from solver.model.neighbours import NeighbourPlant
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.tuning import tuner
from solver.tuning.admission import fits, require_tunable
from solver.tuning.demands import Demands, IntegrityDemand
from solver.tuning.feasibility import needs_usual_signs
from solver.tuning.groupings import consecutive
from solver.tuning.pairings import pairings
from solver.tuning.record import Status
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Arrangement, Signs, Specification

LAG = {"num": [1.0], "den": [10.0, 1.0], "dead_time": 1.0}
NEAR = {"num": [0.1], "den": [10.0, 1.0], "dead_time": 1.0}
RING: dict[str, Any] = {"kind": "circulant", "n": 30, "process": LAG, "ahead": [NEAR]}
PAIR = {"kind": "matrix", "elements": [[LAG, NEAR], [NEAR, LAG]]}
POINTS = {"re": [1.0, 0.5, 0.01], "im": [-0.1, -0.5, -0.1]}
DATA = {
    "kind": "frequency_response", "omega": [0.001, 0.1, 10.0], "elements": [[POINTS]],
    "unstable_poles": 0,
}  # fmt: skip
ONE = {"kind": "matrix", "elements": [[LAG]]}
IDENTICAL = {"controller": {"arrangement": "identical"}}
MILD = Uncertainty.from_error(0.1, 0.5)


@pytest.mark.parametrize(
    ("plant", "more", "field"),
    [
        (RING, {}, "/controller/arrangement"),
        (RING, {**IDENTICAL, "pairing": "best"}, "/pairing"),
        (RING, {**IDENTICAL, "demands": {"integrity": "stable"}}, "/demands/integrity"),
        (
            RING,
            {**IDENTICAL, "scenarios": [{"name": "a", "in_service": {"any": 29}}]},
            "/scenarios/0/in_service",
        ),
        (
            RING,
            {**IDENTICAL, "uncertainty": {"epsilon": [0.1] * 29 + [0.2], "theta": 1.0}},
            "/uncertainty",
        ),
        (
            RING,
            {**IDENTICAL, "uncertainty": {"epsilon": 0.1, "theta": 1.0, "structure": "full"}},
            "/uncertainty/structure",
        ),
        (
            RING,
            {**IDENTICAL, "performance": {"output_scale": [1.0] * 29 + [2.0]}},
            "/performance/output_scale",
        ),
        (
            {**RING, "kind": "banded"},
            {"controller": {"arrangement": "grouped", "groups": [[0], list(range(1, 30))]}},
            "/controller/groups",
        ),
        (PAIR, {"controller": {"scan_time": 1e12}}, "/controller/scan_time"),
        (ONE, {"scenarios": [{"name": "a", "plant": DATA}]}, "/scenarios/0/plant"),
        (DATA, {"scenarios": [{"name": "a", "plant": ONE}]}, "/scenarios/0/plant"),
        (DATA, {"pairing": "best"}, "/pairing"),
        (DATA, {"search": {"optimality_gap": True}}, "/search/optimality_gap"),
        (DATA, {"controller": {"signs": "any"}}, "/controller/signs"),
        ({**DATA, "unstable_poles": None}, {}, "/plant/unstable_poles"),
        (
            DATA,
            {"scenarios": [{"name": "a", "plant": {**DATA, "unstable_poles": 1}}]},
            "/scenarios/0/plant/unstable_poles",
        ),
    ],
)
def test_a_request_is_refused_before_it_is_a_job(
    plant: dict[str, Any], more: dict[str, Any], field: str
) -> None:
    """What the search would refuse is told where the request is read."""
    body = {"plant": plant, "uncertainty": {"epsilon": 0.1, "theta": 1.0}, **more}
    request = parse_tuning_request(json.dumps(body))
    with pytest.raises(InvalidInputError) as caught:
        request.build()
    assert caught.value.field == field


def test_more_sets_than_are_looked_through_are_refused() -> None:
    """Any 10 of 40 in a ring are 10^9 sets: none of them may be left out unsaid."""
    element = TransferFunction((1.0,), (10.0, 1.0), 1.0)
    ring = NeighbourPlant(40, element, ())
    task = Specification(
        ring, MILD, Performance(), arrangement=Arrangement.IDENTICAL,
        scenarios=(Scenario("ten", any_in_service=(10,)),),
    )  # fmt: skip
    with pytest.raises(InvalidInputError) as caught:
        require_tunable(task)
    assert caught.value.field == "/scenarios/0/in_service"


def test_of_groupings_that_are_sought_those_with_too_many_cases_are_left_out() -> None:
    """Two groups of 20 with any number in service are more cases than one group of 40."""
    task = Specification(
        first_order(40, 1.0, 10.0, 0.02, 1.0), MILD, Performance(), arrangement=Arrangement.BEST,
        scenarios=(Scenario("some", any_in_service=tuple(range(2, 40))),),
    )  # fmt: skip
    require_tunable(task)
    assert fits(task, consecutive((40,)))
    assert not fits(task, consecutive((20, 20)))


def test_a_pairing_in_which_groups_cannot_share_a_gain_is_left_out() -> None:
    """Both pairings may have integral action; in one the loops have gains of opposite signs."""
    elements = [[(0.3, 10.0), (-2.0, 12.0)], [(1.5, 8.0), (0.2, 10.0)]]
    plant = MatrixPlant(
        [[TransferFunction((k,), (lag, 1.0)) for k, lag in row] for row in elements]
    )
    task = Specification(plant, MILD, Performance(), pairing="best")
    assert set(pairings(task)) == {(0, 1), (1, 0)}
    grouped = Specification(
        plant, MILD, Performance(), pairing="best", arrangement=Arrangement.GROUPED,
        groups=((0, 1),),
    )  # fmt: skip
    assert pairings(grouped) == ((0, 1),)


def test_contrary_signs_are_named() -> None:
    """A scenario whose gains have the other sign, and unlike signs under one gain."""
    plant = first_order(2, 1.0, 10.0, 0.5)
    turned = Scenario("turned", first_order(2, -1.0, 10.0, 0.5))
    found = tuner.tune(Specification(plant, MILD, Performance(), scenarios=(turned,), starts=1))
    assert found.status is Status.INFEASIBLE
    assert "in scenario 'turned' the steady-state gain of loops 1-2 has" in str(found.reason)
    lag, side = TransferFunction((1.0,), (10.0, 1.0)), TransferFunction((0.1,), (10.0, 1.0))
    unlike = MatrixPlant([[lag, side], [side, TransferFunction((-1.0,), (10.0, 1.0))]])
    found = tuner.tune(
        Specification(unlike, MILD, Performance(), arrangement=Arrangement.IDENTICAL, starts=1)
    )
    assert "one gain for loop 2 and loops whose" in str(found.reason)


def test_demands_on_loops_alone_leave_no_other_signs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop alone with the other sign is unstable, unless it acts without lag."""
    monkeypatch.setattr(tuner, "with_the_demands_named", lambda _, found, __: found)
    plant = first_order(3, 1.0, 100.0, -0.6)  # outside of -1/2 < a < 1
    demands = Demands(integrity=IntegrityDemand.STABLE)
    task = Specification(plant, MILD, Performance(), signs=Signs.ANY, demands=demands)
    assert needs_usual_signs(task)
    found = tuner.tune(task)  # no search: it would take seconds
    assert found.status is Status.INFEASIBLE
    assert found.search.starts == 0
    assert "-0.6 lies outside" in str(found.reason)
    lag, side = TransferFunction((1.0,), (10.0, 1.0)), TransferFunction((2.0,), (10.0, 1.0))
    at_once = TransferFunction((1.0, 1.0), (10.0, 1.0))
    direct = MatrixPlant([[at_once, side], [side, lag]])
    assert not needs_usual_signs(Specification(direct, MILD, Performance(), demands=demands))
    assert not needs_usual_signs(Specification(plant, MILD, Performance()))


def test_data_of_all_plants_are_looked_at() -> None:
    """The first frequency of a scenario must tell of rest as that of the task must."""
    omega = np.array([0.5, 1.0, 2.0])
    rest = MeasuredPlant(omega, np.ones((3, 1, 1), complex), unstable_poles=0)
    late = MeasuredPlant(omega, np.full((3, 1, 1), 0.1 + 1j), unstable_poles=0)
    task = Specification(rest, MILD, Performance(), scenarios=(Scenario("late", late),))
    with pytest.raises(InvalidInputError) as caught:
        require_tunable(task)
    assert caught.value.field == "/scenarios/0/plant/omega/0"
