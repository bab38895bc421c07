"""The parallel plant nearest to a matrix plant, and a(j omega)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from solver.interaction.analysis import analyse_interaction
from solver.interaction.nearest_parallel import nearest_parallel
from solver.model.plants import MatrixPlant, ParallelPlant
from solver.model.transfer_function import TransferFunction

OMEGA = np.geomspace(1e-4, 1, 9)


def _lag(gain: float, time: float = 75.0) -> TransferFunction:
    return TransferFunction([gain], [time, 1])


def _plant(gain: np.ndarray) -> MatrixPlant:
    return MatrixPlant([[_lag(float(each)) for each in row] for row in gain])


def test_the_column_is_nearly_parallel() -> None:
    """SLH, section 2: the distillation column is "quite close", with a = -0.986."""
    result = analyse_interaction(_plant(np.array([[0.878, -0.864], [1.082, -1.096]])))
    nearest = result.nearest_parallel
    assert nearest is not None
    assert nearest.interaction == pytest.approx(-0.986, abs=5e-4)
    assert nearest.own == pytest.approx(0.987)
    assert nearest.output_signs == (1, -1)
    assert nearest.input_signs == (1, 1)
    # By hand: deviations from the means 0.987 and 0.973 are 0.109 four times.
    norm = np.linalg.norm([0.878, 0.864, 1.082, 1.096])
    assert nearest.distance == pytest.approx(0.109 * 2 / norm, rel=1e-6)
    assert nearest.greatest_distance == pytest.approx(nearest.distance)
    np.testing.assert_allclose(nearest.interactions, nearest.interaction)
    assert any("nearly 2 identical units" in warning for warning in result.warnings)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_parallel_units_with_turned_signs_are_found(n: int) -> None:
    """Signals counted the other way round do not hide identical units; any size of the gain."""
    random = np.random.default_rng(n)
    a = random.uniform(0.2, 0.9)
    parallel = np.full((n, n), a) + (1 - a) * np.eye(n)
    for size in (1e-6, 1.0, 1e6):
        rows, columns = random.choice([-1.0, 1.0], (2, n))
        nearest = nearest_parallel(_plant(size * rows[:, None] * parallel * columns), OMEGA)
        assert nearest is not None
        found = abs(nearest.interaction) if n == 2 else nearest.interaction
        assert found == pytest.approx(a)
        assert nearest.own == pytest.approx(size)
        assert nearest.greatest_distance < 1e-12
        assert nearest.near


def test_no_other_parallel_matrix_is_nearer() -> None:
    """Of all signs and a dense net of elements none comes nearer to random 3 x 3 gains."""
    random = np.random.default_rng(7)
    for _ in range(5):
        gain = random.normal(size=(3, 3)) + 2 * np.diag(random.choice([-1.0, 1.0], 3))
        nearest = nearest_parallel(_plant(gain), OMEGA)
        assert nearest is not None
        for rows in itertools.product([1.0, -1.0], repeat=3):
            columns = np.sign(np.diag(gain)) * np.array(rows)
            turned = np.array(rows)[:, None] * gain * columns
            for own, other in random.uniform(-3, 3, (200, 2)):
                tried = np.full((3, 3), other) + (own - other) * np.eye(3)
                away = np.linalg.norm(turned - tried) / np.linalg.norm(gain)
                assert away >= nearest.distance - 1e-12


def test_units_of_unlike_speed_are_not_near() -> None:
    """Static gains alike do not make units identical: the distance is taken over frequency."""
    plant = MatrixPlant([[_lag(1, 100), _lag(0.5, 100)], [_lag(0.5, 1), _lag(1, 1)]])
    result = analyse_interaction(plant)
    nearest = result.nearest_parallel
    assert nearest is not None
    assert nearest.distance == pytest.approx(0, abs=1e-12)
    assert nearest.greatest_distance > 0.5
    assert not nearest.near
    assert not any("identical units" in warning for warning in result.warnings)


def test_no_nearest_plant_without_own_gains() -> None:
    """A loop without a static gain, an integrator, or identical units: there is nothing to say."""
    assert analyse_interaction(_plant(np.array([[0, 1.0], [1.0, 1.0]]))).nearest_parallel is None
    integrator = TransferFunction([1], [1, 0])
    plant = MatrixPlant([[integrator, _lag(1)], [_lag(1), integrator]])
    assert analyse_interaction(plant).nearest_parallel is None
    alike = ParallelPlant(3, _lag(1), _lag(0.3))
    assert analyse_interaction(alike).nearest_parallel is None


def test_degree_of_interaction_over_frequency() -> None:
    """SLH eq. 2: a(j omega) = i/g, dead times and lags included, above 10 units too."""
    g, i = TransferFunction([2], [10, 1], dead_time=1), TransferFunction([1], [5, 1], dead_time=2)
    for n in (2, 12):
        forms = analyse_interaction(ParallelPlant(n, g, i), OMEGA).parallel
        assert forms is not None
        expected = 0.5 * (1 + 10j * OMEGA) / (1 + 5j * OMEGA) * np.exp(-1j * OMEGA)
        np.testing.assert_allclose(forms.interactions, expected, rtol=1e-12)
