"""The level at a frequency does not depend on the frequencies beside it."""

import numpy as np
import pytest

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.robustness.curves import LoopAnalysis


@pytest.mark.parametrize("n", [3, 4])
@pytest.mark.parametrize("weakness", [0.1, 1e-7])
def test_order_of_frequencies_changes_nothing(n, weakness):
    """A nearly singular plant's scales far below and far above its crossover are far apart."""
    uncertainty, performance = Uncertainty.from_error(0.2, 1), Performance(tau_p=0.1 / weakness)
    loops = [Controller(20 * (1 + 0.3 * k), 4 * (1 + 0.2 * k)) for k in range(n)]
    plant = first_order(n, 1, 100, 1 - weakness)
    analysis = LoopAnalysis(*group_loops(plant, loops, uncertainty), uncertainty, performance)
    omega = analysis.omega
    order = np.random.default_rng(0).permutation(omega.size)
    for curve in (0, 1):
        level = analysis.level(curve, omega)[0]
        assert analysis.level(curve, omega[order])[0] == pytest.approx(level[order], rel=1e-6)
