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
from solver.certificate.verify import verify
from solver.model.arranged import paired
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.deviations import Parameter, change_gain
from solver.model.errors import InvalidInputError
from solver.model.measured import MeasuredPlant
from solver.model.mixed_plant import MixedPlant
from solver.model.mixing import Mixing, mixed, summed_outputs
from solver.model.mode_controller import ModeController
from solver.model.physical_models import StreamSplit
from solver.model.plants import MatrixPlant, first_order
from solver.model.state_space import StateSpace, from_polynomials
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.axis import proven_peaks
from solver.robustness.box_proof import proven_box
from solver.robustness.centralised import analyse_centralised
from solver.robustness.curves import LoopAnalysis
from solver.robustness.worst_case import DiagonalPerturbation
from solver.tuning.record import Status, Tuning
from solver.tuning.resolution import Resolution
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Specification
from solver.tuning.spread import Spread
from solver.tuning.tuner import tune

EXAMPLES = Path(__file__).parents[3] / "examples"
SEED = first_order(2, 1.0, 100.0, 0.949)
UNCERTAIN = Uncertainty.from_error(epsilon=0.2, theta=1.0)
SUM = ((1.0, 1.0), (1.0, -1.0))
BOTH = Mixing(outputs=SUM, inputs=SUM)
OMEGA = np.geomspace(1e-5, 1e4, 80)


def task(plant: Any = SEED, **options: Any) -> Specification:
    return Specification(plant, UNCERTAIN, Performance(), **options)


@pytest.mark.parametrize("seed", range(12))
def test_combinations_are_sums_of_elements(seed: int) -> None:
    """For drawn plants the response is M_y G M_u, whatever denominators and dead times."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 4))
    plant, mixing = drawn(random, n, unlike=seed % 2 == 0)
    found = mixed(plant, mixing)
    M_y, M_u = np.array(mixing.outputs), np.array(mixing.inputs)
    exact = M_y @ plant.response(OMEGA) @ M_u
    scale = np.abs(M_y) @ np.abs(plant.response(OMEGA)) @ np.abs(M_u)
    assert (np.abs(found.response(OMEGA) - exact) <= 1e-12 * scale).all()
    assert found.static_gain() == pytest.approx(M_y @ plant.static_gain() @ M_u, abs=1e-9)
    by_entries = np.array(
        [[found.entry(r, c).response(OMEGA) for c in range(n)] for r in range(n)]
    ).transpose(2, 0, 1)
    assert (np.abs(by_entries - exact) <= 1e-9 * scale).all()


def test_what_cancels_is_zero() -> None:
    """The difference of two units does not see a third one, exactly."""
    plant = StreamSplit(3, 10, 0.5, 2, 0.8, header_time=2, valve_time=0.5, dead_time=0.1).plant()
    outputs = ((1.0, 1.0, 1.0), (-1.0, 1.0, 0.0), (0.0, -1.0, 1.0))
    for combined in (
        summed_outputs(plant, Mixing(outputs=outputs)),
        mixed(plant, Mixing(outputs=outputs)),
    ):
        assert combined.element(1, 2).is_zero
        assert combined.element(2, 0).is_zero
        assert combined.element(0, 0) == combined.element(0, 1) == combined.element(0, 2)


def as_system(loop: Controller) -> StateSpace:
    """Return a loop as a system of one input and one output."""
    return from_polynomials(*map(np.asarray, loop.polynomials))


def drawn(
    random: np.random.Generator, n: int, *, unlike: bool = True
) -> tuple[MatrixPlant, Mixing]:
    """Return a plant of first order elements, and combinations of its signals."""
    delays = [0.0, 0.5, 2.5] if unlike else [2.5]
    rows = [
        [
            TransferFunction(
                (float(random.normal()),), (10 ** random.uniform(-1, 2), 1.0),
                float(random.choice(delays)),
            )
            for _ in range(n)
        ]
        for _ in range(n)
    ]  # fmt: skip
    return MatrixPlant(rows), Mixing(*random.normal(size=(2, n, n)).tolist())


def bound(N: Any, inputs: int) -> float:
    """Return the upper bound of mu of N, its scales sought on a lattice that closes in."""
    best, center = np.inf, np.zeros(inputs)
    for width in 8.0 * 0.6 ** np.arange(40):
        tried = center + width * np.array([*itertools.product((-1, 0, 1), repeat=inputs)])
        d = np.hstack([np.exp(tried), np.ones((len(tried), len(N) - inputs))])
        levels = np.linalg.norm(d[:, :, None] * N / d[:, None, :], 2, axis=(1, 2))
        best, center = min(best, float(levels.min())), tried[levels.argmin()]
    return best


@pytest.mark.parametrize("seed", range(4))
def test_mu_is_that_of_errors_of_the_inputs_themselves(seed: int) -> None:
    """At drawn frequencies: N of (I + w_I Delta), one error a valve, by definition.

    For unlike dead times, weights and permitted errors; with one loop in manual too.
    """
    random = np.random.default_rng(seed)
    n = 2 + seed // 2
    plant, mixing = drawn(random, n)
    units = [0, 2] if seed == 3 else list(range(n))
    uncertainty = Uncertainty.from_error([0.2, 0.1, 0.3][:n], [1.0, 2.0, 0.5][:n])
    seen = mixed(plant, mixing).part(units)
    scale = tuple((10 ** random.uniform(-1, 1, len(units))).tolist())
    demand = Performance(tau_p=50.0, output_scale=scale)
    loops = [Controller(*(10 ** random.uniform(-1, 1, 2)).tolist()) for _ in units]
    analysis = LoopAnalysis(*group_loops(seen, loops, uncertainty, scale), uncertainty, demand)
    omega = 10 ** random.uniform(-3, 1, 3)
    G = np.array(mixing.outputs)[units] @ plant.response(omega)
    K = (
        np.array(mixing.inputs)[:, units]
        * np.stack([loop.response(omega) for loop in loops], axis=-1)[:, None, :]
    )
    w_I = np.stack([w.response(omega) for w in uncertainty.weights], axis=-1)[:, :, None]
    w_P = demand.weight.response(omega)[:, None, None] / np.array(scale)[:, None]
    S = np.linalg.inv(np.eye(len(units)) + G @ K)
    N = np.block([[w_I * (K @ S @ G), w_I * (K @ S @ np.diag(scale))],
                  [w_P * (S @ G), w_P * (S @ np.diag(scale))]])  # fmt: skip
    found = analysis.robust_performance(omega)
    assert found == pytest.approx([bound(each, n) for each in N], rel=1e-6)
    assert analysis.robust_stability(omega) == pytest.approx(
        [bound(each[:n, :n], n) for each in N], rel=1e-6
    )
    norms = np.linalg.norm(w_P * (S @ np.diag(scale)), 2, axis=(1, 2))
    assert analysis.nominal_performance(omega) == pytest.approx(norms)


def test_combined_outputs_are_tuned_and_proven_as_any_plant() -> None:
    """The same settings as on the combined plant written out, with its proof."""
    mixing = Mixing(outputs=SUM)
    found = tune(task(mixing=mixing, certificate=True, starts=1))
    by_hand = tune(task(summed_outputs(SEED, mixing), starts=1))
    assert found.tau_p == pytest.approx(by_hand.tau_p, rel=1e-9)
    assert found.guarantee is not None
    assert found.guarantee.status == "proven"
    assert found.certificate is not None
    assert verify(json.dumps(found.certificate.to_document())).verdict == "proven"


@pytest.mark.parametrize(
    ("mixing", "plant"),
    [
        (Mixing(inputs=((1, 0), (0, 1))), SEED),
        (Mixing(outputs=((1, 0), (0, 1)), inputs=((0, 1), (1, 0))), paired(SEED, (1, 0))),
        (Mixing(inputs=((1e6, 0), (0, 1e6))), first_order(2, 1e6, 100.0, 0.949)),
    ],
)
def test_loops_with_an_input_each_are_ordinary_ones(mixing: Mixing, plant: Any) -> None:
    """The identity, another order, other units: the plant is what it is without mixing."""
    assert task(mixing=mixing).arranged(None).plant == plant


def test_errors_follow_the_inputs_that_the_loops_move() -> None:
    """In another order the first loop has the second input's error."""
    errors = Uncertainty.from_error([0.1, 0.2], 1.0)
    mixing = Mixing(inputs=((0, 1), (1, 0)))
    found = Specification(SEED, errors, Performance(), mixing=mixing).arranged(None)
    assert found.uncertainty.weights == errors.weights[::-1]


@pytest.fixture(scope="module")
def modes() -> Tuning:
    """The seed case by its sum and its difference, with all that a result can carry."""
    return tune(
        task(
            mixing=BOTH, certificate=True, model_tolerance=True,
            start=(Controller(11.8, 33.0), Controller(40.6, 66.0)),
            as_found=(Controller(9.0, 30.0), Controller(30.0, 60.0)),
        )
    )  # fmt: skip


def test_sum_and_difference_reach_what_mode_control_reaches(modes: Tuning) -> None:
    """In the coordinates of the outputs, where sigma_max is the same: tau_P = 13.757, proven."""
    assert modes.status is Status.LOCAL
    assert modes.tau_p == pytest.approx(13.757, abs=1e-3)
    assert modes.guarantee is not None
    assert modes.guarantee.status == "proven"
    # M_u M_y is 2 I: a mode has twice the gain of its loop.
    total, rest = modes.loops
    controller = ModeController(
        *(as_system(replace(loop, gain=2 * loop.gain)) for loop in (total, rest))
    )
    demand = Performance(tau_p=modes.tau_p)
    judged = analyse_centralised(SEED, UNCERTAIN, demand, controller)
    assert judged.peaks is not None
    assert judged.peaks.robust_performance.value == pytest.approx(1, abs=1e-5)


def test_a_result_of_shared_inputs_carries_what_any_result_does(modes: Tuning) -> None:
    """Proof for a second program, tolerances of the plant and the settings, settings as found."""
    assert modes.certificate is not None
    document = json.dumps(modes.certificate.to_document())
    assert verify(document).verdict == "proven"
    assert {each.parameter for each in modes.model_tolerance} == {
        "gain", "time_constant", "interaction",
    }  # fmt: skip
    assert modes.settings_tolerance is not None
    assert modes.as_found is not None
    assert modes.as_found.tau_p == pytest.approx(18.03, rel=1e-3)
    assert modes.integrity is not None


def test_a_proof_for_other_combinations_is_refused(modes: Tuning) -> None:
    """The same scales prove nothing of loops that move the valves otherwise."""
    assert modes.certificate is not None
    claim = modes.certificate.claim
    assert isinstance(claim.plant, MixedPlant)
    other = replace(claim.plant, inputs=((1.0, 1.0), (1.0, -0.5)))
    forged = replace(modes.certificate, claim=replace(claim, plant=other))
    assert verify(json.dumps(forged.to_document())).verdict != "proven"


def test_the_spread_is_that_of_the_plant_itself() -> None:
    """An interaction 1 % larger is that of the units, whatever combinations the loops see."""
    spread = Spread(interaction=0.01)
    seen = spread.plant_at(mixed(SEED, BOTH), (1.0,))
    assert seen == mixed(first_order(2, 1.0, 100.0, 0.949 * 1.01), BOTH)


def test_a_spread_of_combined_outputs_is_proven_on_the_plant_itself() -> None:
    """All interactions within 1 %: above the peaks at the ends of the box, on both of them."""
    loops = (Controller(12.0, 33.0), Controller(40.0, 66.0))
    seen = mixed(SEED, Mixing(outputs=SUM))
    demand = Performance(tau_p=100.0)
    ends = [
        proven_peaks(change, UNCERTAIN, demand, loops).peaks.robust_performance.value
        for change in (Spread(interaction=0.01).plant_at(seen, (share,)) for share in (-1, 1))
    ]
    box = [Parameter("interaction", 0.01, None)]
    above, below = (
        proven_box(seen, UNCERTAIN, demand, loops, box, levels=(factor * max(ends),))
        for factor in (1.001, 0.999)
    )
    assert above.proven
    assert not below.proven
    assert below.exceeded


def test_scenarios_and_a_resolution_serve_loops_that_share_inputs() -> None:
    """Each plant with the same combinations, one loop in manual; settings of two digits."""
    found = tune(
        task(
            mixing=BOTH, arrangement="identical", resolution=Resolution(digits=2),
            scenarios=(
                Scenario("weak", plant=first_order(2, 0.8, 120.0, 0.93)),
                Scenario("total alone", in_service=(0,)),
            ),
        )
    )  # fmt: skip
    assert [each.name for each in found.scenarios] == ["as given", "weak", "total alone"]
    assert all(each.guarantee.status == "proven" for each in found.scenarios)
    for loop in found.loops:
        assert loop.gain == float(f"{loop.gain:.1e}")
    assert found.resolution is not None
    exact, typed = found.resolution.tau_p_exact, found.resolution.tau_p_rounded
    assert exact is not None
    assert typed is not None
    assert exact <= typed < 1.1 * exact


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_of_shared_inputs_change_nothing(unit: float, modes: Tuning) -> None:
    """Valves counted otherwise, one as the other or not: the peaks of mu are the same."""
    D = np.diag([unit, 1.0])
    own = MatrixPlant(
        [[change_gain(SEED.element(r, 0), 1 / unit), SEED.element(r, 1)] for r in range(2)]
    )
    other = Mixing(SUM, (D @ np.array(SUM)).tolist())
    demand = Performance(tau_p=14.0)
    found, plain = (
        proven_peaks(mixed(plant, mixing), UNCERTAIN, demand, modes.loops)
        for plant, mixing in ((own, other), (SEED, BOTH))
    )
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        value = getattr(found.peaks, name).value
        assert value == pytest.approx(getattr(plain.peaks, name).value, rel=1e-6)
    assert found.proven == (True, True, True)
    assert plain.proven == (True, True, True)


def test_shared_inputs_may_err_together() -> None:
    """A full block, one scale for all inputs: at least as bad as errors one by one, and proven."""
    loops = (Controller(11.8, 33.0), Controller(40.6, 66.0))
    demand = Performance(tau_p=20.0)
    together, apart = (
        proven_peaks(mixed(SEED, BOTH), Uncertainty.from_error(0.2, 1.0, structure), demand, loops)
        for structure in ("full", "diagonal")
    )
    assert together.guarantee.status == "proven"
    worse, better = (each.peaks.robust_performance.value for each in (together, apart))
    assert worse >= better * (1 - 1e-9)


def test_a_worst_case_is_one_of_the_valves(modes: Tuning) -> None:
    """Its errors, one an input, take sigma_max(w_P S) to the peak of mu."""
    seen = mixed(SEED, BOTH)
    demand = Performance(tau_p=modes.tau_p)
    found = analyse(seen, UNCERTAIN, demand, modes.loops, model_tolerance=False)
    worst = found.worst_case
    assert worst is not None
    assert worst.gap < 1e-5
    assert isinstance(worst.uncertainty, DiagonalPerturbation)
    at = np.array([worst.omega])
    valves = [each.response(at)[0] for each in worst.uncertainty.actuators if each is not None]
    c = np.diag([loop.response(at)[0] for loop in modes.loops])
    G = np.array(SUM) @ SEED.response(at)[0]
    S = np.linalg.inv(np.eye(2) + G @ np.diag(valves) @ np.array(SUM) @ c)
    reached = np.linalg.norm(demand.weight.response(at)[0] * S, 2)
    assert reached == pytest.approx(worst.mu, rel=1e-6)


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
        ({"mixing": Mixing(inputs=SUM), "plant": first_order(12, 1.0, 10.0, 0.1)},
         "/mixing/inputs"),
        ({"mixing": Mixing(inputs=SUM), "optimality_gap": True}, "/search/optimality_gap"),
        ({"mixing": Mixing(inputs=SUM),
          "plant": MeasuredPlant(OMEGA, SEED.response(OMEGA), unstable_poles=0)}, "/mixing/inputs"),
    ],
)  # fmt: skip
def test_combinations_that_do_not_fit_are_named(options: dict[str, Any], field: str) -> None:
    """Sizes, pairings, proofs that know one input a loop alone, measured responses."""
    with pytest.raises(InvalidInputError) as caught:
        tune(task(**options))
    assert caught.value.field == field


def test_data_combine_too() -> None:
    """Outputs of a measured plant, whatever its dead times."""
    plant = MeasuredPlant(OMEGA, SEED.response(OMEGA), unstable_poles=0)
    mixed = summed_outputs(plant, Mixing(outputs=SUM))
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
