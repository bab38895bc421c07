import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from zoo import COLUMN, SLH, USUAL

from solver.certificate.verify import Verdict, check
from solver.model.blocks import group_loops
from solver.model.errors import Cancelled, InvalidInputError, UnsupportedPlantError
from solver.model.plants import ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.curves import LoopAnalysis
from solver.stability.closed_loop import is_stable
from solver.tuning.groupings import groupings
from solver.tuning.record import Status
from solver.tuning.search import Freedom, GroupingSearch
from solver.tuning.specification import (
    Arrangement,
    Bounds,
    ControllerKind,
    Objective,
    Specification,
)
from solver.tuning.tuner import tune


def run(plant, arrangement, **more):
    uncertainty = more.pop("uncertainty", USUAL)
    performance = more.pop("performance", Performance())
    return tune(Specification(plant, uncertainty, performance, arrangement=arrangement, **more))


def assert_proven(result, plant, uncertainty=USUAL, **demand):
    """The settings are stable and keep mu <= 1 + 1e-6 on a grid twenty times finer."""
    assert result.status is Status.OPTIMAL
    assert is_stable(plant, result.loops)
    blocks, controllers = group_loops(plant, result.loops, uncertainty)
    performance = Performance(tau_p=result.tau_p, **demand)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    fine = np.geomspace(analysis.omega[0] / 10, 10 * analysis.omega[-1], 20 * analysis.omega.size)
    assert analysis.robust_performance(fine).max() <= 1 + 1e-6


@pytest.fixture(scope="module")
def independent():
    return run(SLH, Arrangement.INDEPENDENT)


def test_model_tolerances_are_those_of_the_settings_and_come_where_asked(independent):
    """A tuning tells of its settings what an analysis of them tells."""
    found = run(SLH, Arrangement.INDEPENDENT, model_tolerance=True)
    assert independent.model_tolerance == ()
    analysed = analyse(SLH, USUAL, Performance(tau_p=found.tau_p), found.loops)
    assert found.model_tolerance == analysed.model_tolerance
    assert replace(found, model_tolerance=()).loops == independent.loops


def test_published_case_identical():
    """SLH table 1, tau = 100, a = 0.949: published tau_P about 26, here 25.773."""
    result = run(SLH, Arrangement.IDENTICAL)
    assert_proven(result, SLH)
    assert result.tau_p == pytest.approx(25.7730, abs=5e-4)
    assert result.loops[0] == result.loops[1]


def test_published_case_independent(independent):
    """SLH table 2, tau = 100, a = 0.949: published tau_P about 19, here 18.4455."""
    assert_proven(independent, SLH)
    assert independent.tau_p == pytest.approx(18.4455, abs=5e-4)
    assert independent.comparison.identical_value == pytest.approx(25.7730, abs=1e-3)
    assert independent.comparison.gain_percent == pytest.approx(28.43, abs=0.02)
    assert independent.search.local_optima[0].count >= 3


def test_the_same_seed_gives_the_same_digits(independent):
    """A second run repeats every digit."""
    again = run(SLH, Arrangement.INDEPENDENT)
    assert again.loops == independent.loops
    assert again.tau_p == independent.tau_p


@pytest.mark.parametrize("seed", range(4))
def test_optima_in_a_row_are_walked_along(seed):
    """SLH, tau = 100, a = 0.827 has seven optima, one integral time after the other shorter; four
    starts are enough for the last of them.
    """
    result = run(first_order(2, 1, 100, 0.827), Arrangement.INDEPENDENT, starts=4, seed=seed)
    assert result.tau_p == pytest.approx(7.574334, rel=1e-6)


def test_what_the_grid_does_not_see_of_a_late_interaction_is_found():
    """Equal loops look best between the phases of a long dead time; unlike ones are by 1.5 %."""
    process, late = (TransferFunction((a,), (50, 1), delay) for a, delay in ((1, 0.5), (0.5, 30)))
    specification = Specification(
        ParallelPlant(2, process, late), USUAL, Performance(), kind=ControllerKind.PID
    )
    freedom = Freedom.usual(specification, groupings(specification)[0])
    search = GroupingSearch(specification, freedom, lambda: None)
    search.descend(np.log([13.034, 51.679, 0.4058] * 2))
    search.hop()
    assert math.exp(search.optima[0].value) < 4.81
    assert search.refine()
    assert 4.87 < math.exp(search.optima[0].value) < 4.96
    search.hop()
    assert math.exp(search.polish(math.inf)[0].value) == pytest.approx(4.8822, abs=1e-3)


def test_asymmetry_is_kept_only_where_it_pays():
    """'best' keeps identical settings where nothing gains 1 per cent (SLH, tau = 10)."""
    result = run(first_order(2, 1, 10, 0.3), Arrangement.BEST)
    assert result.groups == ((0, 1),)
    assert run(SLH, Arrangement.BEST).groups == ((0,), (1,))


def test_without_interaction_loops_are_single_loops():
    """a = 0: two independent loops reach what one unit alone reaches."""
    single = run(first_order(1, 1, 10, 0), Arrangement.INDEPENDENT)
    pair = run(first_order(2, 1, 10, 0), Arrangement.INDEPENDENT)
    assert pair.tau_p == pytest.approx(single.tau_p, rel=1e-4)


def test_column_by_mu():
    """SLH eq. 3, tau_P = 10, objective mu: PI 1.50356, PID below 1.297 (published 1.34)."""
    demand = {"performance": Performance(tau_p=10), "objective": Objective.MU}
    pi = run(COLUMN, Arrangement.INDEPENDENT, **demand)
    assert pi.peaks.robust_performance.value == pytest.approx(1.50356, abs=1e-4)
    pid = run(COLUMN, Arrangement.INDEPENDENT, kind=ControllerKind.PID, **demand)
    assert pid.peaks.robust_performance.value <= 1.297
    assert pid.tau_p == 10


@pytest.mark.parametrize(
    ("plant", "arrangement"),
    [
        (ParallelPlant(2, TransferFunction([1], [20, 1], 0.5), TransferFunction([0.6], [30, 1], 1)),
         Arrangement.INDEPENDENT),
        (ParallelPlant(2, TransferFunction([1], [1, 0]), TransferFunction([0.5], [1, 0])),
         Arrangement.INDEPENDENT),
        (first_order(4, -2, 10, -0.3, 1), Arrangement.IDENTICAL),
    ],
    ids=["dead time, other dynamics in i", "integrating", "negative gain, stream split"],
)  # fmt: skip
def test_other_plants_are_tuned_and_proven(plant, arrangement):
    """Dead time, other dynamics in i, integrators and negative gains: stable, mu <= 1."""
    assert_proven(run(plant, arrangement), plant)


@pytest.mark.parametrize(
    ("plant", "uncertainty", "words"),
    [
        (first_order(2, 1, 100, 1.0), USUAL, "singular"),
        (first_order(3, 1, 100, -0.6), USUAL, "decentralised integral controllable"),
        (first_order(2, 1, 100, 0.5), Uncertainty.from_error(1.2, 1), "120 %"),
    ],
)
def test_infeasible_tasks_say_what_forbids_them(plant, uncertainty, words):
    """Status infeasible, the reason in words and the frequency."""
    result = run(plant, Arrangement.INDEPENDENT, uncertainty=uncertainty)
    assert result.status is Status.INFEASIBLE
    assert words in result.reason
    assert result.omega == 0
    assert result.loops == ()


def test_infeasible_demands_name_the_frequency():
    """A sensitivity peak of 1.01 cannot be had under 60 % uncertainty: the frequency is named."""
    result = run(
        SLH, Arrangement.IDENTICAL,
        uncertainty=Uncertainty.from_error(0.6, 1), performance=Performance(max_peak=1.01),
    )  # fmt: skip
    assert result.status is Status.INFEASIBLE
    assert result.omega > 0


def test_bounds_are_kept_and_reported():
    """A parameter on its bound is named in a warning."""
    result = run(SLH, Arrangement.IDENTICAL, bounds=Bounds(integral_time=(80, 200)))
    assert result.loops[0].integral_time >= 80 * (1 - 1e-9)
    assert any("integral time is on its lower bound 80" in warning for warning in result.warnings)


def test_progress_may_stop_the_tuning():
    """What the callback raises passes through."""
    seen = []

    def stop(progress):
        seen.append(progress)
        raise Cancelled

    with pytest.raises(Cancelled):
        tune(Specification(SLH, USUAL, Performance()), stop)
    assert seen[0].best is None


def test_without_remarks_the_settings_are_the_same():
    """What is not told is left out, and nothing else changes."""
    whole, brief = (run(SLH, Arrangement.IDENTICAL, remarks=told) for told in (True, False))
    assert brief.loops == whole.loops
    assert (brief.integrity, brief.settings_tolerance) == (None, None)
    assert set(brief.advice) < set(whole.advice)


def test_time_limit_returns_the_best_so_far():
    """A tiny limit ends with its status, without settings or with stable ones."""
    result = run(SLH, Arrangement.INDEPENDENT, time_limit=1e-3)
    assert result.status is Status.TIME_LIMIT
    assert result.loops == () or is_stable(SLH, result.loops)


def test_a_search_that_is_stopped_keeps_what_it_told():
    """The last value told is exact, between the grid's frequencies too: the end is no worse."""
    told = []

    def stop(progress):
        told.append(progress.best)
        return progress.starts_done >= 40

    plant = first_order(4, 1.0, 100.0, 0.7)
    task = Specification(
        plant,
        USUAL,
        Performance(),
        kind=ControllerKind.PID,
        arrangement=Arrangement.INDEPENDENT,
        starts=100,
    )
    result = tune(task, stop)
    assert result.status is Status.TIME_LIMIT
    assert result.tau_p <= told[-1] * (1 + 1e-6)
    assert all(a is None or b <= a for a, b in itertools.pairwise(told))


def test_specification_names_what_is_wrong():
    """Group sizes, starts, seed, limits and objective are checked before any work."""
    for field, more in {
        "/controller/group_sizes": {"arrangement": Arrangement.GROUPED, "group_sizes": (1, 2)},
        "/search/starts": {"starts": 0},
        "/search/seed": {"seed": -1},
        "/search/time_limit": {"time_limit": 0.0},
        "/performance/tau_p": {"objective": Objective.MU},
    }.items():
        with pytest.raises(InvalidInputError) as error:
            Specification(SLH, USUAL, Performance(), **more)
        assert error.value.field == field


def test_too_many_independent_loops_and_unstable_plants_are_refused():
    """Both are input errors, not failures of the search."""
    with pytest.raises(InvalidInputError):
        run(first_order(30, 1, 10, 0.1), Arrangement.INDEPENDENT)
    unstable = ParallelPlant(2, TransferFunction([1], [1, -1]), TransferFunction([0.1], [1, 1]))
    with pytest.raises(UnsupportedPlantError):
        run(unstable, Arrangement.IDENTICAL)


def test_a_plant_too_slow_for_its_unit_of_time_is_told_so():
    """A tau_P beyond the largest number is the unit's fault, and the message says that."""
    plant = first_order(2, 1.0, 1e12, 0.5)
    task = Specification(plant, Uncertainty.from_error(0.2, 1e12), Performance(), starts=1)
    with pytest.raises(InvalidInputError, match="longer unit of time") as refused:
        tune(task)
    assert refused.value.field == "/plant"


def test_large_groups_cost_what_small_ones_cost():
    """n = 1000 in two groups has the blocks of n = 4 in two groups, and the same curves' size."""
    large = run(
        first_order(1000, 1, 100, -0.9 / 999), Arrangement.GROUPED, group_sizes=(500, 500), starts=2
    )
    assert len(large.loops) == 1000
    assert math.isfinite(large.tau_p)


def test_a_certificate_costs_nothing_in_the_settings():
    """It proves a level just above the peak, which the settings with and without it touch."""
    result = run(SLH, Arrangement.IDENTICAL, certificate=True)
    assert result.certificate.claim.gamma == pytest.approx(1.0002, abs=1e-6)
    assert check(result.certificate).verdict is Verdict.PROVEN
    assert result.loops == run(SLH, Arrangement.IDENTICAL).loops


@pytest.mark.parametrize(("n", "a"), [(10_000, 0.5), (2, 0.99999)])
def test_directions_far_stronger_or_weaker_than_a_single_unit(n, a):
    """The sum of many units, and what is left of two nearly equal rows, are within reach."""
    result = run(first_order(n, 1, 100, a), Arrangement.IDENTICAL)
    assert result.status is Status.OPTIMAL
    assert result.peaks.robust_performance.value == pytest.approx(1, abs=1e-6)


def test_bounds_are_kept_to_the_last_digit():
    """A setting on its bound is not above it by rounding."""
    bounds = Bounds(gain=(0.1, 30))
    result = run(SLH, Arrangement.IDENTICAL, bounds=bounds)
    assert result.loops[0].gain <= 30
    assert result.loops[0].gain == pytest.approx(30, rel=1e-9)
    assert "upper bound 30" in result.warnings[0]


def test_identical_settings_are_returned_where_unlike_ones_were_found_worse():
    """a = 0.999999 with dead time: the search for unlike settings ended a hundred times slower."""
    uncertainty = Uncertainty.from_error(0.5, 1)
    plant = first_order(2, 1, 100, 0.999999, 5)
    alike = run(plant, Arrangement.IDENTICAL, uncertainty=uncertainty)
    found = run(plant, Arrangement.INDEPENDENT, uncertainty=uncertainty)
    assert found.tau_p <= alike.tau_p * (1 + 1e-6)
    assert found.comparison.identical_value >= found.tau_p * (1 - 1e-6)
    assert found.comparison.gain_percent >= -1e-4


def test_an_optimum_on_the_verge_of_stability_is_found():
    """The peak of the strong mode is narrower there than the steps of the grid."""
    found = tune(
        Specification(
            first_order(2, 1.0, 1.0, 0.9999, 0.3), Uncertainty.from_gain_and_dead_time(0.227, 0.0),
            Performance(max_peak=2.22, tau_p=28.0), arrangement=Arrangement.IDENTICAL,
            objective=Objective.MU, starts=1,
        )
    )  # fmt: skip
    assert found.nominally_stable
    assert found.peaks.robust_performance.value == pytest.approx(35.1, rel=0.01)
