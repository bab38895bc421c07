"""Robustness of full controllers, against single loops, AB13MD and poles."""

from __future__ import annotations

import control
import numpy as np
import pytest
from ctrlsys import ab13md
from scipy import linalg

import mutune
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.state_space import StateSpace
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.centralised import ModeController, analyse_centralised
from solver.robustness.centralised_curves import CentralisedAnalysis, central_blocks

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
COLUMN = MatrixPlant(
    [
        [TransferFunction([0.878], [75, 1]), TransferFunction([-0.864], [75, 1])],
        [TransferFunction([-1.082], [75, 1]), TransferFunction([1.096], [75, 1])],
    ]
)


def pi(gain: float, integral_time: float) -> StateSpace:
    """k + k/(tau_I s) in state space."""
    return StateSpace([[0.0]], [[1.0]], [[gain / integral_time]], [[gain]])


def test_diagonal_controller_is_analysed_like_single_loops() -> None:
    """A full controller that is diagonal has the peaks of its loops, in every form."""
    loops = (Controller(46.3, 101.0), Controller(22.8, 3.15))
    plant = first_order(2, 1.0, 100.0, 0.949)
    performance = Performance(tau_p=19.0)
    expected = analyse(plant, UNCERTAINTY, performance, loops).peaks
    assert expected is not None
    first, second = (pi(loop.gain, loop.integral_time) for loop in loops)
    diagonal = StateSpace(
        np.diag([first.A[0, 0], second.A[0, 0]]),
        np.eye(2),
        np.diag([first.C[0, 0], second.C[0, 0]]),
        np.diag([first.D[0, 0], second.D[0, 0]]),
    )
    zero = TransferFunction([0.0], [1.0])
    transfer = MatrixPlant(
        [
            [TransferFunction([46.3 * 101, 46.3], [101, 0]), zero],
            [zero, TransferFunction([22.8 * 3.15, 22.8], [3.15, 0])],
        ]
    )
    for controller in (diagonal, transfer):
        found = analyse_centralised(plant, UNCERTAINTY, performance, controller)
        assert found.nominally_stable
        assert found.peaks is not None
        for name in ("robust_performance", "robust_stability", "nominal_performance"):
            value = getattr(found.peaks, name).value
            assert value == pytest.approx(getattr(expected, name).value, rel=1e-5)


@pytest.mark.parametrize("structure", list(Structure))
@pytest.mark.parametrize("n", [1, 2, 3])
def test_modes_are_what_the_full_matrix_is(n: int, structure: Structure) -> None:
    """Two modes with a shared scale have the mu of the n x n loop."""
    uncertainty = Uncertainty.from_error(0.2, 1.0, structure)
    plant = first_order(n, 1.0, 10.0, 0.3, 0.5)
    modes = ModeController(pi(2.0, 8.0), pi(5.0, 12.0))
    performance = Performance(tau_p=10.0)
    by_modes = analyse_centralised(plant, uncertainty, performance, modes)
    full = analyse_centralised(plant, uncertainty, performance, modes.full(n))
    assert by_modes.peaks is not None
    assert full.peaks is not None
    assert by_modes.peaks.robust_performance.value == pytest.approx(
        full.peaks.robust_performance.value, rel=1e-5
    )
    assert by_modes.peaks.robust_stability.value == pytest.approx(
        full.peaks.robust_stability.value, rel=1e-5
    )


def test_mu_of_a_full_controller_is_that_of_ab13md() -> None:
    """The curve agrees with SLICOT's, where the bound is mu: three blocks."""
    rng = np.random.default_rng(3)
    controller = StateSpace(
        np.diag([0.0, 0.0, -1.0]), rng.normal(size=(3, 2)), rng.normal(size=(2, 3)), np.eye(2)
    )
    analysis = CentralisedAnalysis(
        central_blocks(COLUMN, UNCERTAINTY),
        (controller,),
        UNCERTAINTY,
        Performance(tau_p=10.0),
    )
    omega = np.geomspace(1e-3, 1e2, 20)
    mu = analysis.robust_performance(omega)
    sizes, kinds = np.array([1, 1, 2], dtype=np.int32), np.array([2, 2, 2], dtype=np.int32)
    expected = [ab13md(np.asfortranarray(N), sizes, kinds)[0] for N in analysis.matrices(omega)[0]]
    assert mu == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_stability_is_that_of_the_poles(seed: int) -> None:
    """Without dead time, the count by encirclements is that of the closed-loop eigenvalues."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3)) - rng.uniform(-0.5, 3) * np.eye(3)
    controller = StateSpace(
        A, rng.normal(size=(3, 2)), rng.normal(size=(2, 3)), rng.normal(size=(2, 2))
    )
    plant = MatrixPlant(
        [
            [TransferFunction([1.0], [2.0, 1.0]), TransferFunction([0.4], [1.0, 1.0])],
            [TransferFunction([-0.6], [3.0, 1.0]), TransferFunction([2.0], [1.0, 2.0, 1.0])],
        ]
    )
    rows = [[control.tf2ss(list(e.num), list(e.den)) for e in row] for row in plant.elements_by_row]
    A = linalg.block_diag(*[e.A for row in rows for e in row])
    B = np.vstack([np.kron(np.eye(2)[column], e.B) for row in rows for column, e in enumerate(row)])
    C = linalg.block_diag(*[np.hstack([e.C for e in row]) for row in rows])
    G = control.ss(A, B, C, np.zeros((2, 2)))
    K = control.ss(controller.A, controller.B, controller.C, controller.D)
    poles = control.feedback(G * K, control.ss([], [], [], np.eye(2))).poles()
    found = analyse_centralised(plant, UNCERTAINTY, Performance(tau_p=10.0), controller)
    assert found.unstable_poles == int(np.count_nonzero(poles.real >= 0))


def test_a_controller_of_another_size_is_refused() -> None:
    """The controller must fit the plant; a mode controller needs a parallel one."""
    performance = Performance(tau_p=10.0)
    with pytest.raises(InvalidInputError, match="must be 2 x 2"):
        analyse_centralised(COLUMN, UNCERTAINTY, performance, pi(1.0, 1.0))
    modes = ModeController(pi(1.0, 1.0), pi(1.0, 1.0))
    with pytest.raises(InvalidInputError, match="parallel plant"):
        analyse_centralised(COLUMN, UNCERTAINTY, performance, modes)
    with pytest.raises(InvalidInputError, match="time constant"):
        analyse_centralised(COLUMN, UNCERTAINTY, Performance(), pi(1.0, 1.0))


def test_shapes_that_do_not_fit_are_named() -> None:
    """A state-space description says which of its matrices is wrong."""
    for faulty, field in (
        (([[0.0]], [[1.0, 2.0]], [[1.0]], [[1.0]]), "/B"),
        (([[0.0]], [[1.0]], [[1.0], [2.0]], [[1.0]]), "/C"),
        (([[0.0, 1.0]], [[1.0]], [[1.0]], [[1.0]]), "/A"),
        (([[0.0]], [[1.0]], [[1.0]], [[float("nan")]]), "/D"),
    ):
        with pytest.raises(InvalidInputError) as caught:
            StateSpace(*faulty)
        assert caught.value.field == field


def test_parallel_plant_with_dead_time_and_feedthrough() -> None:
    """With dead time and a direct gain of 1 or more the loop is not stable, whatever the rest."""
    plant = ParallelPlant(
        2, TransferFunction([2.0, 1.0], [1.0, 1.0], 0.3), TransferFunction([0.0], [1.0])
    )
    modes = ModeController(pi(1.0, 10.0), pi(1.0, 10.0))
    assert not analyse_centralised(
        plant, UNCERTAINTY, Performance(tau_p=10.0), modes
    ).nominally_stable


def test_an_empty_matrix_stands_for_no_states_alone():
    """One that is forgotten is not taken for zeros."""
    assert mutune.StateSpace([], [], [], [[2.0]]).states == 0
    with pytest.raises(mutune.InvalidInputError, match="B must be 1 x 1"):
        mutune.StateSpace([[-1.0]], [], [[1.0]], [[0.0]])
