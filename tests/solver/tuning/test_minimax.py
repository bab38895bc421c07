"""Descents where like controllers have nearly equal settings, and what symmetry leaves out."""

from dataclasses import replace

import numpy as np
import pytest
from zoo import USUAL

from solver.model.blocks import reduce
from solver.model.plants import first_order
from solver.model.weights import Performance
from solver.tuning.goals import TauGoal
from solver.tuning.groupings import consecutive
from solver.tuning.minimax import minimise
from solver.tuning.objective import LoopObjective
from solver.tuning.program import mirrored_planes
from solver.tuning.search import FoundOptimum, Freedom, GroupingSearch
from solver.tuning.specification import Arrangement, ControllerKind, Specification
from solver.tuning.together import Together
from solver.tuning.tuner import tune

OMEGA = np.geomspace(1e-4, 30, 80)
PAIRS = np.array([(0, 1), (0, 2), (1, 2)])


def three_loops():
    """Three PI controllers of their own, of which any two may change places."""
    blocks = reduce(first_order(3, 1, 40, 0.4), [[0], [1], [2]])
    part = LoopObjective(
        blocks, USUAL, TauGoal(Performance()), ControllerKind.PI, np.ones(3), OMEGA
    )
    return Together((part,), PAIRS)


def six_loops(kind, five, one):
    """The search for six independent controllers, and settings of which five are equal."""
    task = Specification(
        first_order(6, 1, 100, 0.5), USUAL, Performance(), kind=kind,
        arrangement=Arrangement.INDEPENDENT,
    )  # fmt: skip
    search = GroupingSearch(task, Freedom.usual(task, consecutive((1,) * 6)), lambda: None)
    return search, np.log([*five * 5, *one])


def test_mirrored_planes_are_those_of_the_controllers_exchanged():
    """Each is the tangent plane of an evaluation with two of them exchanged; none cuts off here."""
    task = three_loops()
    here = task.evaluate(np.log([12, 30, 12.4, 31, 11.5, 28]))
    room = here.level - here.demand
    A, limits = np.empty((PAIRS.size * OMEGA.size, 8)), np.empty(PAIRS.size * OMEGA.size)
    rows = mirrored_planes(
        here.gradient, room, here.demand_slope, here.theta, 2, PAIRS, A, limits, 0
    )
    assert rows > 0
    assert (limits[:rows] >= 0).all()
    expected = []
    for pair in PAIRS:
        theta = here.theta.reshape(3, 2).copy()
        theta[pair] = theta[pair[::-1]]
        there = task.evaluate(theta.ravel())
        assert there.level == pytest.approx(here.level, abs=1e-7)
        limit = there.level - here.demand + there.gradient @ (here.theta - there.theta)
        expected += [
            (*-gradient, one)
            for gradient, one, own in zip(there.gradient, limit, room, strict=True)
            if own <= 0.1 and one >= own
        ]
    found = np.column_stack([A[:rows, :6], limits[:rows]])
    assert found == pytest.approx(np.array(expected), abs=1e-5)


def test_a_ridge_of_equal_settings_is_followed():
    """Back to five equal PID controllers and another one: a third of the evaluations, and lower."""
    search, theta = six_loops(ControllerKind.PID, [32.3, 72.7, 0.396], [1.53, 1.014, 28.1])
    theta[4] += 1.0
    ends, evaluations = [], []
    for task in (replace(search.objective, alike=PAIRS[:0]), search.objective):
        looks = []
        start = task.evaluate(theta)
        end = minimise(task, start, search.box, tolerance=1e-5, checkpoint=looks.append)
        ends.append(end.value)
        evaluations.append(len(looks))
    assert ends[1] < ends[0] + 1e-5
    assert evaluations[1] < 0.6 * evaluations[0]


def test_steps_that_symmetry_repeats_are_left_out():
    """Of five controllers as good as equal one is moved, and the one unlike them."""
    search, theta = six_loops(ControllerKind.PI, [30, 70], [10, 200])
    search.optima, moved = [FoundOptimum(theta, 1.0, 1)], []
    search.descend = lambda theta, count: moved.append((theta, count))
    search.hop()
    assert len(moved) == 4  # tau_I of each of the two kinds, up and down
    assert all(count == 0 for _, count in moved)


def test_four_loops_end_at_the_best_optimum():
    """Near the limit the four settings are all unlike, and the valley that holds them is flat."""
    plant = first_order(4, 1, 100, -0.97 / 3)
    task = Specification(plant, USUAL, Performance(), arrangement=Arrangement.INDEPENDENT, seed=1)
    assert tune(task).tau_p == pytest.approx(24.66344, rel=1e-4)
