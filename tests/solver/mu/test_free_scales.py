"""Upper bounds where some D-scales are free: no performance block, or blocks that do not meet."""

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.analysis import analyse


@pytest.mark.parametrize("scales", [(0,), (0, 0, 0)])
def test_one_full_block_alone_is_its_norm(scales: tuple[int, ...]) -> None:
    """With a single block no scale matters: mu is the largest singular value."""
    size = len(scales)
    real, imaginary = np.random.default_rng(1).standard_normal((2, 20, size, size))
    N = real + 1j * imaginary
    bound = upper_bound(N, BlockStructure(scales, 0))
    assert bound.mu == pytest.approx(np.linalg.norm(N, 2, axis=(1, 2)), rel=1e-12)


@pytest.mark.parametrize("performance", [0, 2])
def test_blocks_that_do_not_meet(performance: int) -> None:
    """A diagonal N leaves every scale free; mu is its largest entry."""
    size = 2 + performance
    N = np.diag(np.arange(size, 0, -1)).astype(complex)[None]
    bound = upper_bound(N, BlockStructure((0, 1), performance))
    assert bound.mu[0] == pytest.approx(size, rel=1e-12)


def test_robust_stability_of_a_loop_that_is_nearly_singular_at_low_frequency() -> None:
    """Three groups under integral action: the curve of robust stability is finite throughout."""
    loops = (Controller(20, 100.1),) * 2 + (Controller(10, 20),) * 2 + (Controller(5, 5),)
    found = analyse(
        first_order(5, 1, 100, 0.9, 0.3),
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=40),
        loops,
    )
    assert found.curves is not None
    assert np.all(np.isfinite(found.curves.robust_stability))
    assert np.all(found.curves.robust_stability > 0)
