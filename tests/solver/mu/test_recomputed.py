"""Curves recomputed from D-scales by compiled code: those of N_RP itself."""

from dataclasses import replace

import numpy as np
import pytest

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.mu.recomputed import NOMINAL, ROBUST, STABILITY
from solver.mu.structure import sigma_max
from solver.robustness.block_bounds import greatest_bound
from solver.robustness.curves import LoopAnalysis

OMEGA = np.geomspace(1e-6, 1e4, 40)
USUAL = Uncertainty.from_error(0.2, 1)
OF_OUTPUTS = replace(USUAL, outputs=Uncertainty.from_error(0.1, 0.5))
LOOPS = [Controller(40, 60), Controller(20, 3), Controller(0.1, None, 9), Controller(9, 1e3)]
INTEGRATING = MatrixPlant(
    [
        [TransferFunction((1,), (1, 0)), TransferFunction((-0.5,), (20, 1), 2)],
        [TransferFunction((1e-3,), (5, 1)), TransferFunction((1e3,), (300, 1))],
    ]
)


@pytest.mark.parametrize(
    ("plant", "loops", "uncertainty", "errors"),
    [
        (first_order(1, 1, 100, 0), LOOPS[:1], USUAL, None),
        (first_order(2, 1, 100, 0.99), LOOPS[:2], USUAL, None),
        (first_order(40, 1, 100, -0.02), LOOPS[:1] * 25 + LOOPS[1:2] * 15, USUAL, None),
        (first_order(4, 1, 100, 0.5), LOOPS, USUAL, None),
        (INTEGRATING, LOOPS[:2], USUAL, (1.0, 1e-4)),
        (INTEGRATING, LOOPS[1:3], OF_OUTPUTS, (1.0, 50.0)),
    ],
)
def test_recomputed_curves_are_those_of_the_interconnection(plant, loops, uncertainty, errors):
    """Of one to four settings, means and differences, integrators, units, outputs that err."""
    performance = Performance(tau_p=20.0, output_scale=errors)
    blocks, controllers = group_loops(plant, loops, uncertainty, errors)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    matrices = analysis.matrices(OMEGA)
    for curve in (ROBUST, STABILITY):
        found, d = analysis.level(curve, OMEGA)
        expected = greatest_bound(blocks, matrices, d, performance=curve == ROBUST)
        assert found == pytest.approx(expected, rel=1e-11)
    norms = [
        sigma_max(N[:, block.size :, block.size :])
        for block, N in zip(blocks.blocks, matrices, strict=True)
    ]
    found, d = analysis.level(NOMINAL, OMEGA)
    assert found == pytest.approx(np.max(norms, axis=0), rel=1e-11)
    assert (d == 1).all()


def test_a_singular_loop_has_no_number_and_says_so():
    """1 + g c = 0 at a frequency: its level is no number, and no value is made of it."""
    plant = MatrixPlant([[TransferFunction((-1.0,), (1.0,))]])
    blocks, controllers = group_loops(plant, [Controller(1.0, None)])
    analysis = LoopAnalysis(blocks, controllers, USUAL, Performance(tau_p=1.0))
    assert np.isnan(analysis.level(NOMINAL, np.array([1.0]))[0]).all()
    with pytest.raises(ArithmeticError, match="singular at omega = 1 rad"):
        analysis.nominal_performance(np.array([1.0]))
