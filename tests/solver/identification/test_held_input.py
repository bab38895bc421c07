"""Simulated responses against formulas and against a library."""

import control
import numpy as np
import pytest
from drawn import Lag, moves, respond

from solver.identification.elements import (
    Element,
    ElementKind,
    free_motions,
    frequency_responses,
    responses,
)


def changes(time, u):
    """Return change times and deviations from the first value."""
    at = np.flatnonzero(np.diff(u)) + 1
    return time[at].copy(), u[at] - u[0]


TIMES = np.cumsum(np.random.default_rng(3).uniform(0.2, 3.0, 300))
TIMES -= TIMES[0]


@pytest.mark.parametrize(
    ("kind", "shape", "element"),
    [
        (ElementKind.FIRST, (np.log(7.0), 2.3), Lag(1, 7, 0, 2.3)),
        (ElementKind.FIRST, (np.log(1e-3), 0.0), Lag(1, 1e-3, 0, 0.0)),
        (ElementKind.SECOND, (np.log(9.0), 4 * 8 * 1 / 81, 2.3), Lag(1, 8, 1, 2.3)),
        (
            ElementKind.SECOND,
            (np.log(1000.001), 4e-3 * 1000 / 1000.001**2, 5.0),
            Lag(1, 1e3, 1e-3, 5),
        ),
        (ElementKind.INTEGRATOR, (4.4,), Lag(1, np.inf, 0, 4.4)),
        (ElementKind.INTEGRATOR_LAG, (np.log(6.0), 4.4), Lag(1, np.inf, 6, 4.4)),
    ],
)
def test_response_is_exact_at_uneven_samples(kind, shape, element):
    """Recursion and superposed steps agree to rounding, whatever the samples' distance."""
    u = moves(np.random.default_rng(1), TIMES.size, (3, 20))
    y = responses(kind, shape, TIMES, *changes(TIMES, u))[:, 0]
    assert y == pytest.approx(respond(element, TIMES, u), abs=1e-10 * np.ptp(y))


@pytest.mark.parametrize("ratio", [0.3, 1.0, 1.0 + 1e-12, 4.0])
def test_second_order_with_zero_agrees_with_a_library(ratio):
    """Real, equal and complex lags, and the zero."""
    element = Element(ElementKind.SECOND_ZERO, (np.log(5.0), ratio, 0.0), (2.0, -3.0))
    transfer = element.transfer_function()
    time = np.linspace(0, 60, 601)
    u = np.where(time < 10, 0.0, np.where(time < 35, 1.0, -0.5))
    ours = responses(element.kind, element.shape, time, *changes(time, u)) @ element.gains
    plant = control.ss(control.tf(transfer.num, transfer.den))
    theirs = np.zeros(time.size)
    for at, size in ((10.0, 1.0), (35.0, -1.5)):
        t = time[time >= at] - at
        theirs[time >= at] += size * control.step_response(plant, t)[1]
    assert ours == pytest.approx(theirs, abs=1e-8)


def test_free_motions_solve_the_equation():
    """From y = 1 at rest the motion is one minus the step response."""
    time = np.linspace(0, 40, 81)
    shape = (np.log(5.0), 0.6, 0.0)
    first, second = free_motions(ElementKind.SECOND, shape, time)
    step = responses(ElementKind.SECOND_ZERO, shape, time, np.zeros(1), np.ones(1))
    assert first == pytest.approx(1 - step[:, 0], abs=1e-12)
    # a y'' + b y' + y = 0 from slope 1/b: a/b times the response of s to a step.
    assert second == pytest.approx(step[:, 1] * 0.6 / 4 * 5.0, abs=1e-12)


def test_frequency_response_is_that_of_the_transfer_function():
    """Every form, with its dead time."""
    omega = np.geomspace(1e-3, 10, 30)
    for kind in ElementKind:
        shape = {"log_lag": 1.2, "ratio": 0.7, "dead_time": 0.4}
        values = tuple(shape[name] for name in kind.shape_names)
        gains = (1.5, 0.3)[: kind.gains]
        element = Element(kind, values, gains)
        found = frequency_responses(kind, np.array([values]), np.array([gains]), omega)[0]
        assert found == pytest.approx(element.transfer_function().response(omega), rel=1e-12)
