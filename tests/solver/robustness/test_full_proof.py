"""Proofs of the peak of mu under full controllers: enclosures that hold, nothing false proven."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.mode_controller import ModeController
from solver.model.peaks import Peak
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.state_space import StateSpace
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.centralised import Centralised, analyse_centralised
from solver.robustness.centralised_curves import CentralisedAnalysis, central_blocks
from solver.robustness.full_models import FullLoop, Variable
from solver.robustness.full_proof import _block, _block_at_rest, prove
from solver.robustness.record import GuaranteeStatus

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
PERFORMANCE = Performance(tau_p=30.0)


def pi(gain: float, integral_time: float) -> StateSpace:
    """k + k/(tau_I s)."""
    return StateSpace([[0.0]], [[1.0]], [[gain / integral_time]], [[gain]])


def random_controller(rng: np.random.Generator, m: int, states: int) -> StateSpace:
    """Integrators in all inputs beside stable dynamics, some of them lightly damped."""
    A = rng.normal(size=(states, states)) * 0.3 - 0.8 * np.eye(states)
    full = np.block([[np.zeros((m, m)), np.zeros((m, states))], [np.zeros((states, m)), A]])
    B = np.vstack([np.eye(m), 0.1 * rng.normal(size=(states, m))])
    C = np.hstack([0.05 * np.eye(m), 0.1 * rng.normal(size=(m, states))])
    return StateSpace(full, B, C, 2 * np.eye(m))


COUPLED = MatrixPlant(
    [
        [TransferFunction([1], [10, 1], 0.3), TransferFunction([0.3], [5, 1])],
        [TransferFunction([-0.2], [4, 1], 1.0), TransferFunction([-1, 1], [40, 14, 1])],
    ]
)
LEVELS = MatrixPlant(
    [
        [TransferFunction([0.1], [2, 1, 0]), TransferFunction([0.03], [1, 0])],
        [TransferFunction([0.02], [4, 1, 0]), TransferFunction([0.1], [3, 1, 0])],
    ]
)
ONE_LEVEL = MatrixPlant(
    [
        [TransferFunction([0.1], [1, 0]), TransferFunction([0.5], [3, 1])],
        [TransferFunction([0.03], [1, 0], 1.0), TransferFunction([2], [4, 1])],
    ]
)
DIRECT = MatrixPlant(
    [
        [TransferFunction([2, 1], [10, 1]), TransferFunction([0.3], [5, 1])],
        [TransferFunction([0.2], [4, 1]), TransferFunction([3, 1], [8, 1])],
    ]
)


@pytest.mark.parametrize(
    "plant",
    [COUPLED, LEVELS, DIRECT, ONE_LEVEL],
    ids=["dead time", "levels", "direct", "one level"],
)
@pytest.mark.parametrize("seed", range(4))
def test_models_hold_the_loop(plant: Plant, seed: int) -> None:
    """On random intervals, both ends of the axis among them, N lies within its enclosure."""
    rng = np.random.default_rng(seed)
    controller = random_controller(rng, 2, 5)
    blocks = central_blocks(plant, UNCERTAINTY)
    loop = FullLoop(blocks, 0, controller, UNCERTAINTY, PERFORMANCE)
    analysis = CentralisedAnalysis(blocks, (controller,), UNCERTAINTY, PERFORMANCE)
    low = 10 ** rng.uniform(-4, 3, 40)
    groups = [
        (low, low * (1 + 10 ** rng.uniform(-4, -0.5, 40)), _block),
        (low, low * (1 + 10 ** rng.uniform(-4, -0.5, 40)), _block_at_rest),
        (np.array([0.0]), np.array([1e-3]), _block_at_rest),
        (np.array([1e4]), np.array([np.inf]), _block),
    ]
    if not loop.deficit:
        groups.append((np.array([0.0]), np.array([1e-5]), _block))
    for lows, highs, block in groups:
        variable = Variable.over(lows, highs, 1.0)
        N, _, sound = block(loop, variable)
        assert sound.mean() > 0.5
        for t in (-0.99, -0.37, 0.0, 0.81, 0.99):
            value = sum(N.P[k] * t**k for k in range(len(N.P)))
            z = (variable.middle + variable.half * t).imag
            omega = -1 / z if variable.inverse else z
            here = analysis.matrices(omega)[0]
            # The enclosure is of K^-1 C and G K with lifted integrators, phases apart.
            K = np.where(loop.lifted > 0, 1j * omega[:, None] / (1 + 1j * omega[:, None]), 1.0)
            left = np.concatenate([1 / K, np.ones_like(K)], axis=1)
            here = here * left[:, :, None] / left[:, None, :]
            gap = np.abs(value - here)
            room = N.radius + 1e-9 * np.abs(here)
            assert (gap <= room)[sound].all()


PROVEN = [
    (first_order(2, 1.0, 100.0, 0.949), ModeController(pi(2.0, 80.0), pi(20.0, 80.0))),
    (first_order(300, 1.0, 100.0, -0.003), ModeController(pi(20.0, 80.0), pi(5.0, 80.0))),
    (first_order(1, 1e-6, 1e3, 0.0), ModeController(pi(2e7, 800.0), pi(1.0, 1.0))),
    (first_order(3, 1.0, 30.0, -0.3, 1.0), ModeController(pi(9.0, 20.0), pi(5.0, 30.0))),
    (COUPLED, StateSpace(np.zeros((2, 2)), np.eye(2), 0.03 * np.eye(2), 0.4 * np.eye(2))),
    (LEVELS, StateSpace(np.zeros((2, 2)), np.eye(2), 0.01 * np.eye(2), 1.0 * np.eye(2))),
    (DIRECT, StateSpace(np.zeros((2, 2)), np.eye(2), 0.1 * np.eye(2), 0.5 * np.eye(2))),
    (
        ParallelPlant(
            4, TransferFunction([0.1], [1, 1, 0]), TransferFunction([0.02], [1, 1, 0])
        ),
        ModeController(pi(0.5, 100.0), pi(0.9, 60.0)),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("plant", "controller"), PROVEN)
def test_a_proven_level_holds_between_the_samples(
    plant: Plant, controller: StateSpace | ModeController
) -> None:
    """No frequency of 20,000, far beyond the loop's, exceeds what is proven."""
    found = analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, controller)
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.PROVEN, found.guarantee.reason
    both = (
        (controller.total, controller.difference)
        if isinstance(controller, ModeController)
        else (controller,)
    )
    blocks = central_blocks(plant, UNCERTAINTY)
    analysis = CentralisedAnalysis(blocks, both[: len(blocks.blocks)], UNCERTAINTY, PERFORMANCE)
    rng = np.random.default_rng(1)
    omega = np.exp(rng.uniform(np.log(1e-9), np.log(1e5), 20_000))
    assert analysis.robust_performance(omega).max() <= found.guarantee.level
    assert found.peaks is not None
    assert found.guarantee.level <= 1.00011 * found.peaks.robust_performance.value


def _one_level(gain: float) -> StateSpace:
    """PI on either loop of a plant of which the first input integrates."""
    return StateSpace(
        np.zeros((2, 2)), np.eye(2), np.diag([0.004, 0.02 * gain]), np.diag([0.4, 0.3 * gain])
    )


def test_where_one_input_integrates_and_the_controller_too_the_loop_is_proven() -> None:
    """(I + G C)^-1 has unlike orders at s = 0; poles are counted whichever way it is written."""
    performance = Performance(tau_p=100.0)
    found = analyse_centralised(ONE_LEVEL, UNCERTAINTY, performance, _one_level(1.0))
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.PROVEN, found.guarantee.reason
    assert found.peaks is not None
    assert found.guarantee.level <= 1.00011 * found.peaks.robust_performance.value
    blocks = central_blocks(ONE_LEVEL, UNCERTAINTY)
    omega = np.exp(np.random.default_rng(1).uniform(np.log(1e-5), np.log(1e5), 20_000))
    analysis = CentralisedAnalysis(blocks, (_one_level(1.0),), UNCERTAINTY, performance)
    assert analysis.robust_performance(omega).max() <= found.guarantee.level
    # Signs turned round: as many poles on the right, whatever another count says.
    wrong = CentralisedAnalysis(blocks, (_one_level(-1.0),), UNCERTAINTY, performance)
    assert not analyse_centralised(
        ONE_LEVEL, UNCERTAINTY, performance, _one_level(-1.0)
    ).nominally_stable
    _, guarantee = prove(wrong, Peak(1e6, 1.0))
    assert guarantee.status is GuaranteeStatus.OPEN
    assert "not those of another count" in (guarantee.reason or "")


def test_a_peak_that_was_missed_is_found() -> None:
    """The proof raises a peak that is too low to the one that the whole axis has."""
    plant, controller = PROVEN[0]
    assert isinstance(controller, ModeController)
    true = analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, controller).peaks
    assert true is not None
    blocks = central_blocks(plant, UNCERTAINTY)
    both = (controller.total, controller.difference)
    analysis = CentralisedAnalysis(blocks, both, UNCERTAINTY, PERFORMANCE)
    low = Peak(0.5 * true.robust_performance.value, 1e-3)
    peak, guarantee = prove(analysis, low)
    assert guarantee.status is GuaranteeStatus.PROVEN
    assert peak.value == pytest.approx(true.robust_performance.value, rel=1e-4)


@pytest.mark.parametrize("gain", [-0.5, 8.0, 30.0])
def test_an_unstable_loop_is_never_proven(gain: float) -> None:
    """The turns of the determinant count unstable poles whatever another count says."""
    controller = ModeController(pi(gain, 3.0), pi(2.0, 30.0))
    plant = first_order(2, 1.0, 10.0, 0.5, 2.0)
    blocks = central_blocks(plant, UNCERTAINTY)
    both = (controller.total, controller.difference)
    analysis = CentralisedAnalysis(blocks, both, UNCERTAINTY, PERFORMANCE)
    assert not analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, controller).nominally_stable
    _, guarantee = prove(analysis, Peak(1e6, 1.0))
    assert guarantee.status is GuaranteeStatus.OPEN


def _status(plant: Plant, controller: StateSpace | MatrixPlant) -> Centralised:
    found = analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, controller)
    assert found.guarantee is not None
    return found


def test_an_unstable_controller_of_a_stable_loop_is_proven() -> None:
    """Poles of the controller in the right half plane are counted."""
    plant = MatrixPlant([[TransferFunction([1.0], [1.0, 1.0])]])
    # C = (20 s + 4)/(s (s - 0.5)) holds it: s^3 + 0.5 s^2 + 19.5 s + 4 is a Hurwitz polynomial.
    controller = StateSpace([[0.5, 0.0], [1.0, 0.0]], [[1.0], [0.0]], [[20.0, 4.0]], [[0.0]])
    found = _status(plant, controller)
    assert found.nominally_stable
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.PROVEN


def test_all_forms_of_a_controller_are_proven_alike() -> None:
    """Transfer matrix, block diagonal, and a singular A whose integrator does not stand alone."""
    plant = MatrixPlant([[TransferFunction([1.0], [10.0, 1.0], 0.5)]])
    # 3 (10 s + 1)/(10 s (0.2 s + 1))
    transfer = MatrixPlant([[TransferFunction([30.0, 3.0], [2.0, 10.0, 0.0])]])
    chained = StateSpace([[-5.0, 0.0], [1.0, 0.0]], [[1.0], [0.0]], [[15.0, 1.5]], [[0.0]])
    forms = [_status(plant, controller) for controller in (transfer, chained)]
    for found in forms:
        assert found.guarantee is not None
        assert found.guarantee.status is GuaranteeStatus.PROVEN, found.guarantee.reason
        assert found.guarantee.level == pytest.approx(
            forms[0].guarantee.level if forms[0].guarantee else 0.0, rel=1e-8
        )


def test_an_oscillator_in_the_controller_is_refused() -> None:
    """A pole on the axis other than s = 0 is named; beside the axis it is proven like any."""
    plant = first_order(2, 1.0, 10.0, 0.0)

    def shaking(damping: float) -> ModeController:
        one = StateSpace(
            [[0.0, 1.0], [-1.0, -damping]], [[0.0], [1.0]], [[0.0, 0.05]], [[0.3]]
        ).beside(pi(0.5, 10.0))
        return ModeController(one, one)

    with pytest.raises(InvalidInputError, match="pole at 1 j"):
        analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, shaking(0.0))
    found = analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, shaking(1e-3))
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.PROVEN


def test_what_is_not_proven_says_why() -> None:
    """A double integrator in the controller's own states leaves the question open."""
    plant = first_order(1, 1.0, 10.0, 0.0)
    double = StateSpace([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[0.01, 0.3]], [[3.0]])
    found = analyse_centralised(plant, UNCERTAINTY, PERFORMANCE, ModeController(double, double))
    assert found.nominally_stable
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.OPEN
    assert "double pole" in (found.guarantee.reason or "")


def test_direct_dead_time_is_left_open() -> None:
    """Where a dead time feeds through, the loop has no limit at infinity, and nothing is proven."""
    plant = MatrixPlant([[TransferFunction([1.0, 1.0], [4.0, 1.0], 1.0)]])
    controller = StateSpace([[0.0]], [[1.0]], [[0.2]], [[0.4]])
    found = _status(plant, controller)
    assert found.nominally_stable
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.OPEN
    assert "any phase" in (found.guarantee.reason or "")


def test_units_change_nothing() -> None:
    """Time in other units, and inputs in others, leave proof and level as they are."""
    levels = []
    for time, gain in ((1.0, 1.0), (1e3, 1e-6), (1e-3, 1e6)):
        plant = MatrixPlant(
            [
                [
                    TransferFunction(
                        [gain * value for value in element.num],
                        [
                            value * time ** (len(element.den) - 1 - power)
                            for power, value in enumerate(element.den)
                        ],
                        time * element.dead_time,
                    )
                    if len(element.num) == 1
                    else TransferFunction(
                        [-gain * time, gain], [40 * time**2, 14 * time, 1]
                    )
                    for element in row
                ]
                for row in COUPLED.elements_by_row
            ]
        )  # fmt: skip
        controller = StateSpace(
            np.zeros((2, 2)), np.eye(2), 0.03 / (gain * time) * np.eye(2), 0.4 / gain * np.eye(2)
        )
        performance = dataclasses.replace(PERFORMANCE, tau_p=30.0 * time)
        found = analyse_centralised(
            plant, Uncertainty.from_error(0.2, time), performance, controller
        )
        assert found.guarantee is not None
        assert found.guarantee.status is GuaranteeStatus.PROVEN, found.guarantee.reason
        levels.append(found.guarantee.level)
    assert levels[1:] == pytest.approx([levels[0]] * 2, rel=1e-8)
