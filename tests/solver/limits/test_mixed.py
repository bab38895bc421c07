"""Loops that control combinations of outputs and move combinations of inputs."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from service.cli.commands import app
from service.schemas import parse_tuning_request
from solver.limits import structure_search
from solver.limits.mixed import mixed_controller, tune_task
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.measured import MeasuredPlant
from solver.model.mixing import Mixing, mixed_outputs
from solver.model.physical_models import StreamSplit
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.centralised import analyse_centralised
from solver.tuning.demands import Demands
from solver.tuning.record import Status
from solver.tuning.specification import Bounds, Specification
from solver.tuning.tuner import tune

EXAMPLES = Path(__file__).parents[3] / "examples"
SEED = first_order(2, 1.0, 100.0, 0.949)
UNCERTAIN = Uncertainty.from_error(epsilon=0.2, theta=1.0)
SUM = ((1.0, 1.0), (1.0, -1.0))
OMEGA = np.geomspace(1e-5, 1e4, 80)


def task(plant: Any = SEED, **options: Any) -> Specification:
    return Specification(plant, UNCERTAIN, Performance(), **options)


@pytest.mark.parametrize("seed", range(12))
def test_combined_outputs_are_sums_of_elements(seed: int) -> None:
    """For drawn plants of one dead time the response is M G, whatever the denominators."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 4))
    delay = float(random.choice([0.0, 2.5]))
    dens = [(10 ** random.uniform(-2, 3), 1.0) for _ in range(2)]
    rows = [
        [TransferFunction((random.normal(),), dens[random.integers(2)], delay) for _ in range(n)]
        for _ in range(n)
    ]
    plant = MatrixPlant(rows)
    M = random.normal(size=(n, n))
    mixed = mixed_outputs(plant, Mixing(outputs=tuple(map(tuple, M))))
    exact = M @ plant.response(OMEGA)
    scale = np.abs(M) @ np.abs(plant.response(OMEGA))
    assert (np.abs(mixed.response(OMEGA) - exact) <= 1e-9 * scale).all()


def test_what_cancels_is_zero() -> None:
    """The difference of two units does not see a third one, exactly."""
    plant = StreamSplit(3, 10, 0.5, 2, 0.8, header_time=2, valve_time=0.5, dead_time=0.1).plant()
    mixed = mixed_outputs(plant, Mixing(outputs=((1, 1, 1), (-1, 1, 0), (0, -1, 1))))
    assert mixed.element(1, 2).is_zero
    assert mixed.element(2, 0).is_zero
    assert mixed.element(0, 0) == mixed.element(0, 1) == mixed.element(0, 2)


def test_combined_outputs_are_tuned_and_proven_as_any_plant() -> None:
    """The same settings as on the combined plant written out, with its proof."""
    mixed = task(mixing=Mixing(outputs=SUM), certificate=True)
    found = tune_task(mixed)
    by_hand = tune(task(mixed_outputs(SEED, Mixing(outputs=SUM))))
    assert found.tau_p == by_hand.tau_p
    assert found.guarantee is not None
    assert found.guarantee.status == "proven"
    assert found.certificate is not None


def test_units_of_their_own_are_ordinary_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inputs mixed by the identity are the plain tuning."""
    monkeypatch.setattr(structure_search, "STARTS", 1)
    found = tune_task(task(arrangement="identical", mixing=Mixing(inputs=((1, 0), (0, 1)))))
    assert found.tau_p == pytest.approx(25.7735, rel=1e-3)
    assert found.loops[0].gain == pytest.approx(39.52, rel=0.02)


def test_sum_and_difference_reach_what_mode_control_reaches(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the coordinates of the outputs, where sigma_max is the same, the peak is 1 too.

    tau_P = 13.757 is the least one of mode control: there the least mu is 1.
    """
    monkeypatch.setattr(structure_search, "STARTS", 1)  # the best of them: half the time
    mixing = Mixing(outputs=SUM, inputs=SUM)
    demand = Performance(tau_p=13.757)
    found = tune_task(Specification(SEED, UNCERTAIN, demand, objective="mu", mixing=mixing))
    assert found.status is Status.OPTIMAL
    assert found.peaks is not None
    assert found.peaks.robust_performance.value == pytest.approx(1, abs=1e-4)
    assert found.guarantee is not None
    assert found.guarantee.status == "proven"
    # K = M_u C M_y on the plant itself; M_y is orthogonal but for a factor.
    own = mixed_controller(found.loops, mixing)
    M = np.array(SUM)
    full = MatrixPlant(
        [
            [
                TransferFunction(
                    np.polyadd(
                        M[0, c] * np.polymul(own.element(r, 0).num, own.element(r, 1).den),
                        M[1, c] * np.polymul(own.element(r, 1).num, own.element(r, 0).den),
                    ).tolist(),
                    np.polymul(own.element(r, 0).den, own.element(r, 1).den).tolist(),
                )
                for c in range(2)
            ]
            for r in range(2)
        ]
    )
    matrix = MatrixPlant(SEED.rows)
    judged = analyse_centralised(matrix, UNCERTAIN, demand, full)
    assert judged.peaks is not None
    assert judged.peaks.robust_performance.value == pytest.approx(1, abs=1e-4)


def test_bounds_demands_and_a_start_are_kept_by_loops_that_move_combinations() -> None:
    """They bind, are never exceeded, and are told; from a start it is the best beside it.

    Without them mu is 0.9150.
    """
    plain = Specification(
        SEED, UNCERTAIN, Performance(tau_p=20.0), objective="mu",
        mixing=Mixing(outputs=SUM, inputs=SUM),
    )  # fmt: skip
    # The settings of the search from everywhere, in four digits.
    start = (Controller(9.104, 34.47), Controller(30.83, 68.65))
    most = 24.66
    kept = tune_task(
        replace(
            plain, start=start, demands=Demands(max_controller_gain=most),
            bounds=Bounds(gain=(1.0, 50.0), integral_time=(36.0, 90.0)),
        )
    )  # fmt: skip
    assert kept.status is Status.LOCAL
    assert kept.loops[1].gain == pytest.approx(most)
    assert kept.loops[1].gain <= most
    assert kept.loops[0].integral_time == pytest.approx(36.0)
    assert kept.loops[0].integral_time >= 36.0
    assert [(each.name, each.met, each.active) for each in kept.demands] == [
        ("max_controller_gain", True, True)
    ]
    assert kept.peaks is not None
    assert kept.peaks.robust_performance.value > 1.04


def test_derivative_action_begins_beside_the_best_pi_settings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Inputs left as they are: the identical PID settings of the ordinary search, or as good.

    18.638 is the tau_P of a local optimum of these: mu there is 1, and PI leaves 1.1.
    """
    monkeypatch.setattr(structure_search, "STARTS", 1)
    as_they_are = Mixing(inputs=((1, 0), (0, 1)))
    found = tune_task(
        Specification(
            SEED, UNCERTAIN, Performance(tau_p=18.638), objective="mu", kind="PID",
            arrangement="identical", mixing=as_they_are,
        )
    )  # fmt: skip
    assert found.peaks is not None
    assert found.peaks.robust_performance.value <= 1.001
    assert found.loops[0].derivative_time is not None


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({}, ""),
        ({"outputs": ((1.0, 1.0), (1.0, 1.0))}, "/outputs"),
        ({"outputs": ((1.0, 2.0), (1.0,))}, "/outputs/1"),
        ({"inputs": ((1.0, float("nan")), (1.0, 1.0))}, "/inputs"),
        ({"inputs": ((0.0, 0.0), (1.0, 1.0))}, "/inputs"),
    ],
)
def test_matrices_that_say_nothing_are_refused(given: dict[str, Any], field: str) -> None:
    """None, singular, ragged, not finite."""
    with pytest.raises(InvalidInputError) as caught:
        Mixing(**given)
    assert caught.value.field == field


def test_units_of_the_signals_do_not_make_a_matrix_singular() -> None:
    """Rows and columns of 1e-6 and 1e6 are as regular as those of 1."""
    Mixing(outputs=((1e-6, 1.0), (-1e-6, 1.0)), inputs=((1e6, -1e6), (1e-6, 1e-6)))


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"mixing": Mixing(outputs=np.eye(3).tolist())}, "/mixing/outputs"),
        ({"mixing": Mixing(outputs=SUM), "pairing": (1, 0)}, "/pairing"),
        ({"mixing": Mixing(inputs=SUM), "signs": "any"}, "/controller/signs"),
        ({"mixing": Mixing(inputs=SUM), "demands": Demands(integrity="stable")},  # type: ignore[arg-type]
         "/demands/integrity"),
        ({"mixing": Mixing(outputs=SUM, inputs=SUM), "start": [Controller(-1.0, 9.0)] * 2},
         "/search/start/0/gain"),
        ({"mixing": Mixing(outputs=SUM, inputs=SUM), "start": [Controller(1.0, None)] * 2},
         "/search/start/0/integral_time"),
        ({"mixing": Mixing(inputs=SUM), "arrangement": "best"}, "/controller/arrangement"),
        ({"mixing": Mixing(outputs=((1, 1), (1, -1)), inputs=((1, -1), (-1, -1)))},
         "/mixing/inputs"),
        ({"mixing": Mixing(inputs=SUM), "plant": first_order(12, 1.0, 10.0, 0.1)},
         "/mixing/inputs"),
        ({"mixing": Mixing(outputs=SUM), "plant": MatrixPlant(
            [[TransferFunction((1.0,), (9.0, 1.0), float(r == c)) for c in range(2)]
             for r in range(2)])}, "/mixing/outputs/0"),
    ],
)  # fmt: skip
def test_combinations_that_do_not_fit_are_named(options: dict[str, Any], field: str) -> None:
    """Sizes, pairings, kinds, loops that do not act on what they control, unlike dead times."""
    with pytest.raises(InvalidInputError) as caught:
        tune_task(task(**options))
    assert caught.value.field == field


def test_data_combine_too() -> None:
    """Outputs of a measured plant, whatever its dead times."""
    plant = MeasuredPlant(OMEGA, SEED.response(OMEGA), unstable_poles=0)
    mixed = mixed_outputs(plant, Mixing(outputs=SUM))
    assert mixed.response(OMEGA) == pytest.approx(np.array(SUM) @ SEED.response(OMEGA))


def test_the_worked_example_is_that_of_the_page(tmp_path: Path) -> None:
    """Two flows from one header: its own settings keep the demand, and move as the page says."""
    text = (EXAMPLES / "stream_split_objectives.json").read_text("utf-8")
    body = json.loads(text)
    request = parse_tuning_request(text)
    plant = StreamSplit(
        2, flow=10, opening=0.5, pressure_drop=2, supply_resistance=0.8, header_time=2,
        valve_time=0.5, dead_time=0.1,
    ).plant()  # fmt: skip
    assert request.build().plant == plant
    loops = [
        {"gain": 0.019747, "integral_time": 0.19401},
        {"gain": 0.013334, "integral_time": 0.28625},
    ]
    shared = {name: body[name] for name in ("plant", "mixing")}
    judged = tmp_path / "robustness.json"
    judged.write_text(json.dumps({
        **shared, "uncertainty": body["uncertainty"], "performance": {"tau_p": 0.76759},
        "loops": loops, "certificate": "none",
    }), "utf-8")  # fmt: skip
    done = CliRunner().invoke(app, ["robustness", str(judged), "--json"])
    assert done.exit_code == 0, done.output
    peak = json.loads(done.stdout)["peaks"]["robust_performance"]
    assert peak["value"] == pytest.approx(1, abs=1e-4)
    # By definition: N of errors of the valves, its scales sought on a lattice that closes in.
    omega = np.append(np.geomspace(0.1, 50, 60), peak["omega"])
    own = plant.response(omega)
    c = np.stack([Controller(**loop).response(omega) for loop in loops], axis=-1)
    P = np.array(body["mixing"]["outputs"]) @ own
    K = np.array(body["mixing"]["inputs"]) * c[:, None, :]
    S = np.linalg.inv(np.eye(2) + P @ K)
    w_I = Uncertainty.from_error(**body["uncertainty"]).magnitude(omega)[:, None, None]
    w_P = Performance(tau_p=0.76759).magnitude(omega)[:, None, None]
    N = np.block([[w_I * (K @ S @ P), w_I * (K @ S)], [w_P * (S @ P), w_P * S]])
    best, center = np.full(omega.size, np.inf), np.zeros((omega.size, 2))
    for width in 8.0 * 0.55 ** np.arange(14):
        tried = center + width * np.array([*itertools.product((-1, 0, 1), repeat=2)])[:, None, :]
        d = np.exp(np.concatenate([tried, np.zeros((9, omega.size, 2))], axis=2))
        levels = np.linalg.norm(d[..., None] * N / d[:, :, None, :], 2, axis=(2, 3))
        best = np.minimum(best, levels.min(axis=0))
        center = tried[levels.argmin(axis=0), np.arange(omega.size)]
    assert best.max() == pytest.approx(peak["value"], abs=1e-3)
    assert best[-1] == pytest.approx(peak["value"], abs=1e-3)
    steps = tmp_path / "steps.json"
    steps.write_text(json.dumps({
        **shared, "loops": loops, "steps": [{"kind": "setpoint", "unit": 0}], "duration": 20.0,
    }), "utf-8")  # fmt: skip
    done = CliRunner().invoke(app, ["step-response", str(steps), "--json"])
    assert done.exit_code == 0, done.output
    total, difference = json.loads(done.stdout)["responses"]
    assert total["output"][-1] == pytest.approx(1, abs=1e-3)
    assert max(map(abs, difference["output"])) < 1e-9  # equal valves keep equal flows
    assert total["input"] == pytest.approx(difference["input"])


def test_others_refuse_combinations_of_inputs(tmp_path: Path) -> None:
    """Sets of loops in service know loops with one input each."""
    body = json.loads((EXAMPLES / "stream_split_objectives.json").read_text("utf-8"))
    path = tmp_path / "integrity.json"
    path.write_text(json.dumps({
        "plant": body["plant"], "mixing": body["mixing"], "uncertainty": body["uncertainty"],
        "performance": {"tau_p": 2.0}, "loops": [{"gain": 0.01, "integral_time": 1.0}] * 2,
    }), "utf-8")  # fmt: skip
    done = CliRunner().invoke(app, ["integrity", str(path)])
    assert done.exit_code == 2
    assert "/mixing/inputs" in done.output


def test_the_controller_is_its_matrix_times_its_loops() -> None:
    """M_u diag(c), element by element, filters included."""
    loops = (Controller(2.0, 3.0, 1.0), Controller(-1.0, None, 2.0, 0.5))
    found = mixed_controller(loops, Mixing(inputs=((1.0, -2.0), (0.0, 3.0)))).response(OMEGA)
    c = np.stack([loop.response(OMEGA) for loop in loops], axis=-1)
    assert found == pytest.approx(np.array([[1.0, -2.0], [0.0, 3.0]]) * c[:, None, :])
