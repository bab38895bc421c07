"""Decoupling, inverse, mode control and pairs: nested as they should be, and as good as claimed."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from solver.limits.ending import EnoughError
from solver.limits.manual import controller_in_manual, loops_in_manual
from solver.limits.structure_search import StructuredController, structured_controllers
from solver.limits.structures import StructureKind
from solver.model.controllers import Controller
from solver.model.mode_controller import ModeController
from solver.model.plants import MatrixPlant, first_order
from solver.model.state_space import StateSpace
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.centralised import analyse_centralised
from solver.tuning.specification import Specification
from solver.tuning.tuner import tune

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
PLANT = first_order(4, 1.0, 10.0, 0.4)
SLOW = Performance(tau_p=40.0)
WOOD_BERRY = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)


@functools.cache
def identical() -> tuple[float, Controller]:
    """tau_P and settings of the best identical PI loops."""
    found = tune(Specification(PLANT, UNCERTAINTY, Performance(), arrangement="identical"))
    assert found.tau_p is not None
    return found.tau_p, found.loops[0]


@functools.cache
def parallel() -> dict[StructureKind, StructuredController]:
    """All structures of four parallel units."""
    loop = identical()[1]
    found = structured_controllers(PLANT, UNCERTAINTY, Performance(), identical=loop).found
    return {each.kind: each for each in found}


@functools.cache
def matrix() -> dict[StructureKind, StructuredController]:
    """All structures of a matrix plant, least mu."""
    found = structured_controllers(WOOD_BERRY, UNCERTAINTY, SLOW).found
    return {each.kind: each for each in found}


def test_a_structure_that_holds_another_is_no_slower() -> None:
    """Inverse in static decoupling in mode control; identical loops in pairs and mode control."""
    value = {kind: each.value for kind, each in parallel().items()}
    assert value[StructureKind.MODE_CONTROL] <= value[StructureKind.STATIC_DECOUPLING] * (1 + 1e-6)
    assert value[StructureKind.STATIC_DECOUPLING] <= value[StructureKind.INVERSE] * (1 + 1e-6)
    alone = identical()[0]
    assert value[StructureKind.MODE_CONTROL] <= alone * (1 + 1e-4)
    assert value[StructureKind.PAIRS] <= alone * (1 + 1e-4)


@pytest.mark.parametrize("found", [parallel, matrix], ids=["parallel", "matrix"])
def test_every_controller_written_down_is_as_good_as_claimed(found) -> None:
    """As one full n x n controller on the whole plant, it has the peak that is claimed for it."""
    plant = PLANT if found is parallel else WOOD_BERRY
    assert found()
    for each in found().values():
        whole = each.controller
        assert whole is not None
        if isinstance(whole, ModeController):
            whole = whole.full(plant.n)
        again = analyse_centralised(plant, UNCERTAINTY, Performance(tau_p=each.tau_p), whole)
        assert again.peaks is not None
        claimed = each.robustness.peaks
        assert claimed is not None
        assert again.peaks.robust_performance.value == pytest.approx(
            claimed.robust_performance.value, rel=1e-5
        )
        if found is parallel:
            assert claimed.robust_performance.value <= 1
            assert each.value == each.tau_p
        else:
            assert each.value == claimed.robust_performance.value


def test_no_settings_beside_those_found_are_better() -> None:
    """Static decoupling by one PI: none of a grid around it reaches a tau_P 1 per cent less."""
    found = parallel()[StructureKind.STATIC_DECOUPLING]
    ((_, gain, integral_time),) = found.settings
    assert integral_time is not None
    faster = Performance(tau_p=0.99 * found.value)
    for k in gain * np.geomspace(0.5, 2, 9):
        for time in integral_time * np.geomspace(0.5, 2, 9):
            parts = [StateSpace([[0.0]], [[1.0]], k / time * W, k * W) for W in found.mixing]
            peaks = analyse_centralised(PLANT, UNCERTAINTY, faster, ModeController(*parts)).peaks
            assert peaks is None or peaks.robust_performance.value > 1


def test_static_decoupling_decouples() -> None:
    """G(0) W = I in both directions of a parallel plant and for a matrix plant."""
    total, difference = (float(W[0, 0]) for W in parallel()[StructureKind.STATIC_DECOUPLING].mixing)
    assert total * (1 + 3 * 0.4) == pytest.approx(1)
    assert difference * (1 - 0.4) == pytest.approx(1)
    (W,) = matrix()[StructureKind.STATIC_DECOUPLING].mixing
    assert WOOD_BERRY.static_gain() @ W == pytest.approx(np.eye(2), abs=1e-9)
    (one_way,) = matrix()[StructureKind.ONE_WAY_DECOUPLING].mixing
    through = WOOD_BERRY.static_gain() @ one_way
    assert np.diag(through) == pytest.approx([1, 1])
    assert min(abs(through[0, 1]), abs(through[1, 0])) < 1e-9


def test_what_was_not_found_is_told_from_what_was_not_sought() -> None:
    """No decoupler of the published plant meets the demand; one that is ended at once is not it."""
    plant = first_order(2, 1.0, 100.0, 0.999)
    whole = structured_controllers(plant, UNCERTAINTY, Performance(tau_p=None))
    assert StructureKind.STATIC_DECOUPLING in whole.none
    assert not whole.ended

    def enough() -> None:
        raise EnoughError

    ended = structured_controllers(plant, UNCERTAINTY, Performance(), tick=enough)
    assert not ended.found
    assert not ended.none
    assert set(ended.ended) == {*whole.none, *(each.kind for each in whole.found)}


def test_scaling_units_and_time_scales_the_answer() -> None:
    """In seconds and with outputs in per mille the settings and tau_P are the same."""
    scaled = structured_controllers(
        first_order(4, 1000.0, 600.0, 0.4), Uncertainty.from_error(0.2, 60.0), Performance()
    )
    values = {each.kind: each.value for each in scaled.found}
    kind = StructureKind.STATIC_DECOUPLING
    assert values[kind] == pytest.approx(60 * parallel()[kind].value, rel=1e-4)


def test_one_loop_in_manual_is_the_same_said_of_loops_and_of_a_diagonal_controller() -> None:
    """Diagonal PI as loops and as a full controller: the same worst unit, the same peak."""
    plant = first_order(2, 1.0, 10.0, 0.5)
    loops = (Controller(3.0, 8.0), Controller(1.5, 4.0))
    diagonal = StateSpace(
        np.zeros((2, 2)), np.eye(2), np.diag([3 / 8, 1.5 / 4]), np.diag([3.0, 1.5])
    )
    performance = Performance(tau_p=5.0)
    expected = loops_in_manual(plant, UNCERTAINTY, performance, loops)
    found = controller_in_manual(plant, UNCERTAINTY, performance, diagonal)
    assert expected is not None
    assert found is not None
    assert found.unit == expected.unit
    assert found.peak == pytest.approx(expected.peak, rel=1e-6)


def test_mode_control_with_a_unit_in_manual_is_that_of_its_full_matrix() -> None:
    """Rows and columns of the n x n controller, against the shortcut by symmetry."""
    controller = parallel()[StructureKind.MODE_CONTROL].controller
    assert isinstance(controller, ModeController)
    performance = Performance(tau_p=parallel()[StructureKind.MODE_CONTROL].tau_p)
    short = controller_in_manual(PLANT, UNCERTAINTY, performance, controller)
    full = controller_in_manual(PLANT, UNCERTAINTY, performance, controller.full(4))
    assert short is not None
    assert full is not None
    assert short.peak == pytest.approx(full.peak, rel=1e-6)
    assert short.stable == full.stable
