"""Plants and controllers from and to python-control and scipy.signal."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.signal

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.workbench.interchange import from_control, plant, to_control

LAG = ([1], [10, 1])
NONE = ([0], [1])


@pytest.mark.parametrize(
    "G",
    [
        [[LAG, NONE], [NONE, LAG]],
        [[TransferFunction([1], [10, 1]), 0], [0, TransferFunction([1], [10, 1])]],
        [[control.tf([1], [10, 1]), 0.0], [0, control.tf([1], [10, 1])]],
        [[scipy.signal.lti([1], [10, 1]), 0], [0, scipy.signal.TransferFunction([1], [10, 1])]],
        [[scipy.signal.ZerosPolesGain([], [-0.1], 0.1), 0], [0, ([0, 0.1], [1, 0.1])]],
        control.tf([[[1], [0]], [[0], [1]]], [[[10, 1], [1]], [[1], [10, 1]]]),
        [[(np.array([1], dtype=np.uint8), np.array([10, 1], dtype=np.int16))]],
    ],
)
def test_other_libraries_plants_are_the_same_plant(G):
    """Whatever the form, the response is that of the lag."""
    found = plant(G)
    omega = np.array([0.01, 0.1, 3.0])
    for element in (found.element(unit, unit) for unit in range(found.n)):
        assert element.response(omega) == pytest.approx(1 / (10j * omega + 1), rel=1e-12)


def test_unlike_units_make_a_matrix():
    """A parallel plant is one only where it is."""
    G = [[LAG, ([1], [5, 1])], [([2], [5, 1]), LAG]]
    assert isinstance(plant(G), MatrixPlant)
    assert plant(G).element(1, 0).num == (2.0,)
    assert isinstance(plant(first_order(2, 1, 10, 0.5)), ParallelPlant)
    assert isinstance(plant([[LAG, NONE], [NONE, LAG]]), ParallelPlant)


def test_dead_times_stand_beside():
    """One for all, or one each; they add to those that the entries have."""
    assert plant([[LAG]], dead_time=2).element(0, 0).dead_time == 2
    delayed = TransferFunction([1], [10, 1], 1.0)
    found = plant([[delayed, LAG], [LAG, delayed]], dead_time=[[1, 2], [3, 4]])
    assert [found.element(*at).dead_time for at in ((0, 0), (0, 1), (1, 0), (1, 1))] == [2, 2, 3, 5]


@pytest.mark.parametrize(
    ("G", "field"),
    [
        ([[LAG, LAG]], "/0"),
        ([], ""),
        ("G", ""),
        (None, ""),
        (3, ""),
        ([[LAG, NONE], [NONE, "lag"]], "/1/1"),
        ([[LAG, NONE], [NONE, ([1], [1, "2"])]], "/1/1/den/1"),
        ([[([1, 0, 0], [1, 1])]], "/0/0/num"),
        ([[([1], [0, 0])]], "/0/0/den"),
        ([[([1], [1], [1])]], "/0/0"),
        (control.tf([1], [1, 0.5], 0.1), ""),
        ([[control.tf([1], [1, 0.5], True)]], "/0/0"),
        (scipy.signal.dlti([1], [1, 0.5]), ""),
        (control.tf([[[1], [1]]], [[[1, 1], [1, 2]]]), ""),
    ],
)
def test_what_is_no_plant_is_refused(G, field):
    """Not square, improper, discrete, or something else: by name."""
    with pytest.raises(InvalidInputError) as error:
        plant(G)
    assert error.value.field == field


@pytest.mark.parametrize("G", [control.ss(-1, 1, 1, 0), scipy.signal.StateSpace(-1, 1, 1, 0)])
def test_state_space_is_what_it_responds_with(G):
    """A state-space object is the plant with its frequency response."""
    omega = np.array([0.1, 1.0, 10.0])
    expected = 1 / (1j * omega + 1)
    assert np.allclose(plant(G).response(omega)[:, 0, 0], expected, rtol=1e-9)
    assert np.allclose(plant([[G]]).response(omega)[:, 0, 0], expected, rtol=1e-9)


@pytest.mark.parametrize("dead_time", [-1, "1", [1], [[1, 2]], True, np.nan])
def test_faulty_dead_times_are_refused(dead_time):
    """By name."""
    with pytest.raises(InvalidInputError) as error:
        plant([[LAG]], dead_time=dead_time)
    assert error.value.field.startswith("/dead_time")


@pytest.mark.parametrize(
    "thing",
    [
        Controller(2, 5),
        Controller(2, 5, 1),
        Controller(2, None, 1),
        Controller(-2, 5, None, 0.3),
        TransferFunction([1, 2], [3, 4, 5]),
        first_order(3, 1, 10, 0.5),
    ],
)
def test_python_control_has_the_same_response(thing):
    """Controllers of all kinds and plants, at any frequency."""
    s = np.array([0.01j, 0.3j, 20j, 1 + 1j])
    theirs = to_control(thing)(s)
    if isinstance(thing, ParallelPlant):
        for row in range(3):
            for column in range(3):
                assert theirs[row, column] == pytest.approx(thing.element(row, column)(s))
    else:
        assert theirs == pytest.approx(thing(s), rel=1e-12)


def test_controllers_become_a_diagonal():
    """Loop i acts from output i to input i."""
    C = to_control([Controller(1, 2), Controller(3, 4)])
    s = 0.5j
    assert C(s) == pytest.approx(np.diag([Controller(1, 2)(s), Controller(3, 4)(s)]))


def test_dead_time_is_approximated_only_when_asked_for():
    """python-control has none."""
    delayed = TransferFunction([1], [10, 1], 2.0)
    with pytest.raises(InvalidInputError, match="pade") as error:
        to_control(delayed)
    assert error.value.field == "/dead_time"
    assert to_control(delayed, pade=5)(0.2j) == pytest.approx(delayed(0.2j), rel=1e-6)
    for order in (0, 1.5, True):
        with pytest.raises(InvalidInputError):
            to_control(delayed, pade=order)
    for thing in (None, "C", [1], 3):
        with pytest.raises(InvalidInputError):
            to_control(thing)


def test_a_plant_returns_from_python_control():
    """There and back it is the same."""
    original = first_order(2, 1, 100, 0.949)
    assert plant(to_control(original)) == original


def test_from_control_takes_linear_models_of_python_control_alone():
    """Transfer functions, state space and responses; nothing else, nothing that is not linear."""
    lag = control.tf([1], [10, 1])
    assert from_control(lag, dead_time=2) == plant(lag, dead_time=2)
    assert from_control(control.ss(lag)).element(0, 0).static_gain == pytest.approx(1)
    assert from_control(control.frd(lag, [0.1, 1.0, 10.0])).n == 1
    moving = control.nlsys(lambda _t, x, u, _p: -x + u, inputs=1, outputs=1, states=1)
    for other in (moving, 3.0, ([1], [10, 1]), scipy.signal.lti([1], [10, 1])):
        with pytest.raises(InvalidInputError, match=r"python-control|linear"):
            from_control(other)
    with pytest.raises(InvalidInputError, match="discrete"):
        from_control(control.tf([1], [1, -0.5], 0.1))
