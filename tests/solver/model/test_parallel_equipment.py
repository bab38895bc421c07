"""Exchangers, compressors, burner passes: balances solved at a frequency, and the limits of a."""

import doctest

import numpy as np
import pytest

import solver.model.parallel_equipment as module
from solver.model.errors import InvalidInputError
from solver.model.parallel_equipment import BurnerPasses, ParallelCompressors, ParallelExchangers

EXCHANGERS = ParallelExchangers(3, 800, 20, 2, 4, 10, 60, 0.5, 2, 0.5, 7, 0.5, 0.3)
COMPRESSORS = ParallelCompressors(4, 3.0, 2.0, 1.0, 2.5, 6.0, 0.4, 0.2)
PASSES = BurnerPasses(3, 800, 20, 1000, 0.4, 30.0, 2.0, 5.0)
S = 0.3j


def test_doctests() -> None:
    """The examples in the docstrings run."""
    assert doctest.testmod(module).failed == 0


def test_exchangers_satisfy_their_balances() -> None:
    """Header, valves and heat balances, each as its docstring has it, by finite differences."""
    m = EXCHANGERS
    heat = lambda q, t: q * 4 * (60 - t) * (1 - np.exp(-10 / (q * 4)))  # noqa: E731 - a formula
    h = 1e-5
    by_flow = (heat(2 + h, 0) - heat(2 - h, 0)) / (2 * h)
    by_temperature = (heat(2, h) - heat(2, -h)) / (2 * h)
    # Unknown: flows and header pressure, for a unit move of the first valve.
    A = np.zeros((4, 4), dtype=complex)
    A[:3, :3] = np.eye(3)
    A[:3, 3] = -2 / (2 * 2)
    A[3, :3] = 0.5
    A[3, 3] = 7 * S + 1
    lagged = np.exp(-0.3 * S) / (0.5 * S + 1)
    flows = lagged * np.linalg.solve(A, np.array([2 / 0.5, 0, 0, 0]))[:3]
    temperatures = by_flow * flows / (800 * S + 20 - by_temperature)
    assert m.plant().response([0.3])[0][:, 0] == pytest.approx(temperatures, rel=1e-6)


def test_compressors_satisfy_their_balances() -> None:
    """Momentum of each compressor and mass of the header."""
    speed = np.exp(-0.2 * S) / (0.4 * S + 1)
    A = np.zeros((5, 5), dtype=complex)
    A[:4, :4] = np.eye(4) * (1.0 * S + 2.0)
    A[:4, 4] = 1.0
    A[4, :4] = -2.5
    A[4, 4] = 6.0 * S + 1
    flows = np.linalg.solve(A, np.array([3.0 * speed, 0, 0, 0, 0]))[:4]
    assert COMPRESSORS.plant().response([0.3])[0][:, 0] == pytest.approx(flows)


def test_passes_satisfy_their_balances() -> None:
    """Heat of each pass."""
    fuel = 1000 * np.exp(-5 * S) / (2 * S + 1)
    shared = 0.4 / 3 / (30 * S + 1)
    heats = fuel * np.array([0.6 + shared, shared, shared])
    expected = heats / (800 * S + 20)
    assert PASSES.plant().response([0.3])[0][:, 0] == pytest.approx(expected)


@pytest.mark.parametrize("n", [2, 3, 8])
def test_interaction_fills_its_limits(n: int) -> None:
    """From one limit to the other, never beyond."""
    families = [
        [ParallelCompressors(n, 1, 1, 0, R) for R in (0, 0.1, 10, 1e9)],
        [ParallelExchangers(n, 1, 1, 1, 1, 1, 1, 1, 1, R) for R in (0, 0.1, 10, 1e9)],
        [BurnerPasses(n, 1, 1, 1, m) for m in (0, 0.3, 0.9, 1 - 1e-9)],
    ]
    for family in families:
        values = []
        for one in family:
            plant = one.plant()
            values.append(plant.interaction.static_gain / plant.process.static_gain)
            low, high = one.interaction_limits
            assert low <= values[-1] <= high
        ends = sorted((values[0], values[-1]))
        assert ends == pytest.approx(sorted(family[0].interaction_limits), abs=1e-6)


@pytest.mark.parametrize(
    ("model", "arguments", "field"),
    [
        (BurnerPasses, (2, 1, 1, 1, 1.0), "/shared"),
        (BurnerPasses, (2, 0, 1, 1, 0.5), "/holdup_heat"),
        (BurnerPasses, (0, 1, 1, 1, 0.5), "/n"),
        (ParallelCompressors, (2, 1, -1, 1, 1), "/head_per_flow"),
        (ParallelCompressors, (2, 1, 1, float("nan"), 1), "/inertia"),
        (ParallelExchangers, (2, 1, 1, 1, 1, 1, 0, 1, 1, 1), "/temperature_difference"),
        (ParallelExchangers, (2, 1, 1, 1, 1, 1e-300, 1, 1, 1, 1), "/exchange"),
    ],
)
def test_bad_data_are_refused(model: type, arguments: tuple[float, ...], field: str) -> None:
    """By the name of the parameter."""
    with pytest.raises(InvalidInputError) as caught:
        model(*arguments).plant()
    assert caught.value.field == field
