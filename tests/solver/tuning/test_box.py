"""Where optima lie: the box follows the loop, in whatever units, and ends nowhere by itself."""

import itertools
import math

import numpy as np
import pytest
from zoo import COLUMN, SLH, USUAL

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.record import GuaranteeStatus
from solver.stability.closed_loop import is_stable
from solver.tuning.goals import TauGoal
from solver.tuning.record import Status
from solver.tuning.search import Freedom, GroupingSearch
from solver.tuning.specification import (
    Arrangement,
    Bounds,
    ControllerKind,
    Objective,
    Signs,
    Specification,
)
from solver.tuning.together import Together
from solver.tuning.tuner import tune

NONE = TransferFunction([0], [1])


def run(plant, arrangement=Arrangement.INDEPENDENT, **more):
    uncertainty = more.pop("uncertainty", USUAL)
    performance = more.pop("performance", Performance())
    return tune(Specification(plant, uncertainty, performance, arrangement=arrangement, **more))


def test_which_of_two_groups_is_the_fast_one_does_not_hang_on_the_seed():
    """Five units of eleven integrate slowly, six fast: 12.349; the other way round 12.586."""
    plant = first_order(11, 1, 30, -0.095)
    for seed in range(2):
        result = run(plant, Arrangement.GROUPED, group_sizes=(5, 6), seed=seed)
        assert result.tau_p == pytest.approx(12.3489, abs=1e-3)
        assert result.loops[0].integral_time > 5 * result.loops[-1].integral_time


def test_a_derivative_time_as_long_as_the_lag_is_found():
    """README plant, identical PID: 12.976 with tau_D = 105, whatever the seed."""
    for seed in range(4):
        result = run(SLH, Arrangement.IDENTICAL, kind=ControllerKind.PID, seed=seed)
        assert result.tau_p == pytest.approx(12.9763, abs=1e-3)
        assert result.loops[0].derivative_time > 50


@pytest.mark.parametrize(
    "process",
    [
        TransferFunction((1,), (1, 0.02, 1)),
        TransferFunction((-2, 1), (4, 4, 1)),
        TransferFunction((3,), (1, 1), 0.7),
        TransferFunction((1,), (5, 1, 0)),
    ],
    ids=["resonance", "inverse response", "dead time", "integrator"],
)
def test_a_kind_with_more_parameters_is_never_worse(process):
    """PI is PID whose derivative vanishes; PID and PIF are PIDF: of 1/(s^2 + s/50 + 1) too."""
    plant = ParallelPlant(1, process, NONE)
    tau_p = {kind: run(plant, kind=kind).tau_p for kind in ControllerKind}
    for kind in ControllerKind:
        for less in kind.contained:
            assert tau_p[kind] <= (1 + 1e-6) * tau_p[less]


@pytest.mark.parametrize(
    ("process", "kind"),
    [((1, 100, 1), ControllerKind.PI), ((1, 1, 2, 1), ControllerKind.PID)],
)
def test_where_nothing_limits_the_gain_it_is_said(process, kind):
    """An error of 20 % at all frequencies, no dead time: any speed is permitted."""
    plant = ParallelPlant(1, TransferFunction(process[:1], process[1:]), NONE)
    result = run(plant, kind=kind, uncertainty=Uncertainty.from_error(0.2, 0))
    assert result.tau_p < 1e-4
    assert any("the gain goes to infinity: nothing in plant" in each for each in result.warnings)


def test_just_below_the_least_peak_the_nearest_settings_are_that_near():
    """Lag and dead time of 1: max_peak 1.010954 at least, at (k, tau_I) = (0.0096, infinity)."""
    late = ParallelPlant(1, TransferFunction((1,), (1, 1), 1), NONE)
    task = Specification(late, USUAL, Performance(1.0107))
    search = GroupingSearch(task, Freedom.usual(task, ((0,),)), lambda: None)
    here = search.nearly_feasible(np.log([0.02, 100.0]))
    assert 1.0002 < search.slowest_demand(here)[0].value < 1.0004


@pytest.mark.parametrize(("epsilon", "arrangement", "least"), [
    (0.935, Arrangement.INDEPENDENT, 1.00402), (0.9304285, Arrangement.IDENTICAL, 1.00001),
])  # fmt: skip
def test_just_beyond_what_is_feasible_the_end_is_soon_and_the_nearest_are_that_near(
    monkeypatch, epsilon, arrangement, least
):
    """AB13MD, tau_I = 1e6, the best of all gains: peaks of 1.00402 and 1.00001."""
    plant = first_order(2, 1, 20, 0.9)
    uncertainty = Uncertainty.from_error(epsilon, 1)
    asked = 0
    evaluate = Together.evaluate

    def counted(self, *arguments, **more):
        nonlocal asked
        asked += 1
        return evaluate(self, *arguments, **more)

    monkeypatch.setattr(Together, "evaluate", counted)
    result = run(plant, arrangement, uncertainty=uncertainty)
    assert result.status is Status.INFEASIBLE
    peak = float(result.reason.split("mu = ")[1].split()[0])
    assert least < peak < least + 7e-5
    assert asked < 4000  # 11,700 where descents went on from what no tau_P serves


def test_a_price_in_the_value_is_no_number_too_large():
    """The value of settings that miss the demand much has a demand of its own all the same."""
    level, slope = TauGoal(Performance()).demand(1e5, np.geomspace(1e-9, 1e9, 50))
    assert np.isfinite(level).all()
    assert np.isfinite(slope).all()


def test_two_integrations_ask_for_a_derivative():
    """No PI controller holds 1/s^2, and the refusal names the kind that does."""
    twice = ParallelPlant(1, TransferFunction((1,), (1, 0, 0)), NONE)
    refused = run(twice)
    assert refused.status is Status.INFEASIBLE
    assert refused.reason.endswith("a plant that integrates twice needs a derivative: ask for PID")
    for seed in (0, 2):  # tau_I goes to infinity: the value there, not that of where a search began
        result = run(twice, kind=ControllerKind.PID, seed=seed)
        assert result.tau_p == pytest.approx(6.263388, rel=1e-6)


def test_near_singular_pid_and_the_column_have_slow_derivatives():
    """a = 0.995: 49.44; SLH eq. 3 at tau_P = 10: mu = 1.268, not met and said so."""
    near = run(first_order(2, 1, 100, 0.995), kind=ControllerKind.PID)
    assert near.tau_p == pytest.approx(49.4365, abs=5e-3)
    column = run(
        COLUMN, kind=ControllerKind.PID, objective=Objective.MU, performance=Performance(tau_p=10)
    )
    assert column.peaks.robust_performance.value == pytest.approx(1.26768, abs=1e-4)
    assert column.status is Status.OPTIMAL
    assert not column.demand_met
    assert near.demand_met


def scaled_lag(lag, gains, time):
    """Elements of a 2 x 2 plant of lags, inputs in other units and time in another unit."""
    return MatrixPlant(
        [
            [TransferFunction([g * k], [tau * time, 1], theta * time) for (g, tau, theta), k
             in zip(row, gains, strict=True)]
            for row in lag
        ]
    )  # fmt: skip


WOOD_BERRY = [[(12.8, 16.7, 1), (-18.9, 21, 3)], [(6.6, 10.9, 7), (-19.4, 14.4, 3)]]


@pytest.mark.parametrize("inputs", [(1e-6, 1e6), (1e6, 1e-6), (1e-6, 1e-6)])
@pytest.mark.parametrize("time", [1e-6, 1.0, 1e6])
def test_units_of_inputs_and_time_do_not_matter(inputs, time):
    """Wood and Berry's column in units up to 1e6 larger and smaller: the same loop."""
    usual = run(scaled_lag(WOOD_BERRY, (1, 1), 1.0), starts=4)
    other = run(
        scaled_lag(WOOD_BERRY, inputs, time), starts=4,
        uncertainty=Uncertainty.from_error(0.2, time),
    )  # fmt: skip
    assert other.tau_p == pytest.approx(usual.tau_p * time, rel=1e-5)
    for here, there, unit in zip(usual.loops, other.loops, inputs, strict=True):
        assert there.gain * unit == pytest.approx(here.gain, rel=1e-2)
        assert there.integral_time == pytest.approx(here.integral_time * time, rel=1e-2)


@pytest.mark.parametrize("outputs", [1e-6, 1e6])
def test_a_common_unit_of_outputs_does_not_matter(outputs):
    """All outputs in a unit a million times larger or smaller: gains change, tau_P does not."""
    result = run(scaled_lag(WOOD_BERRY, (outputs, outputs), 1.0), starts=4)
    assert result.tau_p == pytest.approx(
        run(scaled_lag(WOOD_BERRY, (1, 1), 1.0), starts=4).tau_p, rel=1e-5
    )


def test_bounds_wider_than_needed_change_nothing():
    """The column with bounds over nine decades: 49.068, as without any."""
    bounds = Bounds(gain=(4.4e-4, 3e5), integral_time=(8.6e-5, 7.5e4))
    assert run(COLUMN, bounds=bounds).tau_p == pytest.approx(49.068, abs=5e-3)
    assert run(COLUMN).tau_p == pytest.approx(49.068, abs=5e-3)


def test_integral_action_that_no_demand_needs_is_told():
    """An integrator with dead time 5: tau_I has no end, tau_P is 8.954, and a remark says so."""
    plant = ParallelPlant(1, TransferFunction([1], [1, 0], 5), NONE)
    result = run(plant)
    assert result.status is Status.OPTIMAL
    assert result.tau_p == pytest.approx(8.9537, abs=2e-3)
    assert "ask for load disturbances" in result.warnings[0]


def test_an_integrating_pair_is_followed_to_its_end():
    """a = 0.99, integrating: 80.66, where one loop's integral time has no end."""
    plant = ParallelPlant(2, TransferFunction([1], [1, 0]), TransferFunction([0.99], [1, 0]))
    assert run(plant).tau_p < 80.7


@pytest.mark.parametrize("M", [1.015, 1.02, 1.05])
def test_feasible_up_to_the_edge(M):
    """One lag and dead time: a permitted peak of 1.015 is still met, at tau_P = 389.1."""
    result = run(first_order(1, 1, 100, 0, 1), performance=Performance(max_peak=M))
    assert result.status is Status.OPTIMAL
    assert result.demand_met
    if M == 1.015:
        assert result.tau_p == pytest.approx(389.106, abs=0.05)


def test_what_is_fed_through_is_held_at_infinity_without_dead_time_too():
    """Two static units: 1.62497 with PID, whose limit lies at infinity, 1.63914 with PI."""
    plant = ParallelPlant(2, TransferFunction((2,), (1,)), TransferFunction((1,), (1,)))
    found = [run(plant, kind=kind) for kind in (ControllerKind.PI, ControllerKind.PID)]
    assert [each.tau_p for each in found] == pytest.approx([1.639137, 1.624967], abs=1e-5)
    assert all(each.guarantee.status is GuaranteeStatus.PROVEN for each in found)


def test_an_interaction_that_alone_integrates_is_refused_by_what_forbids_it():
    """det (I + G C) changes its sign on the positive real axis whatever the settings."""
    plant = ParallelPlant(2, TransferFunction((1,), (10, 1)), TransferFunction((0.05,), (1, 0)))
    result = run(plant)
    assert result.status is Status.INFEASIBLE
    assert "the interaction integrates where the process does not" in result.reason


@pytest.mark.parametrize(("n", "lag", "tau_p"), [(1, 30.0, 45.448), (2, 5.0, 13.8887)])
def test_an_integrator_with_a_lag_is_controlled_without_integral_action(n, lag, tau_p):
    """A PI loop with a short tau_I is unstable at any low gain: starts slow down as a whole."""
    own, other = (TransferFunction((a,), (lag, 1, 0)) for a in (1, 0.6))
    result = run(ParallelPlant(n, own, other if n > 1 else NONE))
    assert result.status is Status.OPTIMAL
    assert result.tau_p == pytest.approx(tau_p, rel=1e-4)


def test_an_input_that_alone_integrates_is_tuned():
    """Both outputs integrate the first input only: S G is a difference of products without bound.

    What rounding left of it towards zero once passed for a peak, and the plant for infeasible.
    """
    rows = [[((0.1,), (1, 0)), ((0.3,), (10, 1))], [((0.02,), (1, 0)), ((1,), (15, 1))]]
    result = run(MatrixPlant([[TransferFunction(*each) for each in row] for row in rows]))
    assert result.status is Status.OPTIMAL
    assert result.tau_p == pytest.approx(1.74978, rel=1e-4)
    assert result.peaks.robust_performance.value <= 1 + 1e-7


def test_feedthrough_with_dead_time_is_held_at_infinity():
    """G = e^-5s: (2k + 1/2)/(1 - k) <= 1 for the worst phase, so k <= 1/6 and tau_P = 6.29357."""
    plant = ParallelPlant(1, TransferFunction([1], [1], 5), NONE)
    result = run(plant)
    assert result.loops[0].gain == pytest.approx(1 / 6, rel=1e-5)
    assert result.tau_p == pytest.approx(6.29357, rel=1e-5)


@pytest.mark.parametrize(
    ("den", "uncertainty"), [([1, 2, 1], (0.01, 0)), ([1, 3, 3, 1], (0.1, 0.03))]
)
def test_loops_faster_than_the_plants_corners_are_seen_whole(den, uncertainty):
    """Two and three lags under little uncertainty: the peak on a long fine grid is 1."""
    plant = ParallelPlant(1, TransferFunction([1], den), NONE)
    weight = Uncertainty.from_error(*uncertainty)
    result = run(plant, uncertainty=weight)
    assert result.status is Status.OPTIMAL
    omega = np.geomspace(1e-4, 1e7, 200_001)
    c, g = result.loops[0].response(omega), plant.process.response(omega)
    S = 1 / (1 + g * c)
    w_P = Performance(tau_p=result.tau_p).magnitude(omega)
    # n = 1: mu is |w_I T| + |w_P S|.
    mu = weight.magnitude(omega) * np.abs(g * c * S) + w_P * np.abs(S)
    assert mu.max() == pytest.approx(1, abs=1e-6)


def test_other_signs_are_tried_where_asked():
    """A loop whose own gain changes sign: refused as usual, 7.610 with any signs, and warned of."""
    rows = [[([10, -0.05], [100, 20, 1]), ([1], [10, 1])], [([-1], [10, 1]), ([1], [10, 1])]]
    plant = MatrixPlant([[TransferFunction(*each) for each in row] for row in rows])
    refused = run(plant)
    assert refused.status is Status.INFEASIBLE
    assert "Niederlinski" in refused.reason
    result = run(plant, signs=Signs.ANY)
    assert result.tau_p == pytest.approx(7.6102, abs=1e-3)
    assert "never alone" in result.warnings[0]


def test_beyond_integral_controllability_one_loop_turns_its_sign():
    """n = 3, a = -0.6 < -1/2: stable together with one gain of the other sign, slow as it is.

    Two settings do not serve; the best grouping is found all the same, and is three.
    """
    plant = first_order(3, 1, 100, -0.6)
    result = run(plant, signs=Signs.ANY)
    assert result.status is Status.OPTIMAL
    assert result.demand_met
    assert is_stable(plant, result.loops)
    assert sum(loop.gain < 0 for loop in result.loops) == 1
    best = run(plant, signs=Signs.ANY, arrangement=Arrangement.BEST)
    assert best.tau_p <= result.tau_p * (1 + 1e-6)
    assert len(best.groups) == 3


@pytest.mark.parametrize(("n", "a"), [(2, 0.9), (3, -0.4), (4, 0.6)])
def test_free_settings_are_never_worse_than_tied_ones(n, a):
    """Identical, two groups, independent; PI, PIF; PID, PIDF: each step at most what it was."""
    plant = first_order(n, 1, 30, a)
    arrangements = [{"arrangement": Arrangement.IDENTICAL}]
    if n > 2:
        arrangements.append({"arrangement": Arrangement.GROUPED, "group_sizes": (1, n - 1)})
    arrangements.append({"arrangement": Arrangement.INDEPENDENT})
    values = [run(plant, starts=2, **each).tau_p for each in arrangements]
    assert all(b <= a * (1 + 1e-6) for a, b in itertools.pairwise(values))
    one = Arrangement.IDENTICAL
    by_kind = {kind: run(plant, one, kind=kind).tau_p for kind in ControllerKind}
    assert by_kind[ControllerKind.PIF] <= by_kind[ControllerKind.PI] * (1 + 1e-6)
    assert by_kind[ControllerKind.PIDF] <= by_kind[ControllerKind.PID] * (1 + 1e-6)
    assert by_kind[ControllerKind.PID] <= by_kind[ControllerKind.PI] * (1 + 1e-6)


def test_a_free_filter_is_a_setting():
    """PIDF of the README plant beats PID, and PIF beats PI; the filter time is in the settings."""
    pif = run(SLH, Arrangement.IDENTICAL, kind=ControllerKind.PIF)
    pidf = run(SLH, Arrangement.IDENTICAL, kind=ControllerKind.PIDF)
    assert pif.loops[0].filter_time is not None
    assert pif.loops[0].derivative_time is None
    assert pidf.tau_p <= 12.9764
    assert pidf.loops[0].filter_time is not None


@pytest.mark.parametrize("seed", range(4))
def test_a_filter_may_end_far_above_the_search_frequencies(seed):
    """3 e^-2s/(10s + 1), errors of 30 %: 3.5662 with hardly any filter, 3.591 with 0.02 of it.

    The loop gain stays at 0.15 up to the filter's end, and dead time turns it all the way.
    """
    plant = ParallelPlant(1, TransferFunction((3,), (10, 1), 2), NONE)
    result = run(
        plant, kind=ControllerKind.PIDF, uncertainty=Uncertainty.from_error(0.3, 1), seed=seed
    )
    assert result.tau_p == pytest.approx(3.56624, rel=1e-5)


def test_a_filter_without_end_ends_where_the_proof_follows():
    """e^-3s/(30s + 1): 4.1367 with no filter at all, which no proof follows."""
    plant = ParallelPlant(1, TransferFunction((1,), (30, 1), 3), NONE)
    result = run(plant, kind=ControllerKind.PIDF)
    assert result.guarantee.status is GuaranteeStatus.PROVEN
    assert result.tau_p == pytest.approx(4.1367, rel=3e-4)


def test_three_groups_are_found_where_they_are_best():
    """n = 5, a = -0.24: (1, 2, 2) gives 18.553, two groups 18.822 at least."""
    result = run(first_order(5, 1, 100, -0.24), Arrangement.BEST)
    assert sorted(map(len, result.groups)) == [1, 2, 2]
    assert result.tau_p == pytest.approx(18.5535, abs=2e-3)


def test_a_search_from_known_settings_stays_beside_them():
    """Near the known optimum of the README plant it is found; the status is local."""
    start = (Controller(46.3, 101), Controller(22.8, 3.15))
    result = run(SLH, start=start)
    assert result.status is Status.LOCAL
    assert result.tau_p == pytest.approx(18.4455, abs=0.02)
    changed = run(first_order(2, 1, 100, 0.94), start=result.loops)
    assert changed.status is Status.LOCAL
    assert changed.tau_p == pytest.approx(run(first_order(2, 1, 100, 0.94)).tau_p, rel=0.02)


@pytest.mark.parametrize(
    ("start", "more", "field"),
    [
        ((Controller(1, 2),), {}, "/search/start"),
        ((Controller(1, 2), Controller(1, 2, 3)), {}, "/search/start/1/derivative_time"),
        ((Controller(1, 2), Controller(1, 3)), {"arrangement": Arrangement.IDENTICAL},
         "/search/start/1"),
    ],
)  # fmt: skip
def test_starts_that_do_not_fit_are_refused_by_name(start, more, field):
    """Too few loops, a setting that the kind lacks, unlike loops in one group."""
    with pytest.raises(InvalidInputError) as refused:
        run(SLH, start=start, **more)
    assert refused.value.field == field


def test_a_time_constant_is_refused_where_it_is_sought():
    """performance.tau_p has no place beside the objective tau_p."""
    with pytest.raises(InvalidInputError) as refused:
        Specification(SLH, USUAL, Performance(tau_p=20))
    assert refused.value.field == "/performance/tau_p"


def test_what_is_infeasible_says_that_none_was_found_and_why():
    """A peak of 1.01 under 60 % uncertainty: the nearest settings' peak is above 1."""
    result = run(
        SLH, Arrangement.IDENTICAL, uncertainty=Uncertainty.from_error(0.6, 1),
        performance=Performance(max_peak=1.01), bounds=Bounds(gain=(1, 2)),
    )  # fmt: skip
    assert result.status is Status.INFEASIBLE
    assert result.reason.startswith("none were found")
    assert float(result.reason.split("mu = ")[1].split()[0]) > 1
    assert math.isfinite(result.omega)
