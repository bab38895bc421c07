"""Bandwidths of the loops alone and of the worst direction, near-singular plants included."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.robustness.bandwidth import Bandwidths, bandwidths
from solver.robustness.margins import loop_frequencies, loop_margins

IDENTICAL = (Controller(39.7, 65.1),) * 2
DIFFERENT = (Controller(46.3, 101.0), Controller(22.8, 3.15))


def of(plant: Plant, loops: tuple[Controller, ...]) -> Bandwidths:
    """Return the bandwidths of a stable loop."""
    margins = loop_margins(plant, loops, stable=True)
    alone = [row.alone.bandwidth if row.alone else None for row in margins]
    return bandwidths(plant, loops, alone, loop_frequencies(plant, loops))


def first_crossing(interaction: float, loops: tuple[Controller, ...], largest: bool) -> float:
    """Return where a singular value of S passes 0.707, from a dense grid of full matrices."""
    omega = np.geomspace(1e-12, 1e2, 400_001)
    s = 1j * omega
    g = 1 / (100 * s + 1)
    a, b = (loop.response(omega) for loop in loops)
    one, two = 1 + g * a, 1 + g * b
    up, down = interaction * g * b, interaction * g * a
    # Singular values of a 2 x 2 matrix M from |M|_F^2 and |det M|.
    size = (np.abs(one) ** 2 + np.abs(two) ** 2 + np.abs(up) ** 2 + np.abs(down) ** 2) / 2
    determinant = np.abs(one * two - up * down)
    root = np.sqrt(np.maximum(size**2 - determinant**2, 0))
    high = np.sqrt(size + root)
    S = high / determinant if largest else 1 / high
    return float(omega[np.flatnonzero(math.sqrt(0.5) <= S)[0]])


@pytest.mark.parametrize("loops", [IDENTICAL, DIFFERENT])
@pytest.mark.parametrize("interaction", [0.5, 0.949, -0.949, 0.9999])
def test_directions_are_singular_values_of_the_full_plant(
    interaction: float, loops: tuple[Controller, ...]
) -> None:
    """Worst and best direction agree with a dense grid over the full matrix."""
    found = of(first_order(2, 1.0, 100.0, interaction), loops)
    assert found.worst_direction == pytest.approx(
        first_crossing(interaction, loops, largest=True), rel=2e-4
    )
    assert found.best_direction == pytest.approx(
        first_crossing(interaction, loops, largest=False), rel=2e-4
    )


def test_interaction_takes_a_decade() -> None:
    """SLH, fig. 7: about 0.4 rad of each loop alone become about 0.02 together."""
    found = of(first_order(2, 1.0, 100.0, 0.949), IDENTICAL)
    assert found.alone == pytest.approx(0.392, abs=1e-3)
    assert found.worst_direction == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize("distance", [1e-3, 1e-7, 1e-11])
def test_weak_direction_is_as_slow_as_the_plant_is_near_singular(distance: float) -> None:
    """Loops of small gain: integral control of the weak direction, at distance k/tau_I rad."""
    loops = (Controller(1e-3, 1.0),) * 2
    found = of(first_order(2, 1.0, 100.0, 1 - distance), loops)
    # S = s/(s + distance k_I) there, but for distance k_P and the lag: 0.707 at |s| = distance k_I.
    assert found.worst_direction == pytest.approx(1e-3 * distance, rel=3e-3)
    assert found.alone is not None
    assert found.best_direction > found.alone


@pytest.mark.parametrize("distance", [1e-3, 1e-7, 1e-9])
def test_margins_see_the_slow_crossover(distance: float) -> None:
    """A loop whose only crossing of one lies at the weak direction's own rate has margins there."""
    loops = (Controller(1.0, 1000.0), Controller(2.0, 1000.0))
    plant = first_order(2, 1.0, 100.0, 1 - distance)
    together = loop_margins(plant, loops)[0].together
    assert together is not None
    # Seen by loop 1 far below 1/tau: c (1 - a^2 T) with T = c_2/(1 + c_2) and c ~ k/(tau_I s).
    s = 1j * together.crossover
    c_1, c_2 = (loop.gain * (1 + 1 / (1000 * s)) for loop in loops)
    g = 1 / (100 * s + 1)
    seen = c_1 * (g - ((1 - distance) * g) ** 2 * c_2 / (1 + g * c_2))
    assert abs(seen) == pytest.approx(1, rel=1e-6)
    assert together.crossover < 2 * distance
    assert math.degrees(np.pi + np.angle(seen)) == pytest.approx(together.phase_margin, abs=1e-3)


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e6])
def test_units_of_time_and_inputs_change_nothing(unit: float) -> None:
    """Bandwidths go with the unit of time; the units of inputs do not matter."""

    def plant(time: float, of_input: float) -> MatrixPlant:
        gains = [[1.0, 0.9], [0.8, 1.0]]
        return MatrixPlant(
            [
                [
                    TransferFunction([gain / (of_input if column else 1)], [10 * time, 1], time)
                    for column, gain in enumerate(row)
                ]
                for row in gains
            ]
        )

    reference = of(plant(1, 1), (Controller(1.0, 10.0), Controller(0.5, 8.0)))
    slower = of(plant(unit, 1), (Controller(1.0, 10 * unit), Controller(0.5, 8 * unit)))
    other = of(plant(1, unit), (Controller(1.0, 10.0), Controller(0.5 * unit, 8.0)))
    for name in ("alone", "worst_direction", "best_direction"):
        expected = getattr(reference, name)
        assert getattr(slower, name) * unit == pytest.approx(expected, rel=1e-8)
        assert getattr(other, name) == pytest.approx(expected, rel=1e-8)


def test_proportional_loops_never_below_have_none() -> None:
    """P control of gain 0.1 has a sensitivity of 0.9 from zero on: no bandwidth."""
    plant = MatrixPlant([[TransferFunction([1], [1, 1])]])
    found = of(plant, (Controller(0.1, None),))
    assert found == Bandwidths(alone=0.0, worst_direction=0.0, best_direction=0.0)


@pytest.mark.parametrize("scale", [1.0, 1e6, 1e-6])
@pytest.mark.parametrize("apart", [1e-7, 1e-12])
def test_nearly_singular_plants_have_bandwidths_in_any_unit_of_time(
    scale: float, apart: float
) -> None:
    """Where rounding hides the crossing the grid's point is told; nothing fails."""
    strong = TransferFunction([1], [10 * scale, 1])
    weak = TransferFunction([1 - apart], [10 * scale, 1])
    found = of(MatrixPlant([[strong, weak], [weak, strong]]), (Controller(1, 10 * scale),) * 2)
    assert 0 <= found.worst_direction * scale < 1e-5
