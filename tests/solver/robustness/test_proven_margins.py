"""Ms, Mt and bandwidths over all frequencies: proven, or put right."""

from dataclasses import replace

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.peaks import Peak
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.robustness.bandwidth import bandwidths
from solver.robustness.margins import loop_frequencies, loop_margins
from solver.robustness.proven_margins import proven_margins

PARALLEL = first_order(5, 1, 100, 0.6)
GROUPS = (Controller(20, 50),) * 2 + (Controller(8, 30),) * 3
DELAYED = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)
WOOD_BERRY = (Controller(0.2, 4.44), Controller(-0.04, 2.67))


def figures(plant, loops):
    """Margins and bandwidths as they are sampled."""
    margins = loop_margins(plant, loops, stable=True)
    alone = [row.alone.bandwidth if row.alone else None for row in margins]
    return margins, bandwidths(plant, loops, alone, loop_frequencies(plant, loops))


def analyse_speeds(plant, loops):
    """Margins and bandwidths as they are told."""
    return proven_margins(plant, loops, *figures(plant, loops))[:2]


@pytest.mark.parametrize(("plant", "loops"), [(PARALLEL, GROUPS), (DELAYED, WOOD_BERRY)])
def test_wrong_figures_are_put_right(plant, loops):
    """Peaks that are too low and bandwidths that are too high become those of the curves."""
    margins, speeds = figures(plant, loops)
    low = Peak(0.9, 1.0)
    spoilt = tuple(
        replace(
            row,
            alone=replace(row.alone, sensitivity=low, bandwidth=3 * row.alone.bandwidth),
            together=replace(row.together, complementary_sensitivity=low, bandwidth=1e9),
        )
        for row in margins
    )
    wrong = replace(speeds, worst_direction=10 * speeds.worst_direction, best_direction=np.inf)
    found, right, guarantee = proven_margins(plant, loops, spoilt, wrong)
    assert guarantee.status == "proven"
    for got, expected in zip(found, margins, strict=True):
        for side in ("alone", "together"):
            a, b = getattr(got, side), getattr(expected, side)
            assert a.sensitivity.value == pytest.approx(b.sensitivity.value, rel=1e-4)
            assert a.complementary_sensitivity.value == pytest.approx(
                b.complementary_sensitivity.value, rel=1e-4
            )
            assert a.bandwidth == pytest.approx(b.bandwidth, rel=1e-4)
    assert right.worst_direction == pytest.approx(speeds.worst_direction, rel=1e-4)
    assert right.best_direction == pytest.approx(speeds.best_direction, rel=1e-4)
    assert right.alone == pytest.approx(speeds.alone, rel=1e-4)


def test_dead_time_that_is_fed_through_hides_no_crossing():
    """The slowest direction is found before a later crossing that the samples met first."""
    plant = ParallelPlant(
        4,
        TransferFunction([92.56808713628635], [1.0, 15.293840481389843]),
        TransferFunction([5.867770680212417], [1.0, 13.991107102293757], 3.41486761),
    )
    loops = (Controller(1.8200857821196221, 21.262894002738857),) * 4
    margins, speeds = figures(plant, loops)
    _, right, _ = proven_margins(plant, loops, margins, speeds)
    omega = np.linspace(0.5, 1, 40_000) * right.worst_direction
    g, i = plant.process.response(omega), plant.interaction.response(omega)
    c = loops[0].response(omega)
    worst = np.maximum(abs(1 / (1 + (g + 3 * i) * c)), abs(1 / (1 + (g - i) * c)))
    assert worst[:-4].max() < np.sqrt(0.5)


def test_a_ripple_of_dead_time_is_the_first_crossing():
    """Long dead time from unit to unit: the slowest direction crosses at a ripple, not after it."""
    plant = ParallelPlant(
        2, TransferFunction([1], [1000, 1]), TransferFunction([0.5], [1000, 1], 100)
    )
    loops = (Controller(643, 1081, 0.4, 0.045), Controller(521, 956, 0.57, 0.063))
    _, speeds = analyse_speeds(plant, loops)
    omega = np.linspace(0.1, 1, 20_000) * speeds.worst_direction
    G = plant.response(omega)
    c = np.stack([loop.response(omega) for loop in loops], axis=-1)
    smallest = np.linalg.svd(np.eye(2) + G * c[:, None], compute_uv=False)[:, -1]
    assert smallest[:-4].min() > np.sqrt(2)


def test_integrators_in_one_row_are_no_obstacle():
    """Rows with the plant's integrators, columns with the loops', have their own powers of s."""
    plant = MatrixPlant(
        [
            [TransferFunction([2.0], [1, 0]), TransferFunction([1.0], [1, 0])],
            [TransferFunction([0.3], [5, 1]), TransferFunction([1.0], [10, 1])],
        ]
    )
    loops = (Controller(0.1, None), Controller(1.0, 10))
    margins, speeds = figures(plant, loops)
    found, right, guarantee = proven_margins(plant, loops, margins, speeds)
    assert guarantee.status == "proven"
    assert found == margins
    assert right == speeds


@pytest.mark.parametrize("unit", [1e9, 1e-9])
def test_settings_in_any_unit_of_time_are_proven(unit):
    """Products of times beyond the range of a plant's coefficients are no obstacle."""
    plant = first_order(2, 1, 100 * unit, 0.6, 3 * unit)
    loops = (
        Controller(20, 50 * unit, 8 * unit, 0.8 * unit),
        Controller(10, 80 * unit, 2 * unit, 0.3 * unit),
    )
    margins, speeds = figures(plant, loops)
    found, right, guarantee = proven_margins(plant, loops, margins, speeds)
    assert guarantee.status == "proven"
    assert found[0].together.sensitivity.value == pytest.approx(3.382678, rel=1e-4)
    assert right.worst_direction * unit == pytest.approx(0.04587595, rel=1e-4)


def test_unlike_loops_beyond_the_proof_are_said_to_be():
    """More than a dozen unlike loops keep their sampled figures, with the reason."""
    plant = first_order(13, 1, 100, 0.02)
    loops = tuple(Controller(10 + k, 100) for k in range(13))
    margins, speeds = figures(plant, loops)
    found, _, guarantee = proven_margins(plant, loops, margins, speeds)
    assert found == margins
    assert guarantee.status == "open"
    assert "12" in guarantee.reason
