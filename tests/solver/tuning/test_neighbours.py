"""Units in a ring or a row: the modes of a ring are the matrix of all its units."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from service.cli.commands import app
from service.schemas import parse_tuning_request
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.neighbours import NeighbourPlant
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.axis import proven_peaks
from solver.robustness.box_proof import proven_box
from solver.robustness.curves import LoopAnalysis
from solver.robustness.margins import loop_margins
from solver.stability.closed_loop import closed_loop_poles
from solver.stability.singular import lost_directions
from solver.tuning.demand_checks import outcomes
from solver.tuning.demands import Demands
from solver.tuning.scenarios import Scenario
from solver.tuning.specification import Specification
from solver.tuning.spread import Spread
from solver.tuning.tuner import tune

OMEGA = np.geomspace(1e-5, 1e3, 30)
PROCESS = TransferFunction((1.0,), (50.0, 1.0), 1.0)
NEAR = TransferFunction((0.3,), (50.0, 1.0), 1.0)
FAR = TransferFunction((0.1,), (50.0, 1.0), 1.0)
UNCERTAIN = Uncertainty.from_error(epsilon=0.2, theta=1.0)


def drawn(seed: int) -> tuple[NeighbourPlant, list[Controller], Uncertainty, Performance]:
    """Return a ring, loops and errors that repeat around it, all drawn."""
    random = np.random.default_rng(seed)
    places, count = int(random.integers(1, 4)), int(random.integers(2, 5))
    n = places * count

    def element(size: float) -> TransferFunction:
        gain = size * random.uniform(0.3, 1) * random.choice([-1, 1])
        return TransferFunction((gain,), (10 ** random.uniform(0, 2), 1.0), random.uniform(0, 3))

    reach = int(random.integers(0, max((n - 1) // 2, 0) + 1))
    ahead = tuple(element(0.4) for _ in range(reach))
    behind = None if random.random() < 0.5 else ahead[: reach // 2]
    process = TransferFunction((1.0,), (10 ** random.uniform(0.5, 2), 1.0), random.uniform(0, 2))
    own = [Controller(10 ** random.uniform(-1, 1), 10 ** random.uniform(0.5, 2))
           for _ in range(places)]  # fmt: skip
    scales = tuple(random.uniform(0.5, 2, places).tolist()) * count
    weights = [Uncertainty.from_error(epsilon=e, theta=1.0).weight
               for e in random.uniform(0.1, 0.3, places)]  # fmt: skip
    uncertainty = Uncertainty(tuple(weights) * count)  # type: ignore[arg-type]  # single ones
    performance = Performance(tau_p=20.0, output_scale=scales)
    return NeighbourPlant(n, process, ahead, behind), own * count, uncertainty, performance


@pytest.mark.parametrize("seed", range(30))
def test_modes_have_the_mu_of_the_matrix(seed: int) -> None:
    """All three curves and the count of unstable poles, for drawn rings, groups and errors."""
    ring, loops, uncertainty, performance = drawn(seed)
    if ring.n > 10:
        ring = NeighbourPlant(ring.n // 2 * 2 if ring.n // 2 * 2 <= 10 else 9, ring.process,
                              ring.ahead[:1], None)  # fmt: skip
        loops, uncertainty = [loops[0]] * ring.n, UNCERTAIN
        performance = Performance(tau_p=20.0)
    matrix = MatrixPlant(ring.rows)
    found = []
    for plant in (ring, matrix):
        blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
        curves = LoopAnalysis(blocks, controllers, uncertainty, performance).curves(OMEGA)
        found.append(curves)
        assert (len(blocks.blocks) > 1) == (plant is ring)
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        mine, its = (getattr(each, name) for each in found)
        assert mine == pytest.approx(its, rel=1e-6)  # the matrix has n scales to find
    assert closed_loop_poles(ring, loops) == closed_loop_poles(matrix, loops)


@pytest.mark.parametrize("n", [4, 5, 6])
def test_tuning_by_modes_is_that_of_the_matrix(n: int) -> None:
    """The same settings and time constant, to the digits of the descent."""
    ring = NeighbourPlant(n, PROCESS, (NEAR,))
    found = [
        tune(Specification(plant, UNCERTAIN, Performance(), arrangement="identical"))  # type: ignore[arg-type]
        for plant in (ring, MatrixPlant(ring.rows))
    ]
    assert found[0].tau_p == pytest.approx(found[1].tau_p, rel=1e-6)
    assert found[0].loops[0].gain == pytest.approx(found[1].loops[0].gain, rel=1e-3)


def test_a_hundred_units_are_tuned_and_proven() -> None:
    """The published numbers of the page, a proven guarantee, and no certificate."""
    ring = NeighbourPlant(100, PROCESS, (NEAR, FAR))
    task = Specification(ring, UNCERTAIN, Performance(), arrangement="identical", certificate=True)  # type: ignore[arg-type]
    found = tune(task)
    assert found.tau_p == pytest.approx(6.50143, rel=1e-4)
    assert found.guarantee is not None
    assert found.guarantee.status == "proven"
    assert found.guarantee.level == pytest.approx(1.0001, abs=2e-6)
    assert found.certificate is None
    assert any("no certificate" in text for text in found.warnings)
    judged = analyse(ring, UNCERTAIN, Performance(tau_p=found.tau_p), found.loops)
    assert judged.peaks is not None
    assert judged.peaks.robust_performance.value == pytest.approx(1, abs=1e-6)
    assert judged.lower_bound is None


@pytest.mark.parametrize("n", [12, 20])
def test_one_scale_for_a_row_costs_next_to_nothing(n: int) -> None:
    """The sines' bound is above that of the matrix with its n scales, by less than 1e-3."""
    row = NeighbourPlant(n, PROCESS, (NEAR,), None, ring=False)
    loops, demand = [Controller(9.0, 37.0)] * n, Performance(tau_p=8.0)
    split, controllers = group_loops(row, loops, UNCERTAIN)
    assert [block.size for block in split.blocks] == [1] * n
    # A neighbour two places off on one side, that does nothing, leaves the matrix whole.
    nothing = TransferFunction((0.0,), (1.0,))
    whole, _ = group_loops(
        NeighbourPlant(n, PROCESS, (NEAR,), (NEAR, nothing), ring=False), loops, UNCERTAIN
    )
    assert [block.size for block in whole.blocks] == [n]
    omega = np.geomspace(1e-3, 10, 25)
    bound, best = (
        LoopAnalysis(blocks, controllers, UNCERTAIN, demand).robust_performance(omega)
        for blocks in (split, whole)
    )
    assert (bound >= best * (1 - 1e-7)).all()
    assert (bound <= best * (1 + 1e-3)).all()
    assert bound.max() == pytest.approx(best.max(), rel=2e-5)
    assert closed_loop_poles(row, loops).stable


def test_a_long_row_is_proven() -> None:
    """Its peak is within one part in ten thousand, and unstable loops are no matter of proof."""
    row = NeighbourPlant(40, PROCESS, (NEAR,), None, ring=False)
    judged = analyse(row, UNCERTAIN, Performance(tau_p=8.1), [Controller(8.967, 37.46)] * 40)
    assert judged.guarantee is not None
    assert judged.guarantee.status == "proven"
    assert judged.peaks is not None
    assert judged.peaks.robust_performance.value == pytest.approx(0.9996, abs=1e-3)
    assert not analyse(
        row, UNCERTAIN, Performance(tau_p=8.1), [Controller(90.0, 37.46)] * 40
    ).nominally_stable


def test_a_profile_of_neighbours_splits_a_row() -> None:
    """Neighbours that differ by factors: the bound of one scale is the matrix's, to 1e-4."""
    opposite = TransferFunction((-0.1,), (100.0, 2.0), 1.0)
    row = NeighbourPlant(12, PROCESS, (NEAR, FAR, opposite), ring=False)
    assert row.profile == pytest.approx((1, 1 / 3, -1 / 6))
    later = TransferFunction((-0.1,), (100.0, 2.0), 1.0 + 1e-12)
    whole = NeighbourPlant(12, PROCESS, row.ahead, (NEAR, FAR, later), ring=False)
    assert whole.profile is None
    loops, demand = [Controller(7.0, 37.0)] * 12, Performance(tau_p=9.0)
    omega = np.geomspace(1e-3, 10, 25)
    bound, best = (
        LoopAnalysis(*group_loops(each, loops, UNCERTAIN), UNCERTAIN, demand)
        .robust_performance(omega)
        for each in (row, whole)
    )  # fmt: skip
    assert (bound >= best * (1 - 1e-7)).all()
    assert (bound <= best * (1 + 2e-4)).all()
    long = analyse(
        NeighbourPlant(60, PROCESS, row.ahead, ring=False), UNCERTAIN, demand, [loops[0]] * 60
    )
    assert long.guarantee is not None
    assert long.guarantee.status == "proven"


def test_long_rows_have_neighbours_of_one_response() -> None:
    """Others do not split: refused by name, as are settings that differ."""
    slow = TransferFunction((0.1,), (60.0, 1.0), 1.0)
    for more, field in (({"ahead": (NEAR, slow)}, "/ahead"), ({"behind": (FAR,)}, "/behind")):
        with pytest.raises(InvalidInputError, match="the same neighbours") as caught:
            NeighbourPlant(30, PROCESS, **{"ahead": (NEAR,), **more}, ring=False)
        assert caught.value.field == field
    row = NeighbourPlant(30, PROCESS, (NEAR,), None, ring=False)
    unlike = [Controller(1.0, 50.0)] * 29 + [Controller(2.0, 50.0)]
    with pytest.raises(InvalidInputError, match="the same for all"):
        analyse(row, UNCERTAIN, Performance(tau_p=20.0), unlike)


def test_parts_of_many_units() -> None:
    """Neighbours in a row are a row, few units a matrix, others refused where asked for."""
    row = NeighbourPlant(30, PROCESS, (NEAR,), None, ring=False)
    assert row.part(range(5, 25)) == NeighbourPlant(20, PROCESS, (NEAR,), None, ring=False)
    assert isinstance(row.part([0, 7, 9]), MatrixPlant)
    one_out = [*range(10), *range(11, 30)]
    options = {"arrangement": "identical", "starts": 2}
    scenario = Scenario("one out", in_service=tuple(one_out))
    with pytest.raises(InvalidInputError, match="those of neighbours") as caught:
        tune(Specification(row, UNCERTAIN, Performance(), scenarios=[scenario], **options))  # type: ignore[arg-type]
    assert caught.value.field == "/scenarios/0/in_service"
    demands = Demands(integrity="stable")  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="may not change places") as caught:
        tune(Specification(row, UNCERTAIN, Performance(), demands=demands, **options))  # type: ignore[arg-type]
    assert caught.value.field == "/demands/integrity"


def test_loops_of_many_units_alone_are_known() -> None:
    """The demand on each alone is that of one unit by itself."""
    row = NeighbourPlant(30, PROCESS, (NEAR,), None, ring=False)
    loops = [Controller(9.0, 37.0)] * 30
    demands = Demands(max_sensitivity_alone=1.5)
    (found,) = outcomes(demands, [row], loops)
    (alone,) = loop_margins(MatrixPlant([[PROCESS]]), loops[:1])
    assert alone.alone is not None
    assert found.value == pytest.approx(alone.alone.sensitivity.value, rel=1e-9)


def test_a_ring_whose_parameters_spread_is_proven() -> None:
    """Draws from the box stay below the level that is told."""
    ring = NeighbourPlant(12, PROCESS, (NEAR,))
    spread = Spread(gain=0.1, interaction=0.1)
    loops, demand = [Controller(7.9, 34.1)] * 12, Performance(tau_p=11.5)
    proof = proven_box(ring, UNCERTAIN, demand, loops, spread.axes(ring), levels=(1.001,))
    assert proof.proven
    for share in ((-1.0, -1.0), (1.0, 1.0), (-0.3, 0.8)):
        axis = proven_peaks(spread.plant_at(ring, share), UNCERTAIN, demand, loops)
        assert axis.peaks.robust_performance.value <= 1.001


def test_settings_that_do_not_repeat_are_for_short_rings() -> None:
    """Two halves of a hundred units, or dependent errors, would be a hundred D-scales at once."""
    ring = NeighbourPlant(100, PROCESS, (NEAR,))
    halves = (tuple(range(50)), tuple(range(50, 100)))
    task = Specification(ring, UNCERTAIN, Performance(), arrangement="grouped", groups=halves)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="repeat") as caught:
        tune(task)
    assert caught.value.field == "/controller/groups"
    unlike = [Controller(1.0, 50.0)] * 99 + [Controller(2.0, 50.0)]
    with pytest.raises(InvalidInputError, match="repeat"):
        analyse(ring, UNCERTAIN, Performance(tau_p=20.0), unlike)


def test_a_lost_mode_is_counted() -> None:
    """Two neighbours of half the gain leave the alternating mode of an even ring nothing."""
    half = TransferFunction((0.5,), (50.0, 1.0), 1.0)
    ring = NeighbourPlant(12, PROCESS, (half,))
    blocks, _ = group_loops(ring, [Controller(1.0, 50.0)] * 12)
    assert lost_directions(blocks) == [0, 0, 0, 0, 0, 0, 1]
    assert closed_loop_poles(ring, [Controller(1.0, 50.0)] * 12).at_origin == 1


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_change_nothing(unit: float) -> None:
    """Time in another unit: the same gain, times in that unit."""
    plain = NeighbourPlant(24, PROCESS, (NEAR,))
    scaled = plain.mapped(
        lambda e: TransferFunction(e.num, (e.den[0] * unit, e.den[1]), e.dead_time * unit)
    )
    weights = (UNCERTAIN, Uncertainty.from_error(epsilon=0.2, theta=unit))
    found = [
        tune(Specification(plant, weight, Performance(), arrangement="identical", starts=3))  # type: ignore[arg-type]
        for plant, weight in zip((plain, scaled), weights, strict=True)
    ]
    assert found[1].tau_p == pytest.approx(unit * (found[0].tau_p or 0), rel=1e-5)


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"n": 1}, "/n"),
        ({"n": 101}, "/n"),
        ({"n": 101, "ring": False}, "/n"),
        ({"n": 4, "ahead": (NEAR, FAR)}, "/ahead"),
        ({"n": 3, "ahead": (NEAR,) * 3, "ring": False}, "/ahead"),
        ({"process": TransferFunction((0.0,), (1.0,))}, "/process/num"),
        ({"ahead": (NEAR, 3.0)}, "/ahead/1"),
    ],
)
def test_rings_that_are_none_are_refused(given: dict[str, Any], field: str) -> None:
    """Too few and too many units, neighbours that are one unit, no process."""
    with pytest.raises(InvalidInputError) as caught:
        NeighbourPlant(**{"n": 12, "process": PROCESS, "ahead": (NEAR,), **given})
    assert caught.value.field == field


def test_the_command_takes_rings_and_rows(tmp_path: Any) -> None:
    """Many units with a report and step responses, few as a matrix with proof."""
    lag = {"num": [1.0], "den": [50.0, 1.0]}
    body: dict[str, Any] = {
        "plant": {"kind": "circulant", "n": 12, "process": lag, "ahead": [{**lag, "num": [0.3]}]},
        "uncertainty": {"epsilon": 0.2, "theta": 1.0},
        "controller": {"arrangement": "identical"}, "search": {"starts": 1},
        "certificate": "none", "model_tolerance": False,
    }  # fmt: skip
    path, report = tmp_path / "ring.json", tmp_path / "ring.html"
    path.write_text(json.dumps(body), "utf-8")
    done = CliRunner().invoke(app, ["tune", str(path), "--json", "--report", str(report)])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert len(result["loops"]) == 12
    assert result["guarantee"]["status"] == "proven"
    assert "equal units in a ring" in report.read_text("utf-8")
    steps = {"plant": body["plant"], "loops": result["loops"], "duration": 10.0,
             "steps": [{"kind": "setpoint", "unit": 0}]}  # fmt: skip
    path.write_text(json.dumps(steps), "utf-8")
    moved = CliRunner().invoke(app, ["step-response", str(path), "--json"])
    assert moved.exit_code == 0, moved.output
    responses = json.loads(moved.stdout)["responses"]
    assert responses[1]["output"] == pytest.approx(responses[11]["output"], abs=1e-8)  # mirrored
    path.write_text(json.dumps({"plant": body["plant"]}), "utf-8")
    refused = CliRunner().invoke(app, ["interaction", str(path)])
    assert refused.exit_code == 2
    assert "/plant/n" in refused.output
    few = {**body, "plant": {**body["plant"], "kind": "banded", "n": 3}}
    task = parse_tuning_request(json.dumps(few)).build()
    assert isinstance(task.plant, MatrixPlant)
    assert task.plant.element(0, 2).is_zero
    assert tune(task).guarantee.status == "proven"  # type: ignore[union-attr]


def test_settings_of_today_are_judged_in_a_long_row_and_ring() -> None:
    """Of more units than a matrix has they have a tau_P, and no margins."""
    today = (Controller(5.0, 30.0),) * 12
    for ring in (False, True):
        plant = NeighbourPlant(12, PROCESS, (NEAR,), ring=ring)
        found = tune(
            Specification(
                plant, UNCERTAIN, Performance(), arrangement="identical", starts=1,  # type: ignore[arg-type]
                as_found=today,
            )
        ).as_found  # fmt: skip
        assert found is not None
        assert found.nominally_stable
        assert found.tau_p is not None
        assert found.margins == ()
