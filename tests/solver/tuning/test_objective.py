import math
from dataclasses import replace

import numpy as np
import pytest
from zoo import SLH, USUAL

from solver.model.blocks import reduce
from solver.model.plants import first_order
from solver.model.weights import Performance
from solver.tuning.goals import MuGoal, TauGoal
from solver.tuning.objective import LoopObjective
from solver.tuning.specification import ControllerKind

OMEGA = np.geomspace(1e-4, 30, 40)


def objective(plant, groups, goal, kind=ControllerKind.PI):
    signs = np.ones(len(groups))
    return LoopObjective(reduce(plant, groups), USUAL, goal, kind=kind, signs=signs, omega=OMEGA)


@pytest.mark.parametrize("goal", [TauGoal(Performance()), MuGoal(Performance(tau_p=20))])
@pytest.mark.parametrize(
    ("plant", "groups", "values", "kind"),
    [
        (SLH, [[0], [1]], [46.3, 101, 22.8, 3.15], ControllerKind.PI),
        (SLH, [[0, 1]], [39.7, 65.1], ControllerKind.PI),
        (SLH, [[0], [1]], [60, 90, 0.4, 30, 2, 0.5], ControllerKind.PID),
        (SLH, [[0], [1]], [60, 90, 0.4, 30, 2, 0.5], ControllerKind.PIF),
        (SLH, [[0], [1]], [60, 90, 0.4, 0.1, 30, 2, 0.5, 3], ControllerKind.PIDF),
        (first_order(5, 1, 40, -0.2), [[0, 1], [2, 3, 4]], [12, 30, 9, 12], ControllerKind.PI),
        (first_order(3, 1, 40, 0.2), [[0], [1], [2]], [12, 30, 9, 12, 8, 10], ControllerKind.PI),
    ],
)
def test_gradients_are_exact(plant, groups, values, kind, goal):
    """Every frequency's gradient equals central differences to 1e-4, kinks included."""
    task = objective(plant, groups, goal, kind)
    theta = np.log(values)
    here = task.evaluate(theta)
    for index in range(theta.size):
        step = np.zeros(theta.size)
        step[index] = 1e-4
        above = task.levels(theta + step, OMEGA)
        below = task.levels(theta - step, OMEGA)
        assert here.gradient[:, index] == pytest.approx((above - below) / 2e-4, abs=1e-4)


def test_tau_p_of_the_published_settings():
    """The skewed form gives the tau_P at which mu is 1: about 19.01 for the published settings."""
    theta, omega = np.log([46.3, 101, 22.8, 3.15]), np.array([0.0314362])
    task = objective(SLH, [[0], [1]], TauGoal(Performance()))
    tau_p = math.exp(task.goal.attained(task.levels(theta, omega), omega)[0])
    assert tau_p == pytest.approx(19.01, abs=0.005)
    unskewed = replace(task, goal=MuGoal(Performance(tau_p=tau_p)))
    assert unskewed.levels(theta, omega) == pytest.approx([0], abs=1e-7)


def test_permitted_offset_enters_the_demand():
    """attained() inverts demand() with A > 0 as well."""
    goal = TauGoal(Performance(max_peak=2, offset=0.2))
    omega = np.array([0.1, 0.5, 2.0])
    for s in (-1.0, 0.5, 2.0):
        level, slope = goal.demand(s, omega)
        assert goal.attained(level, omega) == pytest.approx([s] * 3, rel=1e-9)
        nearby = goal.demand(s + 1e-6, omega)[0]
        assert slope == pytest.approx((nearby - level) / 1e-6, rel=1e-4)


def test_unstable_settings_have_no_value():
    """Gains that destabilise are infinitely bad, however mu reads on the grid."""
    task = objective(first_order(2, 1, 10, 1.5), [[0, 1]], MuGoal(Performance(tau_p=20)))
    assert task.evaluate(np.log([3.0, 8.0])).value == math.inf


def test_followed_peaks_are_the_highest_points_beside_them():
    """A neighbour's peaks, started a tenth off, end where no point beside them is higher."""
    theta = np.log([46.3, 101, 22.8, 3.15])
    task = replace(
        objective(SLH, [[0], [1]], TauGoal(Performance())), followed=np.array([0.0314362 * 1.1])
    )
    first = task.evaluate(theta)
    here = task.evaluate(theta, near=first)
    peak = here.peaks[0]
    assert peak == pytest.approx(0.03144, rel=2e-3)
    beside = peak * np.exp(np.linspace(-0.1, 0.1, 41))
    excess = task.goal.demand(here.s, beside)[0] - task.levels(theta, beside)
    at_peak = task.goal.demand(here.s, here.peaks)[0] - task.levels(theta, here.peaks)
    assert excess.max() <= at_peak[0] + 1e-7
