"""How wrong the model may be: against plants made wrong by just so much."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.robustness.model_tolerance import (
    ModelTolerance,
    model_tolerances,
    parameters,
    tolerance_remark,
)
from solver.robustness.proven_demand import ProvenDemand
from solver.stability.closed_loop import is_stable
from tests.solver.robustness.unusual_loops import draw

UNCERTAINTY = Uncertainty.from_error(0.2, 1)
PERFORMANCE = Performance(tau_p=19)
PUBLISHED = [Controller(46.3, 101), Controller(22.8, 3.15)]


def tolerances(plant, loops, performance=PERFORMANCE) -> dict[str, ModelTolerance]:
    """By parameter, and element where there is one."""
    omega = proven_peaks(plant, UNCERTAINTY, performance, loops).curves.omega
    found = model_tolerances(plant, performance, loops, omega)
    return {f"{each.parameter}{each.element or ''}": each for each in found}


def test_interaction_of_the_published_case_is_what_must_be_known() -> None:
    """Stability is lost where a passes 1, the demand a fifth of the way there."""
    found = tolerances(first_order(2, 1, 100, 0.949), PUBLISHED)["interaction"]
    assert found.stability[1] == pytest.approx(1 / 0.949 - 1, rel=0.02)
    assert found.demand is not None
    assert found.demand[1] is not None

    def nominal(error: float) -> float:
        plant = first_order(2, 1, 100, 0.949 * (1 + error))
        peaks = proven_peaks(plant, UNCERTAINTY, PERFORMANCE, PUBLISHED).peaks
        return peaks.nominal_performance.value

    assert nominal(found.demand[1]) <= 1
    assert nominal(1.05 * found.demand[1]) > 1


def test_loops_whose_proof_takes_too_long_are_judged_by_counts_of_poles() -> None:
    """What the proof finds: a time constant moves a resonance between the points of the grid."""
    slow = TransferFunction([0.3], [5, 1])
    resonant = TransferFunction([1], [1, 0.002, 1], 5)
    rows = [[resonant, slow], [slow, resonant]]
    loops, performance = [Controller(1e-4, 0.1)] * 2, Performance(tau_p=1e4)
    plant, omega = MatrixPlant(rows), np.geomspace(1e-3, 30, 400)
    low, high = float(omega[0]), float(omega[-1])
    proof = ProvenDemand(performance, tuple(loops), low, high)
    assert proof.stable(plant)
    assert proof.holds(plant, 10) == (False, False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ProvenDemand, "stable", lambda *_: pytest.fail("proven all the same"))
        patch.setattr("solver.robustness.model_tolerance.WORK", 10)
        by_grid = model_tolerances(plant, performance, loops, omega)
    by_proof = model_tolerances(plant, performance, loops, omega)
    for grid, proven in zip(by_grid, by_proof, strict=True):
        for one, other in zip(grid.stability, proven.stability, strict=True):
            assert (one is None) is (other is None)
            assert one is None or one == pytest.approx(other, rel=0.03)


def test_the_limit_of_a_dead_time_is_the_delay_margin() -> None:
    """A single loop k exp(-s)/s under almost pure gain: stable up to theta = pi/(2 k)."""
    plant = MatrixPlant([[TransferFunction([1], [1, 0], 1)]])
    found = tolerances(plant, [Controller(0.5, 1e5)], Performance(tau_p=1e3))
    assert found["dead_time(0, 0)"].stability[1] == pytest.approx(math.pi - 1, rel=0.02)
    assert found["gain(0, 0)"].stability[1] == pytest.approx(math.pi - 1, rel=0.02)
    assert found["gain(0, 0)"].stability[0] == pytest.approx(-1, rel=0.02)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_tolerances_do_not_depend_on_units(scale: float) -> None:
    """Time in another unit, gains in others: the same relative errors."""
    usual = tolerances(first_order(2, 1, 100, 0.949, 1), PUBLISHED)
    loops = [
        replace(c, gain=c.gain / scale, integral_time=c.integral_time * scale) for c in PUBLISHED
    ]
    plant = first_order(2, scale, 100 * scale, 0.949, scale)
    other = tolerances(plant, loops, Performance(tau_p=19 * scale))
    for name, each in usual.items():
        for ours, theirs in (
            (each.demand, other[name].demand), (each.stability, other[name].stability)
        ):  # fmt: skip
            ours_known = [math.nan if side is None else side for side in ours or ()]
            theirs_known = [math.nan if side is None else side for side in theirs or ()]
            np.testing.assert_allclose(ours_known, theirs_known, rtol=0.05)


def test_each_limit_of_stability_is_one() -> None:
    """The independent count of poles says the same on both sides of it."""
    plant = MatrixPlant(
        [
            [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
            [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
        ]
    )
    loops = [Controller(0.2, 4.44), Controller(-0.04, 2.67)]
    found = tolerances(plant, loops, Performance(tau_p=20))
    checked = 0
    for row in range(2):
        for column in range(2):
            limit = found[f"gain{row, column}"].stability[1]
            if limit is None:
                continue
            for share, stable in ((0.97, True), (1.05, False)):
                rows = [list(elements) for elements in plant.elements_by_row]
                old = rows[row][column]
                rows[row][column] = TransferFunction(
                    [old.num[0] * (1 + share * limit)], old.den, old.dead_time
                )
                assert is_stable(MatrixPlant(rows), loops) == stable
            checked += 1
    assert checked


def test_a_demand_that_is_not_met_has_no_tolerance() -> None:
    """Only that of stability is told."""
    found = tolerances(first_order(2, 1, 100, 0.949), PUBLISHED, Performance(tau_p=2))
    assert all(each.demand is None for each in found.values())


def _outside(parameter: str, error: float) -> float:
    """Return a factor just outside; of times above zero."""
    factor = 1 + 1.03 * error + math.copysign(2e-4, error)
    return factor if parameter in {"gain", "interaction"} else max(factor, 0.9 * (1 + error))


@pytest.mark.parametrize("seed", [40000, 40015, 40025, 40026, 40045, 40046])
def test_every_end_of_unusual_loops_is_one(seed: int) -> None:
    """Just inside the demand, or stability, holds over the whole axis; just outside it is lost."""
    drawn = draw(np.random.default_rng(seed))
    if not is_stable(drawn.plant, drawn.loops):
        pytest.skip("unstable as drawn")
    assert drawn.performance.tau_p is not None
    slow = replace(drawn.performance, tau_p=100 * drawn.performance.tau_p, max_peak=20)
    omega = proven_peaks(drawn.plant, drawn.uncertainty, slow, drawn.loops).curves.omega

    def nominal(plant: Plant) -> float:
        if not is_stable(plant, drawn.loops):
            return math.inf
        found = proven_peaks(plant, drawn.uncertainty, slow, drawn.loops)
        return found.peaks.nominal_performance.value

    changes = {(each.name, each.element): each.changed for each in parameters(drawn.plant)}
    for each in model_tolerances(drawn.plant, slow, drawn.loops, omega):
        changed = changes[each.parameter, each.element]
        for error in each.demand or ():
            if error is not None:
                assert nominal(changed(1 + error)) <= 1 + 1e-6
                assert nominal(changed(_outside(each.parameter, error))) > 1
        for error in each.stability:
            if error is not None:
                assert is_stable(changed(1 + error), drawn.loops)
                assert not is_stable(changed(_outside(each.parameter, error)), drawn.loops)


def test_a_demand_that_is_lost_and_met_again_is_told_where_it_is_lost_first() -> None:
    """Between dead times 1.63 and 2.08 as long it is, by 0.4 per cent, and then up to 3.3."""
    rows = [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
    plant, loops = MatrixPlant(rows), [Controller(0.3, 8), Controller(-0.05, 8)]
    performance, omega = Performance(tau_p=5000), np.geomspace(1e-6, 100, 300)
    found = model_tolerances(plant, performance, loops, omega)
    late = {each.element: each for each in found if each.parameter == "dead_time"}[1, 1]
    assert late.demand is not None
    assert late.demand[1] == pytest.approx(0.627, abs=0.01)


def test_a_tolerance_far_below_one_per_cent_is_told() -> None:
    """a = 0.9999999: the differences turn round at a = 1, 1e-7 away."""
    plant = first_order(2, 1, 100, 0.9999999)
    found = tolerances(plant, [Controller(1, 100)] * 2)["interaction"]
    assert found.stability[1] == pytest.approx(1e-7, rel=0.1)


def test_time_constants_and_dead_times_are_tried_down_to_nothing() -> None:
    """A plant five times as fast is unstable under this gain, one without dead time is not."""
    plant = first_order(2, 1, 10, 0.2, 1)
    loops = [Controller(4, 10)] * 2
    found = tolerances(plant, loops, Performance(tau_p=30))
    limit = found["time_constant"].stability[0]
    assert limit is not None
    for error, stable in ((limit, True), (1.03 * limit, False)):
        assert is_stable(first_order(2, 1, 10 * (1 + error), 0.2, 1), loops) is stable
    assert found["dead_time"].stability[0] is None
    assert is_stable(first_order(2, 1, 10, 0.2), loops)


@pytest.mark.parametrize(
    ("n", "together"), [(3, ()), (4, ("time constants",)), (6, ("gains", "time constants"))]
)
def test_what_is_changed_in_all_elements_together_is_said(
    n: int, together: tuple[str, ...]
) -> None:
    """Of more than three loops some, of more than five all parameters are those of all elements."""
    one, other = TransferFunction([3.0], [10, 1]), TransferFunction([0.1], [10, 1])
    rows = [[one if row == column else other for column in range(n)] for row in range(n)]
    remark = tolerance_remark(MatrixPlant(rows)) or ""
    for name in ("gains", "time constants", "dead times"):
        assert (name in remark) == (name in together)
    assert tolerance_remark(first_order(n, 1, 10, 0.2)) is None
