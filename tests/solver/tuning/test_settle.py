"""The last word on settings: what the whole axis says of where a search ends."""

import math

import numpy as np
import pytest

from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.record import GuaranteeStatus
from solver.tuning.clock import Clock
from solver.tuning.exact import Candidate
from solver.tuning.report import _summary
from solver.tuning.search import FoundOptimum, Freedom, GroupingSearch
from solver.tuning.settle import settled
from solver.tuning.specification import ControllerKind, Objective, Specification


def test_settings_on_the_edge_of_stability_step_back_from_it() -> None:
    """A peak too narrow for the search, 56,651,810 where 14,117 was seen: lower gains serve."""
    task = Specification(
        first_order(3, 1, 100, 1 - 1e-7, 1),
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=19),
        objective=Objective.MU,
    )
    search = GroupingSearch(task, Freedom.usual(task, ((0, 1, 2),)), lambda: None)
    seen = 14117.092020497255
    on_edge = np.array([3.46046724, 0.53508512])
    found = settled(task, search, Candidate(on_edge, 2 * math.log(seen), (), 0.0), None)
    assert found is not None
    assert found.peaks.robust_performance.value < 1.1 * seen


def test_an_optimum_that_meets_no_demand_is_not_told() -> None:
    """Near the limit of feasibility an optimum's value may be a penalty: e^800 is no number."""
    task = Specification(first_order(1, 1, 10, 0), Uncertainty.from_error(0.2, 1), Performance())
    search = GroupingSearch(task, Freedom.usual(task, ((0,),)), lambda: None)
    theta = np.array([1.0, 2.0])
    search.optima = [FoundOptimum(theta, 0.5, 3), FoundOptimum(theta, 800.0, 1)]
    summary = _summary(task, search, Clock(None, None, math.exp))
    assert [found.count for found in summary.local_optima] == [3]


def test_a_filter_that_goes_to_zero_beside_one_that_matters_ends_where_it_is_proven() -> None:
    """A longer filter alone breaks the demand far above the bandwidth: the others make room."""
    plant = MatrixPlant(
        [
            [TransferFunction([30.2, 1], [195.17656, 36.6628, 1]),
             TransferFunction([-0.407], [3323.5, 189.55, 1], 10.1)],
            [TransferFunction([26.90871, 0.501], [281.4404, 36.942, 1], 12.9),
             TransferFunction([0.036231884], [6.0444, 1, 0])],
        ]
    )  # fmt: skip
    task = Specification(
        plant, Uncertainty.from_error(0.4, 5), Performance(), kind=ControllerKind.PIDF
    )
    search = GroupingSearch(task, Freedom.usual(task, ((0,), (1,))), lambda: None)
    theta = [-0.05304886, 2.42252472, 1.16251959, -19.22465033,
             1.06490468, 14.34613881, 2.05105028, -18.22465062]  # fmt: skip
    candidate = search.exact.measure(np.array(theta), 2.43)
    found = settled(task, search, candidate, Clock(None, None, math.exp))
    assert found is not None
    assert found.axes[0].guarantee.status is GuaranteeStatus.PROVEN
    assert found.candidate.value < candidate.value + 3e-4


def test_a_search_that_ends_in_a_valley_beside_the_edge_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nearly singular: 9,844 from one seed and 9,420 from another; the proven peak is made less."""
    monkeypatch.setattr("solver.tuning.settle.LOOKS", 8)
    monkeypatch.setattr("solver.tuning.settle.DESCENTS", 1)
    task = Specification(
        first_order(2, 1, 100, 1 - 1e-7, 1),
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=19),
        objective=Objective.MU,
    )
    search = GroupingSearch(task, Freedom.usual(task, ((0,), (1,))), lambda: None)
    ended = Candidate(np.log([49.121633, 2.029, 33.305934, 1.101]), 2 * math.log(9844.2), (), 0.0)
    clock = Clock(None, None, lambda s: s)
    found = settled(task, search, ended, clock)
    assert found is not None
    assert found.peaks.robust_performance.value < 9700
