"""Tuning and robustness of plants that are known at some frequencies only."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import control
import numpy as np
import pytest
from numba import types
from typer.testing import CliRunner

import mutune
from service.cli.commands import app
from solver.model.arranged import paired, sampled
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.measured import MeasuredPlant, NoTransferFunctionsError
from solver.model.plants import MatrixPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.mu.scaling import sweep
from solver.robustness.analysis import analyse
from solver.robustness.curves import LoopAnalysis
from solver.robustness.on_data import data_analysis
from solver.stability.closed_loop import unstable_poles
from solver.stability.on_data import Undecided, at_rest, unstable_poles_on_data
from solver.tuning.demands import Demands
from solver.tuning.judged_loop import judged_loop, judged_loops
from solver.tuning.loop_levels import loop_levels
from solver.tuning.record import Status
from solver.tuning.resolution import Resolution
from solver.tuning.scenarios import Scenario
from solver.tuning.service_sets import integrity_value
from solver.tuning.specification import Specification
from solver.tuning.spread import Spread
from solver.tuning.tuner import tune

SEED = first_order(2, 1.0, 100.0, 0.949)
UNCERTAIN = Uncertainty.from_error(epsilon=0.2, theta=1.0)
OMEGA = np.geomspace(1e-4, 30, 200)


def sampled_at(plant: Plant, omega: Any = OMEGA) -> MeasuredPlant:
    return MeasuredPlant(omega, plant.response(omega), unstable_poles=0)


def tuned(plant: MeasuredPlant, **options: Any) -> Any:
    return tune(Specification(plant, UNCERTAIN, Performance(), **options))


def test_settings_as_found_are_judged_at_the_frequencies_of_the_data() -> None:
    """The tau_P of the model's within the density of the data; unstable ones have none."""
    today = (Controller(46.3, 101.0), Controller(22.8, 3.15))
    options = {"arrangement": "identical", "starts": 1}
    here = tuned(sampled_at(SEED), as_found=today, **options).as_found
    there = tune(
        Specification(SEED, UNCERTAIN, Performance(), as_found=today, **options)  # type: ignore[arg-type]
    ).as_found
    assert here.nominally_stable
    assert here.tau_p == pytest.approx(there.tau_p, rel=3e-3)
    assert here.tau_p <= there.tau_p * (1 + 1e-6)
    wrong = tuned(sampled_at(SEED), as_found=(Controller(-1.0, 5.0),) * 2, **options).as_found
    assert not wrong.nominally_stable
    assert wrong.tau_p is None
    assert "unstable" in wrong.reason


def test_data_need_no_compiled_code_of_their_own() -> None:
    """Frequencies that are closed for writing would have all of it compiled once more."""
    demands = Demands(max_sensitivity_alone=1.5, integrity="robustly_stable")  # type: ignore[arg-type]
    tuned(sampled_at(SEED, OMEGA[::4]), arrangement="identical", starts=1, demands=demands)
    for kernel in (judged_loop, judged_loops, loop_levels, sweep):
        for signature in kernel.signatures:
            assert all(kind.mutable for kind in signature if isinstance(kind, types.Array))


@pytest.mark.parametrize(
    ("arrangement", "kind", "exact"),
    [("identical", "PI", 25.7735), ("independent", "PI", 18.4463), ("identical", "PID", 12.976)],
)
def test_dense_data_give_the_tuning_of_the_model(arrangement: str, kind: str, exact: float) -> None:
    """Within 0.2 %, never above the model's but for rounding, with an open guarantee."""
    found = tuned(sampled_at(SEED), arrangement=arrangement, kind=kind)
    assert found.status is Status.OPTIMAL
    assert exact * (1 - 2e-3) < found.tau_p < exact * (1 + 1e-4)
    assert found.guarantee.status == "open"
    assert "nothing is proven between" in found.guarantee.reason
    assert found.peaks.robust_performance.value == pytest.approx(1, abs=1e-7)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_change_nothing(unit: float) -> None:
    """Time and inputs in other units: the same settings in those units."""
    plain = tuned(sampled_at(SEED, OMEGA[::2]), arrangement="identical")
    scaled = first_order(2, 1 / unit, 100.0 * unit, 0.949)
    task = Specification(
        sampled_at(scaled, OMEGA[::2] / unit),
        Uncertainty.from_error(epsilon=0.2, theta=unit),
        Performance(),
        arrangement="identical",  # type: ignore[arg-type]  # a value becomes the member
    )
    found = tune(task)
    assert found.tau_p == pytest.approx(plain.tau_p * unit, rel=1e-6)
    assert found.loops[0].gain == pytest.approx(plain.loops[0].gain * unit, rel=1e-4)


def test_bounds_of_mu_are_those_of_the_model() -> None:
    """At its frequencies a sampled plant has the curves of the one that was sampled."""
    loops = (Controller(46.3, 101.0), Controller(22.8, 3.15))
    performance = Performance(tau_p=19.0)
    data = data_analysis(sampled_at(SEED), UNCERTAIN, performance, loops).curves(OMEGA)
    matrix = MatrixPlant(SEED.rows)
    from solver.model.blocks import group_loops  # noqa: PLC0415 - beside what it is for

    model = LoopAnalysis(*group_loops(matrix, loops), UNCERTAIN, performance).curves(OMEGA)
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        assert getattr(data, name) == pytest.approx(getattr(model, name), rel=1e-9)


def random_plant(seed: int) -> MatrixPlant:
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 4))

    def element(own: bool) -> TransferFunction:
        gain = random.uniform(0.5, 2) if own else random.uniform(-0.5, 0.5)
        return TransferFunction((gain,), (10 ** random.uniform(0, 2), 1.0), random.uniform(0, 3))

    return MatrixPlant([[element(r == c) for c in range(n)] for r in range(n)])


@pytest.mark.parametrize("seed", range(40))
def test_turns_on_data_count_the_poles_of_the_model(seed: int) -> None:
    """For drawn plants and settings, stable and unstable, the count is right or not made."""
    plant = random_plant(seed)
    random = np.random.default_rng(1000 + seed)
    loops = [
        Controller(10 ** random.uniform(-1, 1.5), 10 ** random.uniform(0, 2.5), lead)
        for lead in random.choice([None, 2.0], plant.n)
    ]
    data = sampled_at(plant, np.geomspace(1e-4, 1e3, 3000)[:2000:1])
    found = unstable_poles_on_data(data, at_rest(data), loops)
    if not isinstance(found, Undecided):
        assert found == unstable_poles(plant, loops)


def test_most_drawn_loops_are_decided() -> None:
    """Undecided is the exception: it does not hide the count."""
    undecided = 0
    for seed in range(30):
        plant = random_plant(seed)
        data = sampled_at(plant, np.geomspace(1e-4, 1e3, 2000))
        loops = [Controller(0.3, 30.0)] * plant.n
        found = unstable_poles_on_data(data, at_rest(data), loops)
        undecided += isinstance(found, Undecided)
        assert isinstance(found, Undecided) or found == unstable_poles(plant, loops)
    assert undecided <= 3


def test_what_the_data_do_not_decide_is_said() -> None:
    """Poles that are not stated, data that begin too high, end too low, or are too coarse."""
    loops = (Controller(46.3, 101.0), Controller(22.8, 3.15))
    cases = [
        (dataclasses.replace(sampled_at(SEED), unstable_poles=None), "/plant/unstable_poles"),
        (dataclasses.replace(sampled_at(SEED), unstable_poles=1), "/plant/unstable_poles"),
        (sampled_at(SEED, OMEGA[80:]), "/plant/omega/0"),
        (sampled_at(first_order(2, 1.0, 1e12, 0.5)), "/plant/omega/0"),  # as good as integrating
        (sampled_at(SEED, OMEGA[:100]), "/plant/omega"),
        (sampled_at(first_order(2, 1.0, 100.0, 0.949, 2.0), OMEGA[::20]), "/plant/omega"),
    ]
    for plant, field in cases:
        with pytest.raises(UnsupportedPlantError) as caught:
            analyse(plant, UNCERTAIN, Performance(tau_p=19.0), loops)
        assert caught.value.field == field


def test_unstable_settings_are_counted() -> None:
    """Too high a gain behind dead time: no mu, and as many poles as the model has."""
    plant, loops = first_order(2, 1.0, 100.0, 0.5, 2.0), (Controller(150.0, 90.0),) * 2
    data = sampled_at(plant, np.geomspace(1e-4, 30, 2000))
    found = analyse(data, UNCERTAIN, Performance(tau_p=19.0), loops)
    assert not found.nominally_stable
    assert found.unstable_poles == unstable_poles(plant, loops) > 0
    assert found.peaks is None


def test_pairing_and_scan_time_act_on_the_data() -> None:
    """As on the plant that was sampled, to rounding."""
    plant = random_plant(6)
    order = tuple(reversed(range(plant.n)))
    data = paired(sampled(sampled_at(plant), 0.4), order)
    model = paired(sampled(plant, 0.4), order)
    assert data.response(OMEGA) == pytest.approx(model.response(OMEGA), rel=1e-12)
    assert data.part([0]).n == 1


def test_a_pairing_that_no_settings_serve_is_named_on_data() -> None:
    """Where the static gains forbid integral action in all loops, the reason is that."""
    found = tuned(sampled_at(SEED), pairing=(1, 0))
    assert found.status is Status.INFEASIBLE
    assert "by the data the Niederlinski index is negative" in found.reason
    assert "'any'" not in found.reason


def test_demands_and_bounds_hold_on_data() -> None:
    """A gain that is limited, and an integral time within bounds."""
    demands = Demands(max_controller_gain=20.0)
    found = tuned(sampled_at(SEED), arrangement="identical", demands=demands)
    assert found.demands[0].met
    assert found.demands[0].active
    assert abs(found.loops[0].gain) <= 20.0 * (1 + 1e-6)
    assert found.tau_p > 25.8


def of_model(**options: Any) -> Any:
    return tune(Specification(SEED, UNCERTAIN, Performance(), **options))


def test_scenarios_on_data_are_those_of_the_model() -> None:
    """Either loop out of service, and another response: what each needs, and which one decides."""
    other = first_order(2, 1.0, 100.0, 0.96)
    out = Scenario("out", any_in_service=(1,))
    found = tuned(sampled_at(SEED), starts=2, scenarios=(out, Scenario("o", sampled_at(other))))
    exact = of_model(starts=2, scenarios=(out, Scenario("o", other)))
    assert found.tau_p == pytest.approx(exact.tau_p, rel=5e-3)
    assert found.active != "as given"
    assert [each.sets for each in found.scenarios] == [1, 2, 1]
    assert max(own.tau_p for own in found.scenarios) == pytest.approx(found.tau_p)
    for own in found.scenarios:
        assert own.guarantee.status == "open"
        assert own.peaks.robust_performance.value <= 1 + 1e-6


def test_spread_of_sizes_on_data_is_that_of_the_model() -> None:
    """An interaction that is off by two per cent, and gains of each unit."""
    for spread in (Spread(interaction=0.02), Spread(gain=0.05, each_unit=True)):
        options = {"arrangement": "identical", "starts": 1, "spread": spread}
        found, exact = tuned(sampled_at(SEED, OMEGA[::2]), **options), of_model(**options)
        assert found.tau_p == pytest.approx(exact.tau_p, rel=0.02)
        assert dict(found.spread.worst).keys() == dict(exact.spread.worst).keys()
        assert found.active == "spread"


@pytest.mark.parametrize("steps", [{"digits": 2}, {"time": 1.0}, {"gain": 5.0, "time": 1.0}])
def test_numbers_that_controllers_accept_on_data(steps: dict[str, Any]) -> None:
    """As of the model, typed as they are, and never better than exact ones."""
    options = {"starts": 2, "resolution": Resolution(**steps)}
    found, exact = tuned(sampled_at(SEED), **options), of_model(**options)
    assert found.tau_p == pytest.approx(exact.tau_p, rel=3e-3)
    assert found.resolution.tau_p_exact < found.resolution.tau_p_rounded == found.tau_p
    times = {str(loop.integral_time) for loop in found.loops}
    assert all(len(time.removesuffix(".0").rstrip("0")) <= 3 for time in times)


def test_loops_alone_and_integrity_are_kept_on_data() -> None:
    """Their values are those of the model, and a demand that nobody can meet is named."""
    demands = Demands(max_sensitivity_alone=1.2, integrity="robustly_stable")  # type: ignore[arg-type]
    found, exact = tuned(sampled_at(SEED), starts=2, demands=demands), of_model(demands=demands)
    assert found.tau_p == pytest.approx(exact.tau_p, rel=5e-3)
    for own, its in zip(found.demands, exact.demands, strict=True):
        assert own.met
        assert own.name == its.name
        assert own.value == pytest.approx(its.value, rel=5e-3)
    never = tuned(
        sampled_at(SEED, OMEGA[::4]),
        arrangement="identical",
        starts=1,
        demands=Demands(max_load_error=0.05),
    )
    assert never.status is Status.INFEASIBLE
    assert "max_load_error 0.05 relaxed to 0.3" in never.reason


def test_sets_in_service_on_data_are_those_of_the_model() -> None:
    """Of drawn plants: how many sets are unstable, and how robustly stable the others are."""
    robust = 0
    for seed in range(12):
        plant = random_plant(seed)
        random = np.random.default_rng(seed)
        loops = tuple(
            Controller(float(random.choice([-1, 1]) * 10 ** random.uniform(-2, -0.5)), 30.0)
            for _ in range(plant.n)
        )
        data = sampled_at(plant, np.geomspace(1e-5, 100, 400))
        unstable = integrity_value(plant, UNCERTAIN, loops, robust=False)
        assert integrity_value(data, UNCERTAIN, loops, robust=False) == unstable
        if not unstable:
            robust += 1
            exact = integrity_value(plant, UNCERTAIN, loops, robust=True)
            assert integrity_value(data, UNCERTAIN, loops, robust=True) == pytest.approx(
                exact, rel=0.01
            )
    assert robust >= 2


def test_best_arrangement_and_comparison_on_data() -> None:
    """Unlike settings are told beside identical ones, which stay where little is gained."""
    found = tuned(sampled_at(SEED), arrangement="best", starts=3)
    assert len(found.groups) == 2
    assert found.comparison.gain_percent == pytest.approx(28.4, abs=0.5)
    assert any("Lower gains are not safer" in each for each in found.advice)
    assert found.settings_tolerance.lower_gains == pytest.approx(1.042, abs=2e-3)
    three = tuned(sampled_at(first_order(3, 1.0, 50.0, 0.5)), arrangement="best", starts=1)
    assert len(three.groups) == 1


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"signs": "any"}, "/controller/signs"),
        ({"pairing": "best"}, "/pairing"),
        ({"optimality_gap": True}, "/search/optimality_gap"),
        ({"spread": Spread(time_constant=0.1)}, "/spread/time_constant"),
        ({"spread": Spread(dead_time=0.1)}, "/spread/dead_time"),
        ({"scenarios": (Scenario("model", SEED),)}, "/scenarios/0/plant"),
    ],
)
def test_what_needs_a_model_is_refused_by_name(options: dict[str, Any], field: str) -> None:
    """Each with the field that asks for it."""
    with pytest.raises(InvalidInputError) as caught:
        tuned(sampled_at(SEED), **options)
    assert caught.value.field == field


def test_everything_else_refuses_such_a_plant() -> None:
    """Step responses, poles and interaction name the kind of the plant and what to do."""
    plant, loops = sampled_at(SEED), (Controller(20.0, 50.0),) * 2
    for ask in (
        lambda: mutune.step_response(
            mutune.Experiment(plant, loops, (mutune.Step(mutune.StepKind.LOAD, 0, 0.0, 1.0),), 10.0)
        ),
        lambda: mutune.integrity(plant, UNCERTAIN, Performance(tau_p=19.0), loops),
        lambda: mutune.analyse_interaction(plant),
        lambda: unstable_poles(plant, loops),
        lambda: mutune.to_control(plant),
    ):
        with pytest.raises(NoTransferFunctionsError) as caught:
            ask()
        assert caught.value.field == "/plant/kind"
        assert "identify" in caught.value.message


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"omega": [1.0, 0.5, 2.0]}, "/omega/1"),
        ({"omega": [1.0, 2.0]}, "/omega"),
        ({"values": np.ones((3, 2, 1))}, "/elements"),
        ({"values": np.full((3, 1, 1), math.nan)}, "/elements"),
        ({"values": np.ones((4, 1, 1))}, "/elements"),
        ({"values": np.ones((3, 11, 11))}, "/elements"),
        ({"unstable_poles": -1}, "/unstable_poles"),
    ],
)
def test_faulty_data_are_named(change: dict[str, Any], field: str) -> None:
    """Frequencies out of order, too few, wrong shapes, no numbers."""
    given = {"omega": [1.0, 2.0, 3.0], "values": np.ones((3, 1, 1)), **change}
    with pytest.raises(InvalidInputError) as caught:
        MeasuredPlant(**given)
    assert caught.value.field == field


def test_control_frd_is_such_a_plant() -> None:
    """Frequency-response data of python-control, which know no poles."""
    lag = control.tf([[[1], [0.5]], [[0.5], [1]]], [[[10, 1], [10, 1]], [[10, 1], [10, 1]]])
    found = mutune.plant(control.frd(lag, OMEGA), dead_time=1.0)
    assert isinstance(found, MeasuredPlant)
    assert found.unstable_poles is None
    assert found.response(OMEGA) == pytest.approx(
        first_order(2, 1.0, 10.0, 0.5, 1.0).response(OMEGA)
    )


def test_the_command_tunes_reports_and_refuses(tmp_path: Any) -> None:
    """tune with a report, robustness of its result; step-response and bad data end with 2."""
    G = SEED.response(OMEGA)
    plant = {
        "kind": "frequency_response",
        "omega": OMEGA.tolist(),
        "elements": [
            [{"re": G[:, r, c].real.tolist(), "im": G[:, r, c].imag.tolist()} for c in range(2)]
            for r in range(2)
        ],
        "unstable_poles": 0,
    }
    body = {"plant": plant, "uncertainty": {"epsilon": 0.2, "theta": 1.0},
            "controller": {"arrangement": "identical"}, "search": {"starts": 2}}  # fmt: skip
    asked, done, report = (tmp_path / name for name in ("a.json", "b.json", "c.html"))
    asked.write_text(json.dumps(body), "utf-8")
    run = CliRunner().invoke(app, ["tune", str(asked), "--json", "--report", str(report)])
    assert run.exit_code == 0, run.output
    done.write_text(run.stdout, "utf-8")
    assert "nothing is known between them" in report.read_text("utf-8")
    judged = CliRunner().invoke(app, ["robustness", str(done), "--json"])
    assert json.loads(judged.stdout)["guarantee"]["status"] == "open"
    steps = {"plant": plant, "loops": [{"gain": 1.0, "integral_time": 9.0}] * 2, "duration": 1.0,
             "direction": {"kind": "easy"}}  # fmt: skip
    asked.write_text(json.dumps(steps), "utf-8")
    refused = CliRunner().invoke(app, ["step-response", str(asked)])
    assert refused.exit_code == 2
    assert "/plant/kind" in refused.output
    plant["elements"][0][1]["im"] = [0.0, 1.0, 2.0]  # type: ignore[index]
    asked.write_text(json.dumps(body), "utf-8")
    refused = CliRunner().invoke(app, ["tune", str(asked)])
    assert refused.exit_code == 2
    assert "/plant/elements/0/1/im" in refused.output
