"""The bound by semidefinite programming beside the kernel's."""

from __future__ import annotations

import pytest
from zoo import ZOO, Case

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.peaks import Peak
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.robustness.cross_check import cross_check
from solver.robustness.curves import LoopAnalysis


@pytest.mark.parametrize("case", ZOO[:8], ids=str)
@pytest.mark.parametrize("omega", [0.01, 0.3])
def test_both_methods_give_the_same_bound(case: Case, omega: float) -> None:
    """Kernel and semidefinite program agree on plants with and without symmetry."""
    blocks, controllers = group_loops(case.plant, case.loops, case.uncertainty)
    analysis = LoopAnalysis(blocks, controllers, case.uncertainty, case.performance)
    found = cross_check(analysis, Peak(1.0, omega))
    assert found.sdp == pytest.approx(found.kernel, rel=1e-5)
    assert found.agree


def test_too_many_channels_are_refused() -> None:
    """A program that would take minutes is refused by name."""
    n = 30
    loops = [Controller(1.0 + 0.1 * i, 10.0) for i in range(n)]
    plant, uncertainty = first_order(n, 1.0, 10.0, 0.01), Uncertainty.from_error(0.2, 1.0)
    blocks, controllers = group_loops(plant, loops, uncertainty)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, Performance(tau_p=20.0))
    with pytest.raises(InvalidInputError, match="up to 20 channels"):
        cross_check(analysis, Peak(1.0, 0.1))
