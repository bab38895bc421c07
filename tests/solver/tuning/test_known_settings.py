"""Re-tuning from known settings: local, no worse than these, and cheap."""

import math
from dataclasses import replace

import numpy as np
import pytest
from zoo import SLH, USUAL

from solver.model.blocks import group_loops
from solver.model.plants import first_order
from solver.model.weights import Performance
from solver.robustness.curves import LoopAnalysis
from solver.tuning.objective import LoopObjective
from solver.tuning.record import Status
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

FINER = 40  # times as many frequencies as an analysis takes


def task(plant, arrangement, **more):
    return Specification(plant, USUAL, Performance(), arrangement=arrangement, **more)


@pytest.mark.parametrize("arrangement", [Arrangement.IDENTICAL, Arrangement.INDEPENDENT])
def test_a_changed_request_is_tuned_anew_in_few_evaluations(monkeypatch, arrangement):
    """From the optimum for a = 0.949 that for 0.945 takes a score of evaluations, and is that."""
    plant = first_order(2, 1.0, 100.0, 0.945)
    known = tune(task(SLH, arrangement, remarks=False))
    whole = tune(task(plant, arrangement, remarks=False))
    calls, evaluate = [], LoopObjective.evaluate

    def counted(self, theta, **more):
        calls.append(theta)
        return evaluate(self, theta, **more)

    monkeypatch.setattr(LoopObjective, "evaluate", counted)
    found = tune(task(plant, arrangement, start=known.loops, remarks=False))
    assert found.status is Status.LOCAL
    assert found.tau_p == pytest.approx(whole.tau_p, rel=1e-7)
    assert len(calls) <= 25


@pytest.mark.parametrize("rough", [False, True])
def test_known_settings_are_not_left_for_worse_ones(rough):
    """The best identical settings stay the best where the search begins with them.

    The optimum of the search's grid is beside them, and 3e-5 worse on the whole axis.
    """
    plant = first_order(2, 1.0, 100.0, 0.827 * 0.996)
    best = tune(task(plant, Arrangement.IDENTICAL, remarks=False))
    again = tune(task(plant, Arrangement.IDENTICAL, remarks=False, start=best.loops, rough=rough))
    assert again.tau_p <= best.tau_p * (1 + 1e-8)


def test_ranges_of_settings_end_where_the_level_is_exceeded():
    """At its end mu of each range is that of the level, on a grid much finer than the tuner's."""
    result = tune(task(SLH, Arrangement.INDEPENDENT))
    near = result.settings_tolerance
    demand = Performance(tau_p=near.tau_p)

    def highest(loops):
        analysis = LoopAnalysis(*group_loops(SLH, loops, USUAL), USUAL, demand)
        omega = np.geomspace(analysis.omega[0], analysis.omega[-1], FINER * analysis.omega.size)
        return analysis.robust_performance(omega).max()

    ends = [(each, end) for each in near.alone for end in (each.low, each.high) if end is not None]
    assert len(ends) == 8
    for each, end in ends:
        loops = list(result.loops)
        loops[each.group] = replace(loops[each.group], **{each.parameter: end})
        beyond = each.value * math.exp(1.01 * math.log(end / each.value))
        assert highest(loops) <= near.mu * (1 + 1e-4)
        loops[each.group] = replace(loops[each.group], **{each.parameter: beyond})
        assert highest(loops) > near.mu
