"""Zeros that exist by rounding only are named; zeros that are there are not."""

from __future__ import annotations

import numpy as np
import pytest

from solver.interaction.analysis import analyse_interaction
from solver.interaction.zeros import transmission_zeros
from solver.model.plants import MatrixPlant, ParallelPlant
from solver.model.transfer_function import TransferFunction

# Johansson's quadruple tank (IEEE Trans. Control Systems Technology 8, 2000), minimum phase, with
# time constants of 62.7, 90.3, 23 and 30; the products are typed in five digits.
TANKS = MatrixPlant(
    [
        [TransferFunction([2.6], [62.7, 1]), TransferFunction([1.5], [1498.5, 86.6, 1])],
        [TransferFunction([1.4], [2709, 120.3, 1]), TransferFunction([2.8], [90.3, 1])],
    ]
)


def test_quadruple_tank_has_two_zeros() -> None:
    """The four-state model has zeros at -0.058 and -0.017; the third one is named."""
    zeros = transmission_zeros(TANKS).zeros
    real = [zero.value for zero in zeros if not zero.near_cancellation]
    np.testing.assert_allclose(sorted(real, key=abs), [-0.0171, -0.0581], rtol=2e-2)
    doubtful = [zero.value for zero in zeros if zero.near_cancellation]
    np.testing.assert_allclose(doubtful, [-1 / 62.7], rtol=1e-3)
    assert any("by rounding only" in warning for warning in analyse_interaction(TANKS).warnings)


def test_an_elements_own_zero_beside_its_pole_is_called_no_pole_of_another() -> None:
    """(0.386 s + 0.266)/(1.45 s + 1) cancels but for 0.1 %: the words hold for that too."""
    plant = MatrixPlant(
        [
            [TransferFunction([-0.319], [1747, 83.6, 1]), TransferFunction([-0.334], [27.6, 1])],
            [
                TransferFunction([-13.7, 1.02], [7.49, 1]),
                TransferFunction([-0.386, -0.266], [1.45, 1]),
            ],
        ]
    )
    (told,) = (text for text in analyse_interaction(plant).warnings if "by rounding" in text)
    assert "(-0.69) may exist" in told
    assert "different elements" not in told


@pytest.mark.parametrize("digits", [4, 5, 6, 12])
def test_rounded_products_bring_no_zeros(digits: int) -> None:
    """Whether four digits of a shared pole are typed or twelve, the plant keeps its two zeros."""

    def rounded(values: np.ndarray) -> list[float]:
        return [float(f"{value:.{digits - 1}e}") for value in values]

    slow, fast = np.array([61.37, 1]), np.array([22.91, 1])
    other, last = np.array([93.11, 1]), np.array([31.7, 1])
    plant = MatrixPlant(
        [
            [
                TransferFunction([2.6], rounded(slow)),
                TransferFunction([1.5], rounded(np.polymul(slow, fast))),
            ],
            [
                TransferFunction([1.4], rounded(np.polymul(other, last))),
                TransferFunction([2.8], rounded(other)),
            ],
        ]
    )
    zeros = transmission_zeros(plant).zeros
    assert sum(zero.multiplicity for zero in zeros if not zero.near_cancellation) == 2


def test_zero_beside_a_pole_of_another_direction_stays() -> None:
    """diag(1/(s + 1), (s + 1.005)/(s + 5)): nothing cancels, nothing is named."""
    nothing = TransferFunction([0], [1])
    plant = MatrixPlant(
        [
            [TransferFunction([1], [1, 1]), nothing],
            [nothing, TransferFunction([1, 1.005], [1, 5])],
        ]
    )
    (zero,) = transmission_zeros(plant).zeros
    assert zero.value == pytest.approx(-1.005)
    assert not zero.near_cancellation


@pytest.mark.parametrize(("zero", "named"), [(1.001, True), (1.2, False), (-1.001, False)])
def test_single_loop(zero: float, named: bool) -> None:
    """(s + z)/((s + 1)(s + 2)) with z near 1; one in the right half plane never is rounding."""
    plant = MatrixPlant([[TransferFunction([1, zero], np.polymul([1, 1], [1, 2]).tolist())]])
    (found,) = transmission_zeros(plant).zeros
    assert found.near_cancellation is named


def test_parallel_units() -> None:
    """g and i with one pole in two roundings: the modes' zero between them is named."""
    plant = ParallelPlant(3, TransferFunction([1], [62.7, 1]), TransferFunction([0.3], [62.71, 1]))
    zeros = transmission_zeros(plant).zeros
    assert len(zeros) == 2
    assert all(zero.near_cancellation for zero in zeros)


def test_lightly_damped_dipole_is_no_rounding() -> None:
    """A pole and a zero a per cent apart on the imaginary axis matter: damping counts."""
    num, den = [1, 0.002, 1.02], np.polymul([1, 0.002, 1], [1, 1]).tolist()
    zeros = transmission_zeros(MatrixPlant([[TransferFunction(num, den)]])).zeros
    assert not any(zero.near_cancellation for zero in zeros)
