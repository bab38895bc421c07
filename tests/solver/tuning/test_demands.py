"""Demands beside robust performance: hard constraints of the search."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.margins import loop_margins
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response
from solver.tuning.alone import LoopsAlone
from solver.tuning.demand_checks import outcomes, planes
from solver.tuning.demands import Demands
from solver.tuning.record import Status, Tuning
from solver.tuning.specification import (
    Arrangement,
    Bounds,
    ControllerKind,
    Objective,
    Specification,
)
from solver.tuning.tuner import tune

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
SEED = first_order(2, 1.0, 100.0, 0.949)  # SLH's plant; without demands tau_P = 18.446


def tuned(demands: Demands, plant: ParallelPlant | MatrixPlant = SEED, **options: object) -> Tuning:
    return tune(
        Specification(plant, UNCERTAINTY, Performance(), demands=demands, **options)  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("demands", "tau_p"),
    [
        (Demands(), 18.446),
        (Demands(max_controller_gain=30), 27.46),
        (Demands(max_load_error=1.5), 19.73),
        (Demands(max_sensitivity_alone=1.2), 19.04),
        (Demands(30, 1.5, 1.5), 31.10),
        (Demands(40, 1.5, 1.2), 22.70),
    ],
)
def test_demands_are_kept_and_cost_time(demands: Demands, tau_p: float) -> None:
    """Every demand is met by the settings returned, at the price that docs/demands.md tells."""
    found = tuned(demands)
    assert found.status is Status.OPTIMAL
    assert found.tau_p == pytest.approx(tau_p, rel=2e-3)
    assert all(each.met and each.value <= each.limit for each in found.demands)
    assert [each.name for each in found.demands] == list(demands.names)
    assert any(each.active for each in found.demands) == bool(demands.names)
    assert found.peaks is not None
    assert found.peaks.robust_performance.value == pytest.approx(1.0, abs=1e-6)


def test_demands_that_do_not_bind_change_nothing() -> None:
    """Wide limits leave the settings as they are, to the last digits."""
    free, wide = tuned(Demands()), tuned(Demands(max_controller_gain=1e4, max_load_error=1e4))
    assert wide.tau_p == pytest.approx(free.tau_p, rel=1e-6)
    assert not any(each.active for each in wide.demands)


def test_no_settings_near_the_optimum_do_better_within_the_demand() -> None:
    """On the limit of the load error no step along it, or inwards, lowers tau_P."""
    found = tuned(Demands(max_load_error=1.5))
    start = np.log([[loop.gain, loop.integral_time or 1.0] for loop in found.loops])
    rng = np.random.default_rng(3)
    faster = Performance(tau_p=0.999 * found.tau_p)  # type: ignore[operator]
    for _ in range(15):
        theta = start + 0.01 * rng.standard_normal(start.shape)
        theta[:, 1] = np.minimum(theta[:, 1], theta[:, 0] + math.log(1.5))
        loops = [Controller(*map(float, np.exp(row))) for row in theta]
        peaks = analyse(SEED, UNCERTAINTY, faster, loops).peaks
        assert peaks is not None
        assert peaks.robust_performance.value > 1


@pytest.mark.parametrize("kind", list(ControllerKind))
def test_gain_is_that_of_the_controller_beyond_integral_action(kind: ControllerKind) -> None:
    """The planes of the search say of log settings what the check says of the controller."""
    rng = np.random.default_rng(1)
    limit = 3.0
    rows, limits = planes(Demands(max_controller_gain=limit, max_load_error=2.0), kind, [(0,)])
    for theta in rng.normal(scale=1.5, size=(200, len(kind.parameters))):
        settings = dict(zip(kind.parameters, np.exp(theta).tolist(), strict=True))
        loop = Controller(**settings)
        gain, load = outcomes(Demands(limit, 2.0), [first_order(1, 1, 1, 0)], [loop])
        assert (gain.met and load.met) == bool((rows @ theta <= limits).all())
        far = abs(complex(loop(1e9j)))
        assert far <= gain.value * (1 + 1e-6)


def test_gains_are_limited_in_per_cent_of_the_spans() -> None:
    """The loop whose output spans more has the smaller gain; a group that of its widest loop."""
    demands = Demands(max_controller_gain=30.0, max_load_error=2.0, gain_ratios=(2.0, 0.5))
    loops = (Controller(10.0, 15.0), Controller(50.0, 80.0))
    gain, load = outcomes(demands, [first_order(2, 1, 1, 0)], loops)
    assert (gain.value, load.value) == (25.0, 1.6)
    rows, limits = planes(demands, ControllerKind.PI, [(0,), (1,)])
    assert np.exp(limits) == pytest.approx([15.0, 2.0, 60.0, 2.0])
    assert planes(demands, ControllerKind.PI, [(0, 1)])[1] == pytest.approx(limits[:2])
    assert rows.shape == (4, 4)
    found = tuned(replace(demands, max_load_error=None), starts=2)
    assert found.demands[0].active
    assert 2.0 * found.loops[0].gain <= 30.0
    for ratios in ((1.0,), (1.0, 0.0), (1.0, 2.0, 3.0)):
        with pytest.raises(InvalidInputError, match=r"ratio|greater than 0"):
            tuned(Demands(max_controller_gain=30.0, gain_ratios=ratios))


def test_load_error_is_the_integrated_error_after_a_load_step() -> None:
    """Simulated: the area under the response is tau_I/k, for the loop whose input is stepped."""
    loops = (Controller(40.0, 60.0), Controller(30.0, 30.0))
    plant = first_order(2, 1.0, 100.0, 0.5)
    experiment = Experiment(
        plant, tuple(Loop.of(loop) for loop in loops), (Step(StepKind.LOAD, 0, 0.0, 1.0),), 2000.0,
        samples=4000,
    )  # fmt: skip
    response = step_response(experiment)
    area = np.trapezoid(response.responses[0].output, response.time)
    demand = outcomes(Demands(max_load_error=9.0), [plant], loops)[0]
    assert demand.value == pytest.approx(1.5)
    assert area == pytest.approx(1.5, rel=1e-2)


def test_sensitivity_alone_is_that_of_each_loop_on_the_whole_axis() -> None:
    """A matrix plant with dead time: the peak recomputed is within the limit, and close to it."""

    def element(gain: float, lag: float, delay: float) -> TransferFunction:
        return TransferFunction((gain,), (lag, 1.0), delay)

    plant = MatrixPlant(
        [
            [element(12.8, 16.7, 1), element(-18.9, 21, 3)],
            [element(6.6, 10.9, 7), element(-19.4, 14.4, 3)],
        ]
    )
    free = tune(Specification(plant, Uncertainty.from_error(0.1, 0.5), Performance()))
    worst = max(row.alone.sensitivity.value for row in loop_margins(plant, free.loops) if row.alone)
    limit = 1 + 0.8 * (worst - 1)
    found = tune(
        Specification(
            plant, Uncertainty.from_error(0.1, 0.5), Performance(),
            demands=Demands(max_sensitivity_alone=limit),
        )
    )  # fmt: skip
    assert found.demands[0].met
    assert found.demands[0].active
    assert found.tau_p > free.tau_p  # type: ignore[operator]


def test_rows_of_loops_alone_have_exact_gradients() -> None:
    """Against differences, for a matrix plant whose loops share settings."""
    plant = MatrixPlant(
        [
            [TransferFunction((2.0,), (3.0, 1.0), 0.5), TransferFunction((1.0,), (1.0, 1.0))],
            [TransferFunction((1.0,), (1.0, 1.0)), TransferFunction((1.0,), (5.0, 1.0))],
        ]
    )
    alone = LoopsAlone.of(plant, ((0, 1),), 1.7)
    theta, signs = np.log([1.2, 2.0, 0.3]), np.array([1.0])
    level, gradient, stable = alone.levels(theta, signs, lead=True)
    assert stable
    assert level.size == 2 * alone.omega.size
    for index in range(3):
        step = 1e-6 * np.eye(3)[index]
        ends = [alone.levels(theta + sign * step, signs, lead=True)[0] for sign in (1, -1)]
        assert gradient[:, index] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-6)


def test_what_no_settings_meet_is_named_with_how_far_to_relax_it() -> None:
    """Slow by the first demand, fast by the second: both are named, with limits that can be met."""
    found = tuned(Demands(max_controller_gain=1e-3, max_load_error=1e-2), starts=4)
    assert found.status is Status.INFEASIBLE
    assert not found.loops
    assert found.reason is not None
    said = dict(re.findall(r"(\w+) [0-9.]+ relaxed to ([0-9.]+)", found.reason))
    assert set(said) == {"max_controller_gain", "max_load_error"}
    relaxed = Demands(**{name: float(limit) for name, limit in said.items()})
    assert tuned(relaxed, starts=4).status is Status.OPTIMAL
    # The settings without demands have 47.7 and 2.12: nearer limits are met.
    assert relaxed.max_controller_gain is not None
    assert relaxed.max_controller_gain < 45
    assert relaxed.max_load_error is not None
    assert relaxed.max_load_error < 2


def test_a_demand_that_can_be_kept_is_not_blamed() -> None:
    """Beside an integrated error that cannot be had a gain of 40 is kept, and not named."""
    asked = Demands(max_controller_gain=40, max_load_error=0.05)
    found = tuned(asked, starts=4)
    assert found.status is Status.INFEASIBLE
    assert found.reason is not None
    assert "max_controller_gain" not in found.reason
    limit = float(found.reason.partition("max_load_error 0.05 relaxed to ")[2].split()[0])
    assert limit < 1
    kept = tuned(replace(asked, max_load_error=limit), starts=4)
    assert kept.status is Status.OPTIMAL


@pytest.mark.parametrize("kind", [ControllerKind.PID, ControllerKind.PIDF])
def test_other_kinds_keep_demands(kind: ControllerKind) -> None:
    """With derivative action the gain at high frequency is what is limited."""
    found = tuned(
        Demands(max_controller_gain=100, max_load_error=3), kind=kind,
        arrangement=Arrangement.IDENTICAL, starts=6,
    )  # fmt: skip
    assert found.status is Status.OPTIMAL
    assert all(each.value <= each.limit for each in found.demands)


def test_the_objective_mu_keeps_demands() -> None:
    """At a given tau_P too."""
    found = tune(
        Specification(
            SEED, UNCERTAINTY, Performance(tau_p=20.0), objective=Objective.MU,
            demands=Demands(max_load_error=1.5),
        )
    )  # fmt: skip
    assert found.demands[0].value <= 1.5
    assert found.peaks is not None
    assert found.peaks.robust_performance.value < 1


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"max_controller_gain": 0.0}, "/max_controller_gain"),
        ({"max_load_error": -1.0}, "/max_load_error"),
        ({"max_load_error": math.nan}, "/max_load_error"),
        ({"max_sensitivity_alone": 1.0}, "/max_sensitivity_alone"),
        ({"max_sensitivity_alone": math.inf}, "/max_sensitivity_alone"),
    ],
)
def test_limits_out_of_range_are_refused(given: dict[str, float], field: str) -> None:
    """By name."""
    with pytest.raises(InvalidInputError) as caught:
        Demands(**given)
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("demands", "field"),
    [
        (Demands(max_controller_gain=5), "/demands/max_controller_gain"),
        (Demands(max_load_error=1e-3), "/demands/max_load_error"),
    ],
)
def test_demands_that_the_bounds_contradict_are_refused(demands: Demands, field: str) -> None:
    """Told before the search."""
    with pytest.raises(InvalidInputError) as caught:
        Specification(
            SEED, UNCERTAINTY, Performance(), demands=demands,
            bounds=Bounds(gain=(10, 100), integral_time=(1, 50)),
        )  # fmt: skip
    assert caught.value.field == field
