"""Plants given in state space."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.from_state_space import from_state_space
from solver.model.plants import MatrixPlant, ParallelPlant
from solver.model.state_space import StateSpace
from solver.model.weights import Performance, Uncertainty
from solver.tuning.specification import Specification
from solver.tuning.tuner import tune


def same_response(plant: object, system: StateSpace) -> bool:
    """Whether a plant has the response of a system, to nine digits of what is not negligible."""
    rates = np.abs(system.poles[system.poles != 0]) if system.states else np.ones(1)
    omega = np.geomspace(1e-2 * rates.min(), 1e2 * rates.max(), 200)
    G, given = plant.response(omega), system.response(omega)  # type: ignore[attr-defined]
    peak = np.abs(given).max(axis=0)
    return bool((np.abs(G - given) <= 1e-8 * np.maximum(np.abs(given), 1e-6 * peak)).all())


@pytest.mark.parametrize("seed", range(25))
def test_drawn_systems_keep_their_response(seed: int) -> None:
    """Stable systems of up to 12 states and 3 inputs, drawn at random, keep their response."""
    rng = np.random.default_rng(seed)
    states, inputs = int(rng.integers(1, 13)), int(rng.integers(1, 4))
    A = rng.normal(size=(states, states))
    A -= (np.linalg.eigvals(A).real.max() + rng.uniform(0.01, 1)) * np.eye(states)
    system = StateSpace(
        A, rng.normal(size=(states, inputs)), rng.normal(size=(inputs, states)),
        rng.normal(size=(inputs, inputs)) * (rng.random() < 0.5),
    )  # fmt: skip
    assert same_response(from_state_space(system.A, system.B, system.C, system.D), system)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_unit_of_time_is_no_matter(unit: float) -> None:
    """The same dynamics in other units of time."""
    zpk = scipy.signal.ZerosPolesGain([-1.01 * unit, -3 * unit], [-unit, -2 * unit, -5 * unit], 4)
    given = zpk.to_ss()
    system = StateSpace(given.A, given.B, given.C, given.D)
    assert same_response(from_state_space(system.A, system.B, system.C, system.D), system)


def test_unseen_modes_cancel_whatever_the_coordinates() -> None:
    """Each element has the poles that it shows, in modal and in mixed coordinates."""
    A = np.diag([-0.06, -0.05, -0.09, -0.07])
    B = np.array([[1.0, 0], [0, 1], [1, 0], [0, 1]])
    C = np.array([[0.8, -0.9, 0, 0], [0, 0, 0.6, -1.3]])
    T = np.random.default_rng(0).normal(size=(4, 4))
    inverse = np.linalg.inv(T)
    for plant in (
        from_state_space(A, B, C, np.zeros((2, 2))),
        from_state_space(T @ A @ inverse, T @ B, C @ inverse, np.zeros((2, 2))),
    ):
        assert [len(element.den) for element in plant.elements] == [2] * 4
        assert plant.element(0, 0).poles == pytest.approx([-0.06])
        assert plant.element(1, 1).poles == pytest.approx([-0.07])


def test_nearly_cancelling_pairs_stay_where_they_show() -> None:
    """A zero 1e-11 beside a pole shows in no digit that counts; one a hundredth beside stays."""
    for distance, order in ((1e-11, 2), (1e-2, 3)):
        given = scipy.signal.ZerosPolesGain([-1 - distance, -3], [-1, -2, -5], 4).to_ss()
        plant = from_state_space(given.A, given.B, given.C, given.D)
        assert len(plant.element(0, 0).den) - 1 == order


def test_multiple_poles_are_kept() -> None:
    """A chain of equal lags has its multiple pole."""
    given = scipy.signal.TransferFunction([1], np.poly([-0.1] * 4)).to_ss()
    plant = from_state_space(given.A, given.B, given.C, given.D)
    assert plant.element(0, 0).den == pytest.approx(np.poly([-0.1] * 4).tolist(), rel=1e-9)


def test_units_far_apart_in_time_do_not_blur_each_other() -> None:
    """A unit of 1e6 time units beside one of 1e-6: each has its own pole, and is no integrator."""
    A, B, C = np.diag([-1e-6, -1e6]), np.eye(2), np.diag([1e-6, 2e6])
    plant = from_state_space(A, B, C, np.zeros((2, 2)))
    assert plant.element(0, 0).poles == pytest.approx([-1e-6])
    assert plant.element(1, 1).poles == pytest.approx([-1e6])
    assert plant.static_gain() == pytest.approx(np.diag([1.0, 2.0]))
    with pytest.raises(UnsupportedPlantError, match="unstable"):
        from_state_space(-A, B, C, np.zeros((2, 2)))
    with pytest.raises(UnsupportedPlantError, match="unstable"):
        from_state_space(np.diag([1e-6, -1e6]), B, C, np.zeros((2, 2)))


def test_integrators_are_exact() -> None:
    """An integrating mode has its pole at zero exactly."""
    plant = from_state_space([[0, 0], [0, -1]], [[1], [1]], [[1, 2]], [[0]])
    assert plant.element(0, 0).integrators == 1


def test_units_alike_are_a_parallel_plant() -> None:
    """A symmetric chain seen at its ends is a parallel plant, and so reduces by symmetry."""
    n = 6
    A = -2 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)
    B = np.zeros((n, 2))
    B[0, 0] = B[-1, 1] = 1
    assert isinstance(from_state_space(A, B, B.T, np.zeros((2, 2))), ParallelPlant)


def test_static_gains_and_missing_elements() -> None:
    """No states: the gains of D; an element without a path is zero."""
    plant = from_state_space(np.zeros((0, 0)), [], [], [[1, 0], [0.3, 2]])
    assert isinstance(plant, MatrixPlant)
    assert plant.element(0, 1).is_zero
    assert plant.element(1, 0).num == (0.3,)


@pytest.mark.parametrize("seen", [0.0, 1.0])
def test_unstable_modes_are_refused_even_unseen(seen: float) -> None:
    """A mode in the right half plane grows, whether an output shows it or not."""
    with pytest.raises(UnsupportedPlantError, match="eigenvalue 1"):
        from_state_space([[1, 0], [0, -1]], [[seen], [1]], [[seen, 1]], [[0]])


def test_order_that_no_polynomial_has_is_refused() -> None:
    """An element of thirty poles is refused by name."""
    n = 30
    A = -2 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)
    B = np.zeros((n, 1))
    B[0] = 1
    with pytest.raises(InvalidInputError, match="degree 20"):
        from_state_space(A, B, B.T, [[0]])


def test_a_plant_is_square() -> None:
    """Two outputs of one input are no plant."""
    with pytest.raises(InvalidInputError, match="square"):
        from_state_space([[-1]], [[1]], [[1], [2]], [[0], [0]])


def test_tuning_is_that_of_the_transfer_functions() -> None:
    """The seed plant in state space has the tau_P of its transfer functions."""
    A, B = -np.eye(2) / 100, np.eye(2) / 100
    plant = from_state_space(A, B, [[1, 0.949], [0.949, 1]], np.zeros((2, 2)))
    assert isinstance(plant, ParallelPlant)
    found = tune(Specification(plant, Uncertainty.from_error(0.2, 1), Performance()))
    assert found.tau_p == pytest.approx(18.4455, abs=5e-4)
