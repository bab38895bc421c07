"""Closed loops of Astrom and Hagglund, chapter 11, on the plants of Examples 11.3 and 11.4."""

import math

import numpy as np
import pytest

from solver.interaction.analysis import analyse_interaction
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.stability.closed_loop import is_stable, unstable_poles

DEN = [1, 3, 2]
ROSENBROCK = MatrixPlant(
    [
        [TransferFunction([1], [1, 1]), TransferFunction([2], [1, 3])],
        [TransferFunction([1], [1, 1]), TransferFunction([1], [1, 1])],
    ]
)
BENEFICIAL = MatrixPlant(
    [
        [TransferFunction([1, -1], DEN), TransferFunction([1, 0], DEN)],
        [TransferFunction([-6], DEN), TransferFunction([1, -2], DEN)],
    ]
)


def test_example_11_3_gains_may_rise_by_less_than_three() -> None:
    """k = k_i = 2 in both loops: the book says unstable at 3 times; the limit is 1 + sqrt(13)/2."""
    limit = 1 + math.sqrt(13) / 2
    assert limit == pytest.approx(2.803, abs=5e-4)
    for factor, stable in ((1.0, True), (limit - 1e-6, True), (limit + 1e-6, False), (3.0, False)):
        assert is_stable(ROSENBROCK, [Controller(2 * factor, 1.0)] * 2) is stable


def test_example_11_3_one_loop_may_be_as_fast_as_you_like() -> None:
    """With the other loop open there is no limit."""
    for element in (ROSENBROCK.element(0, 0), ROSENBROCK.element(1, 1)):
        assert is_stable(MatrixPlant([[element]]), [Controller(1e4, 1.0)])


def test_example_11_4_lives_by_its_interaction() -> None:
    """k = 100, k_i = 2000: stable together, unstable when one of the loops is broken."""
    loop = Controller(100, 0.05)
    assert is_stable(BENEFICIAL, [loop, loop])
    for element in (BENEFICIAL.element(0, 0), BENEFICIAL.element(1, 1)):
        assert unstable_poles(MatrixPlant([[element]]), [loop]) == 1


def test_example_11_4_misprint() -> None:
    """Printed in one edition with -6 undivided: that plant has another gain, and zeros."""
    misprinted = MatrixPlant(
        [
            [BENEFICIAL.element(0, 0), BENEFICIAL.element(0, 1)],
            [TransferFunction([-6], [1]), BENEFICIAL.element(1, 1)],
        ]
    )
    zeros = analyse_interaction(misprinted).zeros.zeros
    assert len(zeros) > 0
    assert analyse_interaction(BENEFICIAL).zeros.zeros == ()
    np.testing.assert_allclose(BENEFICIAL.static_gain(), [[-0.5, 0], [-3, -1]])
