"""Frequencies side by side in vector registers: the kernel's own levels, and bounds like them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from zoo import COLUMN, interactions

from solver.model.blocks import group_loops, reduce
from solver.model.controllers import Controller
from solver.model.plants import ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.batch import batch
from solver.mu.kernel import FINE
from solver.mu.lanes import WIDTH, exp, load, log, store
from solver.mu.scaling import sweep
from solver.mu.side_by_side import sweep as sweep_side_by_side
from solver.mu.structure import BlockStructure, bound_of_scales
from solver.mu.workspace import compiled
from solver.robustness.analysis import LoopAnalysis

OMEGA = np.geomspace(1e-4, 1e2, 45)


@compiled
def exp_and_log(values, out):
    """Exponentials of the first row, logarithms of the second."""
    store(out, 0, exp(load(values, 0)))
    store(out, 1, log(load(values, 1)))


@given(
    st.lists(st.floats(-690, 690), min_size=WIDTH, max_size=WIDTH),
    st.lists(st.floats(1e-300, 1e300) | st.floats(0.5, 2), min_size=WIDTH, max_size=WIDTH),
)
def test_exp_and_log_are_right_to_the_last_places(exponents, numbers):
    """Both agree with the C library's to two units in the last place over the whole range."""
    values, out = np.array([exponents, numbers]), np.empty((2, WIDTH))
    exp_and_log(values, out)
    assert out[0] == pytest.approx(np.exp(values[0]), rel=5e-16, abs=0)
    assert out[1] == pytest.approx(np.log(values[1]), rel=5e-16, abs=0)


@st.composite
def loops(draw):
    """Blocks, c and |w_I|^2 of a loop with two different controllers."""
    structure = draw(st.sampled_from(list(Structure)))
    n = draw(st.integers(2, 40))
    column = draw(st.integers(0, 3)) == 0
    errors, speeds = draw(
        st.tuples(
            st.lists(st.floats(0.05, 0.9), min_size=2, max_size=2),
            st.lists(st.floats(-1, 1), min_size=2, max_size=2),
        )
    )
    first = 1 if column else draw(st.integers(1, n - 1))
    each = [0] * first + [1] * ((2 if column else n) - first)
    u = Uncertainty.from_error(
        [errors[i] for i in each], [10 ** speeds[i] for i in each], structure
    )
    if column:
        blocks = reduce(COLUMN, ((0,), (1,)), u)
    else:
        plant = first_order(
            n, draw(st.sampled_from([1.0, -2.0])), draw(st.floats(1, 100)),
            draw(interactions(-0.99 / (n - 1), 0.99)), draw(st.sampled_from([0.0, 1.5])),
        )  # fmt: skip
        blocks = reduce(plant, (tuple(range(first)), tuple(range(first, n))), u)
    sign = np.sign(blocks.plant.element(0, 0).static_gain)
    controllers = [
        Controller(sign * 10 ** draw(st.floats(-1, 2)), 10 ** draw(st.floats(0, 2)))
        for _ in range(2)
    ]
    c = np.stack([controller.response(OMEGA) for controller in controllers], axis=1)
    return blocks, c, blocks.squared(u, OMEGA)


@st.composite
def large_loops(draw):
    """Blocks, c and |w_I|^2 of a loop with three to five different controllers."""
    groups = draw(st.integers(3, 5))
    sizes = draw(st.lists(st.integers(1, 4), min_size=groups, max_size=groups))
    each = [group for group, size in enumerate(sizes) for _ in range(size)]
    n = len(each)
    errors = draw(st.lists(st.floats(0.05, 0.9), min_size=groups, max_size=groups))
    structure = draw(st.sampled_from(list(Structure)))
    u = Uncertainty.from_error([errors[i] for i in each], [1.0] * n, structure)
    plant = first_order(
        n, draw(st.sampled_from([1.0, -2.0])), draw(st.floats(1, 100)),
        draw(interactions(-0.99 / (n - 1), 0.99)), draw(st.sampled_from([0.0, 1.5])),
    )  # fmt: skip
    ends = np.cumsum([0, *sizes])
    blocks = reduce(plant, tuple(tuple(range(*pair)) for pair in pairwise(ends)), u)
    sign = np.sign(plant.element(0, 0).static_gain)
    controllers = [
        Controller(sign * 10 ** draw(st.floats(-1, 2)), 10 ** draw(st.floats(0, 2)))
        for _ in range(groups)
    ]
    c = np.stack([controller.response(OMEGA) for controller in controllers], axis=1)
    return blocks, c, blocks.squared(u, OMEGA)


@settings(max_examples=100, deadline=None)
@given(loops() | large_loops(), st.booleans(), st.sampled_from([FINE, 1e-5]), st.floats(0, 3))
def test_levels_are_those_of_the_kernel(loop, all_free, nu, log_tau_p):
    """From the same scales the kernel, one frequency at a time, ends at the same level.

    They differ by the barrier parameter at most, which is what the level is right to, and by
    rounding at most frequencies; where the kernel finds no level there is none.
    """
    blocks, c, u = loop
    b = Performance(tau_p=10**log_tau_p).magnitude(OMEGA) ** 2 if all_free else np.ones_like(OMEGA)
    b[::9] = 0.0 if all_free else 1.0
    G = blocks.packed(OMEGA)
    y = np.zeros((OMEGA.size, blocks.n_scales))
    sweep(G, c, u, b, blocks.layout, all_free=all_free, nu=1e-3, cold=True, y=y)
    alone = y.copy()
    t, slope, det = sweep(G, c, u, b, blocks.layout, all_free=all_free, nu=nu, cold=False, y=y)
    for k in range(OMEGA.size):
        at = slice(k, k + 1)
        level, slope_alone, det_alone = sweep(
            G[at], c[at], u[at], b[at], blocks.layout, all_free=all_free, nu=nu, cold=False,
            y=alone[at],
        )  # fmt: skip
        assert np.isfinite(t[k]) == np.isfinite(level[0])
        if np.isfinite(t[k]):
            assert t[k] == pytest.approx(level[0], abs=10 * nu)
        else:
            assert t[k] == level[0]
            assert (slope[k] == 0).all()
            assert (slope_alone == 0).all()
        assert det[k] == pytest.approx(det_alone[0], rel=1e-11)


@pytest.mark.parametrize("count", [*range(1, 2 * WIDTH + 2), 61])
def test_any_number_of_frequencies(count):
    """Lanes that are not filled change nothing, and no frequency is left out."""
    blocks, controllers = group_loops(
        first_order(2, 1, 100, 0.9), [Controller(40, 60), Controller(20, 10)]
    )
    omega = np.geomspace(1e-3, 1, count)
    c = np.stack([controller.response(omega) for controller in controllers], axis=1)
    G = blocks.packed(omega)
    u = blocks.squared(Uncertainty.from_error(0.2, 1), omega)
    b = np.ones(count)
    y, alone = np.zeros((count, 2)), np.zeros((count, 2))
    t, slope, _ = sweep(G, c, u, b, blocks.layout, all_free=False, nu=FINE, cold=True, y=y)
    for k in range(count):
        at = slice(k, k + 1)
        level, slope_alone, _ = sweep(
            G[at], c[at], u[at], b[at], blocks.layout, all_free=False, nu=FINE, cold=True,
            y=alone[at],
        )  # fmt: skip
        assert t[k] == pytest.approx(level[0], abs=1e-11)
        assert slope[k] == pytest.approx(slope_alone[0], rel=1e-5)


@pytest.mark.parametrize("n", [2, 4])
def test_a_level_does_not_depend_on_its_lane(n):
    """In another order, beside other frequencies, each has the same digits."""
    rng = np.random.default_rng(n)
    loops = [Controller(40.0 / (1 + i), 60.0 / (1 + 3 * i)) for i in range(n)]
    blocks, controllers = group_loops(first_order(n, 1, 100, 0.9), loops)
    c = np.stack([controller.response(OMEGA) for controller in controllers], axis=1)
    G, u = blocks.packed(OMEGA), blocks.squared(Uncertainty.from_error(0.2, 1), OMEGA)
    b = np.ones(OMEGA.size)
    start = np.zeros((OMEGA.size, n))
    sweep(G, c, u, b, blocks.layout, all_free=False, nu=1e-4, cold=True, y=start)
    start += 0.1 * rng.standard_normal(start.shape)
    found = []
    for order in (np.arange(OMEGA.size), rng.permutation(OMEGA.size)):
        y = start[order]
        level, slope, _ = sweep(
            G[order], c[order], u[order], b, blocks.layout, all_free=False, nu=FINE, cold=False, y=y
        )
        back = np.argsort(order)
        found.append(np.column_stack([level, slope.real, slope.imag, y])[back])
    assert (found[0] == found[1]).all()


def test_level_is_the_norm_at_its_scales():
    """The mu reported is the largest singular value of D N D^-1 for the scales beside it."""
    loops = [Controller(40, 60), Controller(20, 10)]
    blocks, controllers = group_loops(first_order(2, 1, 100, 0.9), loops)
    uncertainty, performance = Uncertainty.from_error(0.2, 1), Performance(tau_p=25)
    c = np.stack([controller.response(OMEGA) for controller in controllers], axis=1)
    u, b = blocks.squared(uncertainty, OMEGA), performance.magnitude(OMEGA) ** 2
    y = np.zeros((OMEGA.size, 2))
    G = blocks.packed(OMEGA)
    t, _, _ = sweep(G, c, u, b, blocks.layout, all_free=True, nu=FINE, cold=True, y=y)
    N = LoopAnalysis(blocks, controllers, uncertainty, performance).matrices(OMEGA)[0]
    bound = bound_of_scales(N, np.exp(y / 2), BlockStructure((0, 1), 2))
    assert np.exp(-t / 2) == pytest.approx(bound.mu, rel=1e-12)


@compiled
def solved_side_by_side(G, c, u, layout):
    """Which frequencies are solved without the kernel's help, the level being skewed."""
    count, blocks = u.shape[0], layout.first.size - 1
    done, all_free, cold = np.zeros(count, np.bool_), False, True
    sweep_side_by_side(
        G, c, u, np.ones(count), layout, all_free, FINE, cold, np.zeros((count, 2)),
        batch(layout.channels.size, blocks, c.shape[1], 2), np.empty(count),
        np.empty(c.shape, np.complex128), np.empty((count, blocks), np.complex128), done,
    )  # fmt: skip
    return done


def test_most_frequencies_need_no_help():
    """The kernel is left with less than a fifth: else nothing would be gained."""
    blocks, controllers = group_loops(
        first_order(2, 1, 100, 0.949), [Controller(47, 100), Controller(19, 2.4)]
    )
    c = np.stack([controller.response(OMEGA) for controller in controllers], axis=1)
    u = blocks.squared(Uncertainty.from_error(0.2, 1), OMEGA)
    done = solved_side_by_side(blocks.packed(OMEGA), c, u, blocks.layout)
    assert done.mean() > 0.8


@pytest.mark.parametrize("n", [2, 3])
def test_levels_of_an_integrating_loop_are_the_same_from_either_end_of_the_axis(n):
    """With integral action 1e10 times slower than the loop a level starts at 1e40 of the weight."""
    process = TransferFunction([0.02], [1, 0], dead_time=2)
    plant = ParallelPlant(n, process, TransferFunction([0.01 / n], [1, 0], dead_time=2))
    u = Uncertainty.from_error(0.7, 1)
    blocks = reduce(plant, [[unit] for unit in range(n)], u)
    omega = np.geomspace(1e-14, 1e-2, 25)
    found = []
    for order in (slice(None), slice(None, None, -1)):
        there = omega[order]
        c = np.stack([Controller(1.4, 1e12).response(there)] * n, axis=1)
        y = np.zeros((there.size, blocks.n_scales))
        level = sweep(
            blocks.packed(there), c, blocks.squared(u, there), np.ones(there.size),
            blocks.layout, False, FINE, True, y,
        )[0]  # fmt: skip
        found.append(level[order])
    assert found[0] == pytest.approx(found[1], rel=1e-8)
