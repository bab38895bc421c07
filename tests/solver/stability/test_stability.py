import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from zoo import ZOO, interactions

from solver.model.controllers import DERIVATIVE_FILTER, Controller
from solver.model.errors import UnsupportedPlantError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.stability.closed_loop import INFINITELY_MANY, is_stable, unstable_poles


def closed_loop_poles(plant: ParallelPlant, loops: list[Controller]) -> np.ndarray:
    """Roots of det(den D + num A N), for i = a g without dead time: an independent way."""
    n, a = plant.n, plant.interaction.num[0] / plant.process.num[0]
    mix = (1 - a) * np.eye(n) + a * np.ones((n, n))
    total = np.zeros(1)
    for order in itertools.permutations(range(n)):
        term = np.array([np.linalg.det(np.eye(n)[list(order)])])
        for row, column in enumerate(order):
            loop = loops[column]
            num, den = np.array([loop.gain]), np.array([1.0])
            if loop.integral_time is not None:
                num, den = loop.gain * np.array([loop.integral_time, 1]), [loop.integral_time, 0.0]
            lead, lag = loop.derivative_time or 0.0, loop.filter_time
            lag = DERIVATIVE_FILTER * lead if lag is None else lag
            num, den = np.polymul(num, [lead, 1]), np.polymul(den, [lag, 1])
            entry = mix[row, column] * np.polymul(plant.process.num, num)
            if row == column:
                entry = np.polyadd(entry, np.polymul(plant.process.den, den))
            term = np.polymul(term, entry)
        total = np.polyadd(total, term)
    return np.roots(total)


decades = st.floats(-1.5, 1.5).map(lambda e: 10.0**e)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(decades, min_size=1, max_size=3),
    st.lists(
        st.tuples(decades, decades | st.none(), st.none() | decades, st.none() | decades),
        min_size=1,
        max_size=3,
    ),
    interactions(-0.9, 0.95),
    st.booleans(),
    st.booleans(),
)
def test_count_equals_the_roots_of_the_characteristic_polynomial(
    poles, settings_, a, integrates, resonates
):
    """Random rational loops: as many unstable poles as the polynomial has."""
    den = np.poly([-p for p in poles])
    if resonates:
        den = np.polymul(den, [1, 0.02, 1])
    if integrates:
        den = np.append(den, 0)
    plant = ParallelPlant(len(settings_), TransferFunction([1.0], den), TransferFunction([a], den))
    loops = [Controller(*values) for values in settings_]
    roots = closed_loop_poles(plant, loops)
    if np.abs(roots.real).min() < 1e-6 * np.abs(roots).max():
        return  # on the axis to rounding: neither count is meaningful
    assert unstable_poles(plant, loops) == (roots.real > 0).sum()


@pytest.mark.parametrize("case", ZOO, ids=str)
def test_the_zoo_is_stable(case):
    """Every loop of the zoo is stable."""
    assert is_stable(case.plant, case.loops)


def test_dead_time_limit_is_exact():
    """k exp(-s)/s with pure gain k (tau_I huge) is stable up to k = pi/2."""
    plant = ParallelPlant(1, TransferFunction([1], [1, 0], 1), TransferFunction([0], [1]))
    limit = np.pi / 2
    assert is_stable(plant, [Controller(0.999 * limit, 1e6)])
    assert unstable_poles(plant, [Controller(1.001 * limit, 1e6)]) == 2


def test_many_units_count_each_difference_mode():
    """1 + (g - i) c with a right half plane pole counts n - 1 times."""
    plant = first_order(5, 1, 10, 1.5)
    assert unstable_poles(plant, [Controller(3, 8)] * 5) == 4


@pytest.mark.parametrize("excess", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("gain", [20, 21])
def test_a_weak_direction_is_followed_to_its_own_frequency(excess, gain):
    """A = 1 + excess has a pole near excess/3 in the right half plane, a = 1 - excess has none."""
    loops = [Controller(20, 60), Controller(gain, 60)]
    assert unstable_poles(first_order(2, 1, 100, 1 + excess), loops) == 1
    assert unstable_poles(first_order(2, 1, 100, 1 - excess), loops) == 0


LAG = TransferFunction([1], [10, 1])
INTEGRATOR = TransferFunction([1], [1, 0])


@pytest.mark.parametrize(
    ("plant", "count"),
    [
        (first_order(2, 1, 100, 1.0), 1),
        (first_order(5, 1, 100, 1.0), 4),
        (first_order(4, 1, 100, -1 / 3), 1),
        (MatrixPlant([[LAG, LAG], [LAG, LAG]]), 1),
        (ParallelPlant(2, INTEGRATOR, INTEGRATOR), 1),
    ],
)
@pytest.mark.parametrize("different", [0.0, 1.0])
def test_integrators_that_cannot_act_stay_at_the_origin(plant, count, different):
    """A singular gain leaves a closed-loop pole at s = 0 for each direction it lacks."""
    loops = [Controller(2 + different * unit, 60) for unit in range(plant.n)]
    assert unstable_poles(plant, loops) == count


def test_dead_time_with_feedthrough():
    """A static process with dead time is stable below gain 1 and hopeless above."""
    plant = first_order(1, 1, 0, 0, 1)
    assert is_stable(plant, [Controller(0.5, 1)])
    assert unstable_poles(plant, [Controller(1.1, 1)]) == INFINITELY_MANY


@pytest.mark.parametrize("den", [[1, -1], [1, 0, 1]])
def test_unstable_plants_are_refused(den):
    """A pole on the right or on the imaginary axis is named with its element."""
    plant = ParallelPlant(2, TransferFunction([1], [1, 1]), TransferFunction([1], den))
    with pytest.raises(UnsupportedPlantError, match="open-loop unstable") as error:
        unstable_poles(plant, [Controller(1, 1)] * 2)
    assert error.value.field == "/plant/interaction/den"


def test_hundreds_of_unlike_loops_are_counted_right():
    """The argument of a product of 300 factors turns once round between two points unseen."""
    loops = [Controller(1 + 1e-3 * unit, 100) for unit in range(300)]
    assert is_stable(first_order(300, 1, 100, 0.001, 1), loops)
    # Without interaction each loop stands for itself: those of gains above pi/2 * 100 are lost.
    plant = first_order(40, 1, 100, 0, 1)
    loops = [Controller(100 + 5 * unit, 100) for unit in range(40)]
    alone = [unstable_poles(first_order(1, 1, 100, 0, 1), [loop]) for loop in loops]
    assert unstable_poles(plant, loops) == sum(alone) > 0
