"""Easy and difficult directions: what they cost at steady state."""

import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.simulation.directions import difficult_direction, easy_direction


@pytest.mark.parametrize("n", [2, 3, 5])
@pytest.mark.parametrize("interaction", [0.9, -0.2])
def test_directions_of_parallel_plants_follow_the_sign_of_the_interaction(
    n: int, interaction: float
) -> None:
    """Together is easy for positive interaction, difficult for negative; apart the other way."""
    plant = first_order(n, 2.0, 10.0, interaction)
    easy, difficult = easy_direction(plant), difficult_direction(plant)
    together, apart = (easy, difficult) if interaction > 0 else (difficult, easy)
    np.testing.assert_array_equal(together, np.ones(n))
    assert apart.sum() == pytest.approx(0, abs=1e-12)
    gain = plant.static_gain()
    effort = [
        np.linalg.norm(np.linalg.solve(gain, direction)) / np.linalg.norm(direction)
        for direction in (easy, difficult)
    ]
    assert effort[0] < effort[1]


def test_directions_of_integrating_units_compare_their_slopes() -> None:
    """Where all gains are infinite the ratio of the integrators decides."""
    plant = ParallelPlant(2, TransferFunction([1], [1, 0]), TransferFunction([-0.5], [1, 0]))
    np.testing.assert_array_equal(difficult_direction(plant), [1, 1])


def test_one_unit_has_one_direction() -> None:
    """A single loop moves up."""
    plant = first_order(1, 1.0, 1.0, 0.0)
    assert easy_direction(plant) == difficult_direction(plant) == [1.0]


def test_directions_of_a_matrix_plant_are_singular_vectors() -> None:
    """SLH (1989), eq. 3: the column's easy direction is apart, its difficult one together."""
    den = [75, 1]
    gains = [[0.878, -0.864], [-1.082, 1.096]]
    plant = MatrixPlant([[TransferFunction([gain], den) for gain in row] for row in gains])
    easy, difficult = easy_direction(plant), difficult_direction(plant)
    assert np.prod(np.sign(easy)) == -1
    assert np.prod(np.sign(difficult)) == 1
    assert np.abs(easy).max() == np.abs(difficult).max() == 1
    assert float(easy @ difficult) == pytest.approx(0, abs=1e-12)


def test_an_integrating_matrix_plant_has_none() -> None:
    """Its steady state gain is infinite."""
    plant = MatrixPlant([[TransferFunction([1], [1, 0])]])
    with pytest.raises(InvalidInputError) as caught:
        easy_direction(plant)
    assert caught.value.field == "/plant"
