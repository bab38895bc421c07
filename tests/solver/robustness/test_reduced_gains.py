"""Stability for all factors on the gains."""

import itertools

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.robustness.reduced_gains import LEAST, reduced_gains
from solver.stability.closed_loop import is_stable

DEN = [1, 3, 2]
BENEFICIAL = MatrixPlant(
    [
        [TransferFunction([1, -1], DEN), TransferFunction([1, 0], DEN)],
        [TransferFunction([-6], DEN), TransferFunction([1, -2], DEN)],
    ]
)


def scaled(loops: list[Controller], factors: tuple[float, ...]) -> list[Controller]:
    """Return the loops with their gains times the factors."""
    return [
        Controller(loop.gain * factor, loop.integral_time)
        for loop, factor in zip(loops, factors, strict=True)
    ]


@pytest.mark.parametrize(
    ("plant", "loops"),
    [
        (first_order(2, 1, 100, 0.949), [Controller(46.3, 101), Controller(22.8, 3.15)]),
        (first_order(3, 1, 100, -0.4, dead_time=1), [Controller(5, 60)] * 3),
    ],
)
def test_what_is_proven_is_found_stable(plant: Plant, loops: list[Controller]) -> None:
    """Settings of Skogestad, Lundstrom and Hovd: any gains reduced, as the abstract has it."""
    found = reduced_gains(plant, loops)
    assert found is not None
    assert found.proven
    rng = np.random.default_rng(1)
    for factors in np.exp(rng.uniform(np.log(LEAST), 0, (25, plant.n))):
        assert is_stable(plant, scaled(loops, tuple(factors)))


def test_loops_that_live_by_each_other_are_not_proven() -> None:
    """Example 11.4 of Astrom and Hagglund: unstable when one gain is reduced enough."""
    loops = [Controller(100, 0.05)] * 2
    found = reduced_gains(BENEFICIAL, loops)
    assert found is not None
    assert not found.proven
    assert not is_stable(BENEFICIAL, scaled(loops, (1.0, 1e-3)))


def test_an_instability_between_the_points_of_a_grid_is_not_missed() -> None:
    """A loop that is conditionally stable: stable at 0 and 1, unstable at factors between."""
    process = TransferFunction([1], np.polymul([1, 0.2, 1], [0.2, 1]).tolist())
    fast = TransferFunction([0.9], [0.05, 1])
    plant = MatrixPlant([[process, fast], [fast, TransferFunction([1], [0.05, 1])]])
    missed = []
    for gain, time in itertools.product((0.2, 1.0, 5.0), (0.3, 1.0, 4.0)):
        loops = [Controller(gain, time), Controller(3.0, 1.0)]
        found = reduced_gains(plant, loops)
        assert found is not None
        factors = itertools.product(np.geomspace(LEAST, 1, 12), repeat=2)
        stable = [is_stable(plant, scaled(loops, each)) for each in factors]
        missed.append(found.proven and not all(stable))
    assert not any(missed)


def test_many_loops_and_loops_without_integral_action_are_left_out() -> None:
    """Nothing is said of them."""
    assert reduced_gains(first_order(6, 1, 10, 0.1), [Controller(1, 10)] * 6) is None
    assert reduced_gains(first_order(2, 1, 10, 0.1), [Controller(1, None)] * 2) is None
