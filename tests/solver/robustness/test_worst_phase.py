"""Bounds over every phase of a single loop."""

import math

import numpy as np
import pytest

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.recomputed import NOMINAL, ROBUST, STABILITY
from solver.robustness.axis import proven_peaks
from solver.robustness.curves import LoopAnalysis
from solver.robustness.record import GuaranteeStatus
from solver.robustness.worst_phase import any_phase, bound_beyond, far_phases
from tests.solver.robustness.unusual_loops import draw_any


@pytest.mark.parametrize("seed", range(40))
def test_no_frequency_beyond_has_a_higher_value(seed: int) -> None:
    """Random loops with feedthrough: the three curves stay below their bounds."""
    rng = np.random.default_rng(seed)
    num, den = (np.poly(-(10 ** rng.uniform(-2, 2, 2))) for _ in range(2))
    gain = 10 ** rng.uniform(-3, -0.1)
    plant = MatrixPlant([[TransferFunction(num.tolist(), den.tolist(), rng.uniform(0.1, 10))]])
    loop = Controller(gain, 10 ** rng.uniform(-1, 2), 0.3 if seed % 2 else None)
    uncertainty = Uncertainty.from_error(0.2, 1)
    performance = Performance(tau_p=10 ** rng.uniform(-1, 2), offset=0.1 if seed % 3 else 0.0)
    end = 10 ** rng.uniform(-1, 3)
    omega = end * np.geomspace(1, 1e6, 20_000)
    L = loop.response(omega) * plant.element(0, 0).response(omega)
    w_I, w_P = uncertainty.magnitude(omega), performance.magnitude(omega)
    stability, nominal = w_I * np.abs(L / (1 + L)), w_P / np.abs(1 + L)
    curves = {ROBUST: stability + nominal, STABILITY: stability, NOMINAL: nominal}
    bounds = {
        curve: bound_beyond(plant, uncertainty, performance, (loop,), curve=curve, end=end)
        for curve in curves
    }
    for curve, values in curves.items():
        if np.abs(L).max() < 1:
            assert values.max() <= bounds[curve]
        else:
            assert math.isinf(bounds[curve])


def test_the_bound_is_reached_far_out() -> None:
    """The worst phase occurs: the bound is no more than the supremum."""
    plant = MatrixPlant([[TransferFunction([1.0], [1.0], 5.0)]])
    loop, uncertainty, performance = (
        Controller(0.1, 10), Uncertainty.from_error(0.2, 1), Performance(tau_p=100),
    )  # fmt: skip
    bound = bound_beyond(plant, uncertainty, performance, (loop,), curve=ROBUST, end=1e6)
    omega = far_phases(plant, 1e6)
    L = loop.response(omega) * plant.element(0, 0).response(omega)
    values = uncertainty.magnitude(omega) * np.abs(L / (1 + L))
    values += performance.magnitude(omega) / np.abs(1 + L)
    assert values.max() == pytest.approx(bound, rel=1e-3)
    assert bound == pytest.approx((2 * 0.1 + 0.5) / 0.9, rel=1e-9)


def test_only_dead_time_that_is_fed_through_counts() -> None:
    """What dies away at infinity, or comes at once, has no phase there."""
    away, at_once = TransferFunction([1], [1, 1], 4), TransferFunction([1, 2], [1, 1])
    through = TransferFunction([1, 2], [1, 1], 3)
    assert any_phase(MatrixPlant([[away, at_once], [through, away]])) == [3.0]
    assert far_phases(MatrixPlant([[away]]), 1.0).size == 0


@pytest.mark.parametrize("seed", range(12))
def test_no_frequency_beyond_has_a_higher_bound_of_several_loops(seed: int) -> None:
    """Two and three loops, both structures, unlike outputs: mu's own bound stays below."""
    rng = np.random.default_rng(seed)
    n = 2 + seed % 2
    plant = MatrixPlant(
        [
            [
                TransferFunction(
                    (rng.uniform(-1, 1) * np.poly(-(10 ** rng.uniform(-1, 1, 1)))).tolist(),
                    np.poly(-(10 ** rng.uniform(-1, 1, 1))).tolist(),
                    float(rng.choice([0.0, rng.uniform(0.1, 5)])),
                )
                for _ in range(n)
            ]
            for _ in range(n)
        ]
    )
    loops = [Controller(10 ** rng.uniform(-2, -0.8), 10 ** rng.uniform(-1, 1)) for _ in range(n)]
    uncertainty = Uncertainty.from_error(0.2, 1)
    scales = None
    if seed % 3 == 0:
        uncertainty = Uncertainty(uncertainty.weight, Structure.FULL)
    else:
        scales = tuple(10 ** rng.uniform(-1, 1, n))
    performance = Performance(tau_p=10 ** rng.uniform(-1, 2), output_scale=scales)
    blocks, controllers = group_loops(plant, loops, uncertainty, scales)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    end = 10 ** rng.uniform(0, 3)
    omega = end * np.geomspace(1, 1e4, 500)
    for curve in (ROBUST, STABILITY, NOMINAL):
        bound = bound_beyond(plant, uncertainty, performance, loops, curve=curve, end=end)
        assert math.isfinite(bound)
        assert analysis.level(curve, omega)[0].max() <= bound


def test_several_loops_are_proven_up_to_infinity() -> None:
    """Their peak is far below the axis's end, where any phase is bounded well enough."""
    drawn = draw_any(np.random.default_rng(20171))
    assert drawn.plant.n == 2
    assert any_phase(drawn.plant)
    found = proven_peaks(drawn.plant, drawn.uncertainty, drawn.performance, drawn.loops)
    assert found.guarantee.status is GuaranteeStatus.PROVEN
    assert found.peaks.robust_performance.value == pytest.approx(87.2986, rel=1e-4)
