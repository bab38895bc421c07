"""Loops out of service: every subset against its own analysis, counts, limits, detuning."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.interaction.integral_controllability import ControllabilityVerdict
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.peaks import Peak, local_peaks
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.subsystems import subsystem
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.robustness.curves import LoopAnalysis
from solver.robustness.integrity import (
    MAX_CLASSES,
    Detuning,
    Integrity,
    ServiceClass,
    in_one_line,
    integrity,
)
from solver.robustness.subsets import Subsets
from solver.stability.closed_loop import unstable_poles

DIAGONAL = Uncertainty.from_error(0.2, 1)
FULL = Uncertainty.from_error(0.2, 1, Structure.FULL)
FAST, SLOW = Controller(46.3, 101), Controller(22.8, 3.15)
LAG = TransferFunction([1], [1, 1])


def matrix_plant(n: int) -> MatrixPlant:
    """Lags without any symmetry, with dead time."""
    generator = np.random.default_rng(n)
    return MatrixPlant(
        [
            [
                TransferFunction(
                    [1.0 if row == column else generator.uniform(-0.5, 0.5)],
                    [generator.uniform(50, 200), 1],
                    generator.uniform(0, 2),
                )
                for column in range(n)
            ]
            for row in range(n)
        ]
    )


CASES: dict[str, tuple[Plant, tuple[Controller, ...], Uncertainty]] = {
    "published": (first_order(2, 1, 100, 0.949), (FAST, SLOW), DIAGONAL),
    "groups": (
        first_order(5, 1, 100, -0.2),
        (FAST, Controller(10, 30), FAST, Controller(10, 30), FAST),
        DIAGONAL,
    ),
    "groups, full block": (
        first_order(4, 1, 100, 0.3, 0.5),
        (FAST, Controller(10, 30), FAST, Controller(10, 30)),
        FULL,
    ),
    "matrix": (matrix_plant(3), (Controller(20, 60), Controller(10, 30), SLOW), DIAGONAL),
    "one": (first_order(1, 1, 100, 0), (FAST,), DIAGONAL),
}


def representative(found: Integrity, each: ServiceClass) -> list[int]:
    """One set of units in service of a class."""
    return sorted(
        unit
        for group, count in zip(found.groups, each.in_service, strict=True)
        for unit in group[:count]
    )


@pytest.mark.parametrize("name", CASES)
def test_each_class_is_the_analysis_of_its_own_plant(name: str) -> None:
    """Stability and peaks equal those of the sub-system, analysed by itself."""
    plant, loops, uncertainty = CASES[name]
    performance = Performance(tau_p=25)
    found = integrity(plant, uncertainty, performance, loops)
    for each in found.classes:
        system = subsystem(plant, loops, representative(found, each))
        assert each.nominally_stable == (unstable_poles(*system) == 0)
        if not each.nominally_stable:
            assert each.robust_performance is None
            continue
        analysis = LoopAnalysis(*group_loops(*system, uncertainty), uncertainty, performance)
        for peak, curve in (
            (each.robust_performance, analysis.robust_performance),
            (each.robust_stability, analysis.robust_stability),
        ):
            assert peak is not None
            _, expected = local_peaks(curve, analysis.omega, curve(analysis.omega))
            assert peak.value == pytest.approx(expected.max(), rel=1e-5)
            assert curve(np.array([peak.omega]))[0] == pytest.approx(peak.value, rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_stability_of_all_subsets_at_once_equals_one_by_one(seed: int) -> None:
    """The batch counts the same unstable poles as each sub-system by itself, dead time or not."""
    generator = np.random.default_rng(seed)
    dead_time = float(generator.choice([0, 2]))
    process = TransferFunction([1.0], [generator.uniform(5, 50), 1], dead_time)
    interaction = TransferFunction([generator.uniform(-1.2, 1.2)], [generator.uniform(5, 50), 1])
    plant: Plant = ParallelPlant(4, process, interaction)
    controllers = tuple(
        Controller(10 ** generator.uniform(-1, 2), 10 ** generator.uniform(0, 2)) for _ in range(2)
    )
    loops = (controllers[0],) * 3 + (controllers[1],)
    counts = np.array([[a, b] for a in range(4) for b in range(2) if a + b], dtype=float)
    found = Subsets(plant, controllers, counts).unstable_poles()
    for row, (a, b) in zip(found, counts.astype(int), strict=True):
        units = [*range(a), *range(3, 3 + b)]
        assert row == unstable_poles(*subsystem(plant, loops, units))


def test_neutral_loops_with_dead_time_are_unstable() -> None:
    """Direct feedthrough of gain above one behind a dead time: only those subsets are refused."""
    process = TransferFunction([0.6, 1], [1, 1], 1.0)
    plant = ParallelPlant(2, process, TransferFunction([0.5, 0.5], [1, 1], 1.0))
    loops = (Controller(1.2, 10), Controller(1.2, 10))
    counts = np.array([[1.0], [2.0]])
    found = Subsets(plant, loops[:1], counts).unstable_poles()
    for count, units in zip(found, ([0], [0, 1]), strict=True):
        assert count == unstable_poles(*subsystem(plant, loops, units))
    assert found[1] > 10**6 > found[0]


def test_classes_count_every_subset_once() -> None:
    """Multiplicities are exact and sum to 2^n - 1."""
    plant, loops, _ = CASES["groups"]
    found = integrity(plant, DIAGONAL, Performance(tau_p=25), loops)
    assert sum(each.subsets for each in found.classes) == 2**5 - 1
    assert len(found.classes) == 4 * 3 - 1
    assert found.classes[0].in_service == (3, 2)
    by_size = {each.in_service: each.subsets for each in found.classes}
    assert by_size[(2, 1)] == math.comb(3, 2) * 2


def test_fifty_units_in_two_groups() -> None:
    """675 kinds stand for 2^50 - 1 sets, exactly."""
    loops = (Controller(20, 100),) * 25 + (Controller(10, 10),) * 25
    found = integrity(first_order(50, 1, 100, 0.3), DIAGONAL, Performance(tau_p=26), loops)
    assert len(found.classes) == 26 * 26 - 1
    assert sum(each.subsets for each in found.classes) == 2**50 - 1
    assert found.stable
    assert found.detuning is not None
    assert found.detuning.by_group
    assert "%" in found.summary
    assert "10^15" in found.summary


def test_published_settings_lose_performance_with_the_first_loop_in_manual() -> None:
    """SLH's loop 2 alone is the oscillatory one: stable and robust, but not to the demand."""
    plant, loops, _ = CASES["published"]
    found = integrity(plant, DIAGONAL, Performance(tau_p=19.2), loops)
    assert found.stable
    alone = {each.in_service: each.robust_performance for each in found.classes}
    assert alone[(1, 0)] is not None
    assert alone[(0, 1)] is not None
    assert alone[(1, 0)].value < 1 < alone[(0, 1)].value
    assert found.controllability is not None
    assert found.controllability.verdict is ControllabilityVerdict.GUARANTEED
    assert found.summary == (
        "loops out of service: of 3 sets of loops in service all stable, all robustly stable, "
        "2 with robust performance"
    )


def test_a_loop_that_needs_the_others_is_found() -> None:
    """Pairing on a negative relative gain: stable together, unstable with loop 2 in manual."""
    plant = MatrixPlant(
        [
            [TransferFunction([-1], [1, 1]), TransferFunction([3], [1, 1])],
            [TransferFunction([3], [1, 1]), TransferFunction([1], [1, 1])],
        ]
    )
    # The full gain is -10: with u1 acting through loop 2, y1 rises by 8 where alone it falls by 1.
    loops = (Controller(0.02, 1), Controller(1, 1))
    found = integrity(plant, DIAGONAL, Performance(tau_p=10), loops)
    stable = {each.in_service: each.nominally_stable for each in found.classes}
    assert stable == {(1, 1): False, (1, 0): False, (0, 1): True}
    turned = integrity(plant, DIAGONAL, Performance(tau_p=10), (Controller(-0.02, 1), loops[1]))
    stable = {each.in_service: each.nominally_stable for each in turned.classes}
    assert stable[(1, 0)]
    assert turned.controllability is not None
    assert turned.controllability.verdict is ControllabilityVerdict.GUARANTEED


def test_nothing_stable_has_no_peaks() -> None:
    """Loops that are too fast for the dead time: every set is unstable, none has a peak."""
    plant = first_order(2, 1, 100, 0.949, 10)
    found = integrity(plant, DIAGONAL, Performance(tau_p=19), (FAST, SLOW))
    assert not found.stable
    assert all(each.robust_performance is None for each in found.classes)
    assert "none stable, none robustly stable, none with" in found.summary


def test_detuning_agrees_with_a_direct_search() -> None:
    """Every combination of factors is stable or not as its own loops are."""
    plant = first_order(3, 1, 10, -0.45, 2.0)
    loops = (Controller(6, 10), Controller(6, 10), Controller(2, 10))
    found = integrity(plant, DIAGONAL, Performance(tau_p=25), loops).detuning
    assert found is not None
    assert found.factors == (0, 0.25, 0.5, 0.75, 1)
    unstable = {}
    for factors in itertools.product(found.factors, repeat=3):
        units = [unit for unit in range(3) if factors[unit] > 0]
        if not units:
            continue
        reduced = [
            Controller(loop.gain * (factor or 1), loop.integral_time)
            for loop, factor in zip(loops, factors, strict=True)
        ]
        unstable[factors] = unstable_poles(*subsystem(plant, reduced, units)) > 0
    distinct = {(*sorted(factors[:2]), factors[2]): bad for factors, bad in unstable.items()}
    assert found.combinations == len(distinct)
    assert found.unstable == sum(distinct.values()) > 0
    assert found.example is not None
    assert unstable[found.example]


def test_detuning_a_matrix_plant_scales_each_loop() -> None:
    """Three loops at five factors are 124 combinations; lowering the gains keeps them stable."""
    plant, loops, _ = CASES["matrix"]
    found = integrity(plant, DIAGONAL, Performance(tau_p=25), loops).detuning
    assert found is not None
    assert replace(found, between=None) == Detuning(
        (0, 0.25, 0.5, 0.75, 1), by_group=False, combinations=124, unstable=0, example=None
    )
    assert found.between is not None
    assert found.between.proven


def test_an_integrating_plant_has_no_static_gain() -> None:
    """The conditions on the static gain are left out, the subsets are analysed."""
    plant = ParallelPlant(2, TransferFunction([1], [10, 0]), TransferFunction([0.3], [10, 0]))
    loops = (Controller(3, 40),) * 2
    found = integrity(plant, DIAGONAL, Performance(tau_p=25), loops)
    assert found.controllability is None
    assert found.stable


def test_too_many_kinds_are_refused() -> None:
    """Eleven different loops have 2047 kinds of sets, and the error says what to do."""
    loops = tuple(Controller(10 + unit, 50) for unit in range(11))
    with pytest.raises(InvalidInputError) as caught:
        integrity(first_order(11, 1, 100, 0.1), DIAGONAL, Performance(tau_p=25), loops)
    assert caught.value.field == "/loops"
    assert "2,047" in caught.value.message
    assert str(MAX_CLASSES) in caught.value.message
    with pytest.raises(InvalidInputError, match="10\\^"):
        integrity(
            first_order(1000, 1, 100, 0.0001),
            DIAGONAL,
            Performance(tau_p=25),
            tuple(Controller(10 + unit, 50) for unit in range(1000)),
        )


@pytest.mark.parametrize(
    ("loops", "performance", "field"),
    [
        ((FAST,), Performance(tau_p=19), "/loops"),
        ((FAST, SLOW), Performance(), "/performance/tau_p"),
    ],
)
def test_incomplete_input_is_refused(
    loops: tuple[Controller, ...], performance: Performance, field: str
) -> None:
    """A missing loop or time constant is named."""
    with pytest.raises(InvalidInputError) as caught:
        integrity(first_order(2, 1, 100, 0.949), DIAGONAL, performance, loops)
    assert caught.value.field == field


def test_unstable_processes_are_refused() -> None:
    """As in every analysis."""
    plant = ParallelPlant(2, TransferFunction([1], [10, -1]), LAG)
    with pytest.raises(UnsupportedPlantError):
        integrity(plant, DIAGONAL, Performance(tau_p=25), (FAST, FAST))


def test_one_line_for_a_tuning() -> None:
    """The same line as the analysis gives, or, where that takes long, that it was left out."""
    plant, loops, _ = CASES["published"]
    performance = Performance(tau_p=19.2)
    line = in_one_line(plant, DIAGONAL, performance, loops)
    assert line == integrity(plant, DIAGONAL, performance, loops).summary
    axis = proven_peaks(plant, DIAGONAL, performance, loops)
    known = (axis.peaks, axis.guarantee)
    assert in_one_line(plant, DIAGONAL, performance, loops, whole=known) == line
    many = tuple(Controller(2 + unit, 50) for unit in range(12))
    assert in_one_line(first_order(12, 1, 100, 0.1), DIAGONAL, performance, many) == (
        "loops out of service: 4,095 kinds of sets, not analysed in passing"
    )


NEEDED = MatrixPlant(
    [
        [TransferFunction([-1], [1, 1]), TransferFunction([3], [1, 1])],
        [TransferFunction([3], [1, 1]), TransferFunction([1], [1, 1])],
    ]
)


@pytest.mark.parametrize(
    ("plant", "loops"),
    [
        (NEEDED, (Controller(0.02, 1), Controller(1, 1))),
        (first_order(2, 1, 100, 0.949, 10), (FAST, SLOW)),
        (first_order(3, 1, 100, -0.5), tuple(Controller(5 + unit, 90) for unit in range(3))),
        (first_order(2, 1, 0, 0.3, 1), (Controller(2, None), Controller(0.1, 5))),
    ],
)
def test_one_line_tells_of_unstable_sets(plant, loops) -> None:
    """Counted by proof set by set, as the analysis counts them side by side on a grid.

    An unstable loop without integral action is not refused for the offset that it would leave.
    """
    performance = Performance(tau_p=100.0)
    unstable = integrity(plant, DIAGONAL, performance, loops)
    assert not all(each.nominally_stable for each in unstable.classes)
    assert in_one_line(plant, DIAGONAL, performance, loops) == unstable.summary


def test_summary_of_large_numbers() -> None:
    """Shares near all and near none are not rounded to them."""
    good, bad = Peak(0.5, 1.0), Peak(2.0, 1.0)
    classes = (
        ServiceClass(
            (1, 0), 10**9, nominally_stable=True, robust_stability=good, robust_performance=bad
        ),
        ServiceClass(
            (0, 1), 1, nominally_stable=False, robust_stability=None, robust_performance=None
        ),
        ServiceClass(
            (1, 1), 1, nominally_stable=True, robust_stability=bad, robust_performance=good
        ),
    )
    summary = Integrity(((0,), (1,)), classes, None, None).summary
    assert "over 99.9 % stable, over 99.9 % robustly stable, under 0.1 % with" in summary


@pytest.mark.parametrize("matrix", [False, True])
def test_a_singular_set_is_unstable_and_its_parts_are_not(matrix: bool) -> None:
    """Three units with a = -1/2: together the sum is lost, any two of them are sound."""
    plant: Plant = first_order(3, 1, 100, -0.5)
    if matrix:
        plant = MatrixPlant([[plant.element(r, c) for c in range(3)] for r in range(3)])
    loops = tuple(Controller(5 + unit, 90) for unit in range(3))
    found = integrity(plant, DIAGONAL, Performance(tau_p=100.0), loops)
    stable = {sum(kind.in_service): kind.nominally_stable for kind in found.classes}
    assert stable == {3: False, 2: True, 1: True}
