"""Pairings, groups by membership, and the scan of digital controllers."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from solver.model.arranged import paired, sampled
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.scan import scan_remark
from solver.stability.closed_loop import is_stable
from solver.tuning.pairings import pairings
from solver.tuning.record import Status
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Arrangement, Signs, Specification
from solver.tuning.tuner import tune

T = TransferFunction
# Wood and Berry (1973): distillation of methanol and water, minutes and per cent.
WOOD_BERRY = MatrixPlant(
    [
        [T([12.8], [16.7, 1], 1), T([-18.9], [21, 1], 3)],
        [T([6.6], [10.9, 1], 7), T([-19.4], [14.4, 1], 3)],
    ]
)
TASK = Specification(WOOD_BERRY, Uncertainty.from_error(0.1, 0.5), Performance())
SWAPPED = MatrixPlant([[row[1], row[0]] for row in WOOD_BERRY.rows])


def test_pairing_undoes_swapped_columns() -> None:
    """A plant with its inputs numbered otherwise has the same result, paired accordingly."""
    usual, found = tune(TASK), tune(replace(TASK, plant=SWAPPED, pairing=(1, 0)))
    assert found.pairing == (1, 0)
    assert found.loops == usual.loops
    assert found.tau_p == usual.tau_p
    assert usual.pairing is None


def test_errors_stay_with_their_inputs_whatever_the_pairing() -> None:
    """A list of errors is of the inputs of the plant: swapped with them it is the same task."""
    inputs = Uncertainty.from_error([0.1, 0.02], 0.5)
    usual = tune(replace(TASK, uncertainty=inputs))
    swapped = Uncertainty.from_error([0.02, 0.1], 0.5)
    worn = (Scenario("worn", uncertainty=swapped),)
    task = replace(TASK, plant=SWAPPED, uncertainty=swapped, scenarios=worn)
    for pairing in ((1, 0), "best"):
        found = tune(replace(task, pairing=pairing))
        assert found.pairing == (1, 0)
        assert found.tau_p == usual.tau_p


def test_best_pairing_is_found_and_the_outcome_told() -> None:
    """Of swapped inputs the pairing with positive relative gains is the only candidate."""
    found = tune(replace(TASK, plant=SWAPPED, pairing="best"))
    assert found.pairing == (1, 0)
    assert found.tau_p == tune(TASK).tau_p


def test_best_pairing_is_no_worse_than_any_candidate() -> None:
    """Where several pairings may have integral action the best of their tunings is returned."""
    gains = [[2.0, 0.9, 0.4], [0.5, 1.5, 0.9], [0.7, 0.3, 1.2]]
    plant = MatrixPlant([[T([k], [10.0 + r, 1], 1 + c / 2) for c, k in enumerate(row)]
                         for r, row in enumerate(gains)])  # fmt: skip
    task = Specification(
        plant, TASK.uncertainty, Performance(), arrangement=Arrangement.IDENTICAL, pairing="best"
    )
    candidates = pairings(task)
    assert (0, 1, 2) in candidates
    found = tune(task)
    values = [tune(replace(task, pairing=each)).tau_p or math.inf for each in candidates]
    assert found.tau_p == min(values)
    if len(candidates) > 1:
        [tried] = [sentence for sentence in found.advice if "Pairings tried" in sentence]
        assert "0" not in re.findall(r"\b\d\b(?!\.)", tried)


def test_pairing_of_one_loop() -> None:
    """One loop has one pairing."""
    task = Specification(first_order(1, 1, 10, 0, 1), TASK.uncertainty, Performance())
    assert tune(replace(task, pairing="best")).tau_p == tune(task).tau_p


def test_pairing_of_a_large_plant_must_be_its_own() -> None:
    """Of 300 like units only the given pairing is possible, and that changes nothing."""
    plant = first_order(300, 1, 100, 0.2)
    assert paired(plant, range(300)) is plant
    with pytest.raises(InvalidInputError, match="up to 10 units"):
        paired(plant, [1, 0, *range(2, 300)])


@pytest.mark.parametrize(
    ("pairing", "field"),
    [((0,), "/pairing"), ((0, 2), "/pairing/1"), ((1, 1), "/pairing/1"), ("worst", "/pairing")],
)
def test_wrong_pairings_are_refused_by_place(pairing: object, field: str) -> None:
    """A pairing has each input once."""
    with pytest.raises(InvalidInputError) as caught:
        replace(TASK, pairing=pairing)
    assert caught.value.field == field


def test_best_pairing_of_an_integrating_plant_is_refused() -> None:
    """No static gain, no ranking; a list still serves."""
    plant = MatrixPlant([[T([1], [1, 0]), T([0.2], [5, 1])], [T([0.1], [4, 1]), T([1], [1, 0])]])
    with pytest.raises(InvalidInputError, match="integrates"):
        tune(replace(TASK, plant=plant, pairing="best"))


def test_groups_by_membership_equal_groups_by_size_of_renumbered_units() -> None:
    """Four unlike units in groups (0, 2), (1, 3) are the same as renumbered in sizes (2, 2)."""
    gains = [1.0, 2.0, 1.1, 1.9]
    rows = [[T([k if r == c else 0.1 * k], [10 + r, 1], 1) for c, k in enumerate(gains)]
            for r in range(4)]  # fmt: skip
    grouped = Specification(
        MatrixPlant(rows), TASK.uncertainty, Performance(), arrangement=Arrangement.GROUPED,
        groups=((0, 2), (1, 3)), starts=8,
    )  # fmt: skip
    order = (0, 2, 1, 3)
    renumbered = MatrixPlant([[rows[r][c] for c in order] for r in order])
    by_size = replace(grouped, plant=renumbered, groups=None, group_sizes=(2, 2))
    first, second = tune(grouped), tune(by_size)
    assert first.groups == ((0, 2), (1, 3))
    assert first.loops[0] == first.loops[2]
    assert first.loops[1] == first.loops[3]
    assert first.tau_p == pytest.approx(second.tau_p, rel=1e-6)


def test_groups_of_like_units_are_as_given() -> None:
    """Like units in groups (0, 2), (1,) have the tau_P of the sizes (2, 1)."""
    task = Specification(
        first_order(3, 1, 100, -0.3), Uncertainty.from_error(0.2, 1), Performance(),
        arrangement=Arrangement.GROUPED, groups=((0, 2), (1,)),
    )  # fmt: skip
    found = tune(task)
    assert found.groups == ((0, 2), (1,))
    assert found.loops[0] == found.loops[2]
    sizes = tune(replace(task, groups=None, group_sizes=(2, 1)))
    assert found.tau_p == pytest.approx(sizes.tau_p, rel=1e-6)


@pytest.mark.parametrize(
    ("groups", "field"),
    [
        (((0,),), "/controller/groups"),
        (((0, 1), (1,)), "/controller/groups/1/0"),
        (((0, 2),), "/controller/groups/0/1"),
        (((0, 1), ()), "/controller/groups/1"),
    ],
)
def test_wrong_members_are_refused_by_place(groups: object, field: str) -> None:
    """Each unit is in one group, and no group is empty."""
    with pytest.raises(InvalidInputError) as caught:
        replace(TASK, arrangement=Arrangement.GROUPED, groups=groups)
    assert caught.value.field == field


def test_group_of_opposite_gains_is_refused() -> None:
    """Wood and Berry's own gains have opposite signs: no gain of one sign serves both alone."""
    task = replace(TASK, arrangement=Arrangement.GROUPED, groups=((0, 1),))
    with pytest.raises(InvalidInputError, match=r"loops 1 and 2 .* opposite signs"):
        tune(task)
    assert tune(replace(task, signs=Signs.ANY, starts=2)).status is not Status.LOCAL


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"groups": ((0,),)}, "loop 2 is in no group"),
        ({"groups": ((0,), (1, 0))}, "loop 1 is in group 1 already"),
        ({"groups": ((0,), (2,))}, "the plant has 2 loops"),
    ],
)
def test_messages_count_from_one(changes: dict[str, Any], told: str) -> None:
    """Loops and groups are called as people call them, whatever the request counts from."""
    with pytest.raises(InvalidInputError, match=told):
        replace(TASK, arrangement=Arrangement.GROUPED, **changes)


def test_groups_and_sizes_contradict() -> None:
    """Both at once are refused."""
    with pytest.raises(InvalidInputError, match="not both"):
        replace(TASK, arrangement=Arrangement.GROUPED, groups=((0,), (1,)), group_sizes=(1, 1))


def test_scan_is_dead_time_of_one_and_a_half_scans() -> None:
    """Every element that is not zero comes 1.5 scans later; no scan changes nothing."""
    later = sampled(WOOD_BERRY, 0.2)
    for row, column in itertools.product(range(2), range(2)):
        before = WOOD_BERRY.element(row, column).dead_time
        assert later.element(row, column).dead_time == pytest.approx(before + 0.3)
    assert sampled(WOOD_BERRY, 0) is WOOD_BERRY


def test_tuning_with_a_scan_is_that_of_the_delayed_plant() -> None:
    """A slower scan costs time constant, by as much as the dead time does."""
    found = tune(replace(TASK, scan_time=0.5))
    assert found.tau_p == tune(replace(TASK, plant=sampled(WOOD_BERRY, 0.5))).tau_p
    assert (found.tau_p or 0) > (tune(TASK).tau_p or math.inf)


def sampled_poles(
    gain: float, integral_time: float, tau: float, scan: float
) -> NDArray[np.complex128]:
    """Return the poles z of an exactly sampled PI loop around 1/(tau s + 1).

    Held between scans, written one scan after it was read; the integral by the trapezium.
    """
    a = math.exp(-scan / tau)
    # States: output, integral, output written at this scan.
    step = gain * scan / (2 * integral_time)
    # e = -y;  u = gain e + integral;  integral' = integral + step (e + e'), y' = a y + (1 - a) w.
    A = np.zeros((3, 3))
    A[0] = [a, 0, 1 - a]  # y' of what was written before
    A[1] = [-step * (1 + a), 1, -step * (1 - a)]
    A[2] = [-gain, 1, 0]  # written next
    return np.linalg.eigvals(A).astype(complex)


def sampled_radius(gain: float, integral_time: float, tau: float, scan: float) -> float:
    """Return their spectral radius."""
    return float(np.abs(sampled_poles(gain, integral_time, tau, scan)).max())


@pytest.mark.parametrize("scan", [0.02, 0.1])
def test_sampled_loop_loses_stability_where_the_dead_time_says(scan: float) -> None:
    """The greatest stable gain of the sampled loop is 4 to 5 % below that of the delayed one.

    There a scan is a radian, which is not small, and is remarked on.
    """
    tau, integral_time = 10.0, 5.0
    assert expm(np.array([[-scan / tau]]))[0, 0] == pytest.approx(math.exp(-scan / tau))
    plant = first_order(1, 1, tau, 0)

    def limit(stable: object) -> float:
        low, high = 1.0, 1e4
        for _ in range(40):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if stable(middle) else (low, middle)  # type: ignore[operator]
        return low

    exact = limit(lambda k: sampled_radius(k, integral_time, tau, scan) < 1)
    delayed = limit(lambda k: is_stable(sampled(plant, scan), [Controller(k, integral_time)]))
    # At its limit the loop turns a radian a scan: hold and trapezium differ from their dead time.
    assert 0.95 < exact / delayed < 0.97
    assert scan_remark(sampled(plant, scan), [Controller(delayed, integral_time)], scan)
    # A tenth of that gain: nothing is remarked on.
    gentle = 0.1 * exact
    assert sampled_radius(gentle, integral_time, tau, scan) < 1
    assert scan_remark(sampled(plant, scan), [Controller(gentle, integral_time)], scan) is None


@pytest.mark.parametrize(
    ("turn", "error"), [(0.05, 3e-4), (0.1, 1e-3), (0.15, 3e-3), (0.2, 1.5e-2)]
)
def test_poles_of_the_sampled_loop_are_those_of_the_delayed_one(turn: float, error: float) -> None:
    """As long as a scan is a small angle at the crossover: 0.1 % apart at a tenth of a radian."""
    tau, integral_time, scan = 10.0, 5.0, 0.1
    gain = turn * tau / scan  # crosses over near gain/tau
    plant, loop = sampled(first_order(1, 1, tau, 0), scan), Controller(gain, integral_time)
    z = sampled_poles(gain, integral_time, tau, scan)
    for pole in np.log(z[np.abs(z) > 0.5]) / scan:  # what lasts longer than a scan or two
        s = pole
        for _ in range(50):  # Newton's method on 1 + g c
            value = 1 + plant.process(s) * loop(s)
            slope = (1 + plant.process(s * (1 + 1e-7)) * loop(s * (1 + 1e-7)) - value) / (1e-7 * s)
            s = s - value / slope
        assert abs(s - pole) < error * abs(pole)


def test_slow_scan_is_said() -> None:
    """A result whose scan is not small carries a warning."""
    found = tune(replace(TASK, plant=first_order(2, 1, 100, 0.949), scan_time=5.0))
    assert any("the scan time 5 is not small" in warning for warning in found.warnings)
