"""Identical loops: the scale in closed form beside the general kernel."""

import numpy as np
import pytest

from solver.model.blocks import reduce
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep, upper_bound
from solver.mu.structure import BlockStructure

OMEGA = np.geomspace(1e-4, 1e2, 121)
UNCERTAINTY = Uncertainty.from_error(0.2, 1)


def levels(plant, k, tau_I, *, all_free):
    """Log levels of identical PI loops, their slopes in c, and the weight |w_P|^2 used."""
    blocks = reduce(plant, (tuple(range(plant.n)),))
    c = (k * (1 + 1 / (1j * OMEGA * tau_I)))[:, None]
    b = Performance(tau_p=30).magnitude(OMEGA) ** 2 if all_free else np.ones_like(OMEGA)
    u = blocks.squared(UNCERTAINTY, OMEGA)
    y = np.zeros((OMEGA.size, blocks.n_scales))
    G = blocks.packed(OMEGA)
    t, slope, _ = sweep(G, c, u, b, blocks.layout, all_free=all_free, nu=FINE, cold=True, y=y)
    return t, slope[:, 0], c[:, 0], b


@pytest.mark.parametrize(("n", "a"), [(2, 0.949), (2, 0.0), (3, 0.5), (5, -0.2), (1, 0.0)])
@pytest.mark.parametrize(("k", "tau_I"), [(30.0, 30.0), (8.0, 100.0), (0.5, 3.0)])
def test_closed_form_equals_the_general_bound(n, a, k, tau_I):
    """mu of N_RP as a whole, n scales of its own, is that of the closed form."""
    plant = first_order(n, 1, 100, a)
    t, _, c, b = levels(plant, k, tau_I, all_free=True)
    G = plant.response(OMEGA)
    S = np.linalg.inv(np.eye(n) + G * c[:, None, None])
    w_I, w_P = UNCERTAINTY.magnitude(OMEGA)[:, None, None], np.sqrt(b)[:, None, None]
    upper = np.concatenate([w_I * c[:, None, None] * S @ G, w_I * c[:, None, None] * S], axis=2)
    N = np.concatenate([upper, np.concatenate([w_P * S @ G, w_P * S], axis=2)], axis=1)
    mu = upper_bound(N, BlockStructure(tuple(range(n)), n)).mu
    assert np.exp(-t / 2) == pytest.approx(mu, rel=2e-9)


@pytest.mark.parametrize("all_free", [True, False])
def test_slopes_are_exact_where_the_blocks_meet(all_free):
    """Central differences in the gain agree, on either side of a meeting and at it."""
    plant, h = first_order(2, 1, 100, 0.949), 1e-6
    t, slope, c, _ = levels(plant, 30.0, 30.0, all_free=all_free)
    up = levels(plant, 30.0 * np.exp(h), 30.0, all_free=all_free)[0]
    down = levels(plant, 30.0 * np.exp(-h), 30.0, all_free=all_free)[0]
    known = np.isfinite(t)
    assert known.any()
    assert (slope * c).real[known] == pytest.approx(((up - down) / (2 * h))[known], abs=2e-4)
