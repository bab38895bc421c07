"""Physical models: limits of the sources, balances, and the examples made from them."""

import doctest
import json
from pathlib import Path

import numpy as np
import pytest

import solver.model.physical_models as module
from solver.model.errors import InvalidInputError
from solver.model.physical_models import Blender, CooledReactors, StreamSplit
from solver.model.plants import ParallelPlant

EXAMPLES = Path(__file__).parents[3] / "examples"

SPLIT = StreamSplit(4, 10, 0.5, 2, 0.8, header_time=2, valve_time=0.5, dead_time=0.1)
REACTORS = CooledReactors(
    n=3,
    holdup=5000,
    feed=50,
    heat_capacity=4.0,
    coolant=10.0,
    opening=0.5,
    evaporation_heat=200,
    vapour_heat_capacity=0.9,
    exchanger=100,
    feed_superheat=60,
    coupling=0.01,
)


def _interaction(plant: ParallelPlant) -> float:
    return plant.interaction.static_gain / plant.process.static_gain


def test_doctests() -> None:
    """The examples in the docstrings run."""
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize("n", range(2, 9))
def test_stream_split_limits_are_eq_6(n: int) -> None:
    """SLH eq. 6: a from 0 (stiff header) towards -1/(n-1) (constant total flow)."""
    values = [
        _interaction(StreamSplit(n, 1, 0.5, 1, resistance).plant())
        for resistance in (0.0, 0.1, 1.0, 10.0, 1e6)
    ]
    assert values[0] == 0
    assert all(np.diff(values) < 0)
    assert values[-1] == pytest.approx(-1 / (n - 1), rel=1e-5)
    assert values[-1] > -1 / (n - 1)


def test_stream_split_satisfies_its_balances() -> None:
    """The response solves the valve and header equations at any frequency."""
    s = 0.7j
    plant = SPLIT.plant()
    G = plant.response([0.7])[0]
    valve = np.exp(-0.1 * s) / (0.5 * s + 1)
    alpha_R = 10 / (2 * 2) * 0.8
    # v dq_true = G dx with (I + alpha R/(T s + 1) 11^T) dq_true = beta dx
    true = np.linalg.inv(np.eye(4) + alpha_R / (2 * s + 1) * np.ones((4, 4))) * 20
    np.testing.assert_allclose(G, valve * true, rtol=1e-12)


@pytest.mark.parametrize("n", range(2, 9))
def test_reactor_limits_are_eq_8(n: int) -> None:
    """SLH eq. 8: -1/(n-1) without precooler at constant flow, 1 without evaporation."""

    def reactors(evaporation: float, exchanger: float, coupling: float) -> float:
        model = CooledReactors(n, 5000, 50, 4, 2, 0.5, evaporation, 2, exchanger, 60, coupling)
        return _interaction(model.plant())

    assert reactors(1000, 0, 1e9) == pytest.approx(-1 / (n - 1), rel=1e-6)
    assert reactors(0, 10, 0) == pytest.approx(1)
    assert reactors(1000, 0, 0) == 0
    for exchanger in (0.0, 1.0, 100.0):
        for coupling in (0.0, 0.5, 20.0):
            assert -1 / (n - 1) < reactors(1000, exchanger, coupling) < 1


def test_reactors_satisfy_their_balances() -> None:
    """Static gain against a finite difference of the nonlinear balances."""
    plant = REACTORS.plant()
    assert plant.process.poles == pytest.approx([-50 / 5000])
    n, F, c, dH, cv, UA, dT = 3, 50, 4.0, 200, 0.9, 100, 60

    def temperatures(m: np.ndarray) -> np.ndarray:
        total = m.sum()
        heat = total * cv * dT * (1 - np.exp(-UA / (total * cv)))
        return (F * c * (-heat / (n * F * c)) - m * dH) / (F * c)

    k = REACTORS.coupling
    flows = np.linalg.inv(np.eye(n) + k * np.ones((n, n))) * (10.0 / 0.5)
    h = 1e-6
    for j in range(n):
        step = flows[:, j] * h
        slope = (temperatures(10.0 + step) - temperatures(10.0 - step)) / (2 * h)
        np.testing.assert_allclose(slope, plant.static_gain()[:, j], rtol=1e-6)


def test_blender_gains() -> None:
    """Static gains against a finite difference of the two balances."""
    model = Blender(70, 30, 0.9, 0.2, flow_time=0.1, analyser_time=1, analyser_dead_time=0.5)
    plant = model.plant()

    def outputs(flows: np.ndarray) -> np.ndarray:
        return np.array([flows.sum(), flows @ [0.9, 0.2] / flows.sum()])

    for j in range(2):
        step = np.eye(2)[j] * 1e-4
        base = np.array([70.0, 30.0])
        slope = (outputs(base + step) - outputs(base - step)) / 2e-4
        np.testing.assert_allclose(slope, plant.static_gain()[:, j], rtol=1e-6)
    assert plant.element(1, 0).dead_time == 0.5
    assert len(plant.element(1, 0).den) == 3


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: StreamSplit(2, 0, 1, 1, 1), "/flow"),
        (lambda: StreamSplit(2, 1, 1, 1, -1), "/supply_resistance"),
        (lambda: StreamSplit(2, 1, 1, 1, 1, dead_time=float("nan")), "/dead_time"),
        (lambda: StreamSplit(0, 1, 1, 1, 1).plant(), "/n"),
        (lambda: CooledReactors(2, 1, 1, 1, 1, 1, 0, 1, 0, 1).plant(), "/evaporation_heat"),
        (lambda: CooledReactors(2, 1, 1, 1, -1, 1, 0, 1, 0, 1), "/coolant"),
        (lambda: Blender(1, 1, 0.5, 0.5), "/second_fraction"),
        (lambda: Blender(1, 1, 1.5, 0.5), "/first_fraction"),
        (lambda: Blender(1, float("inf"), 0.1, 0.5), "/second_flow"),
    ],
)
def test_impossible_parameters_name_their_field(build: object, field: str) -> None:
    """Every rule says which value breaks it."""
    assert callable(build)
    with pytest.raises(InvalidInputError) as caught:
        build()
    assert caught.value.field == field


def test_examples_are_what_the_models_give() -> None:
    """The plants in examples/ are those of the functions, digit for digit to 1e-12."""
    split = json.loads((EXAMPLES / "interaction_stream_split.json").read_text())["plant"]
    plant = SPLIT.plant()
    np.testing.assert_allclose(split["process"]["num"], plant.process.num, rtol=1e-12)
    np.testing.assert_allclose(split["process"]["den"], plant.process.den, rtol=1e-12)
    np.testing.assert_allclose(split["interaction"]["num"], plant.interaction.num, rtol=1e-12)
    assert split["n"] == plant.n
    reactors = json.loads((EXAMPLES / "interaction_cooled_reactors.json").read_text())["plant"]
    cooled = REACTORS.plant()
    assert reactors["gain"] == pytest.approx(cooled.process.static_gain, rel=1e-12)
    assert reactors["interaction"] == pytest.approx(_interaction(cooled), rel=1e-12)
    assert reactors["time_constant"] == 100
    blending = json.loads((EXAMPLES / "interaction_blending.json").read_text())["plant"]
    blender = Blender(70, 30, 0.9, 0.2, flow_time=0.1, analyser_time=1, analyser_dead_time=0.5)
    for row, elements in enumerate(blending["elements"]):
        for column, element in enumerate(elements):
            expected = blender.plant().element(row, column)
            np.testing.assert_allclose(element["num"], expected.num, rtol=1e-12)
            np.testing.assert_allclose(element["den"], expected.den, rtol=1e-12)
