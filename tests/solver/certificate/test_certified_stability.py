"""The number of unstable poles that a certificate's intervals enclose is the true one."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from zoo import interactions

from solver.certificate.record import Certificate, Claim
from solver.certificate.search import CertificateFailure, Obstacle, certify
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty

SLOW_AND_FILTERED = [HealthCheck.too_slow, HealthCheck.filter_too_much]

Polynomial = NDArray[np.float64]
UNCERTAINTY = Uncertainty.from_error(0.2, 0.1)
PERFORMANCE = Performance(tau_p=10.0)
# So high that only a loop with poles on the imaginary axis, or very near, exceeds it.
ANY_LEVEL = 1e6


def unstable_poles(claim: Claim) -> int:
    """Return what the certificate or its failure says."""
    outcome = certify(claim)
    if isinstance(outcome, Certificate):
        return 0
    if outcome.obstacle is not Obstacle.UNSTABLE:
        reject()  # poles so near the axis that mu exceeds even this level
    return outcome.unstable_poles


def polynomials(loop: Controller) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of a controller."""
    num = loop.gain * np.array([loop.integral_time, 1])
    den = np.array([loop.integral_time, 0])
    if loop.derivative_time is not None:
        num = np.polymul(num, [loop.derivative_time, 1])
        den = np.polymul(den, [0.1 * loop.derivative_time, 1])
    return num, den


def closed_loop_poles(
    process: TransferFunction, factor: float, loop: Controller
) -> NDArray[np.complex128]:
    """Poles of one mode, factor times a process without dead time."""
    num, den = polynomials(loop)
    return np.roots(np.polyadd(np.polymul(process.den, den), factor * np.polymul(process.num, num)))


PROCESSES = st.sampled_from(
    [
        TransferFunction([1], [1, 3, 3, 1]),
        TransferFunction([-0.5, 1], [1, 2, 1]),
        TransferFunction([1], [1, 0.4, 1]),
        TransferFunction([1], [1, 1, 0]),
        TransferFunction([1], [1, 0, 0]),
        TransferFunction([1], [1, 1]),
    ]
)
LOOPS = st.builds(
    Controller,
    st.floats(0.05, 20),
    st.floats(0.2, 20),
    st.none() | st.floats(0.05, 1),
)


@settings(max_examples=40, deadline=None, suppress_health_check=SLOW_AND_FILTERED)
@given(PROCESSES, st.integers(1, 4), interactions(-0.3, 0.9), LOOPS)
def test_identical_loops_have_the_unstable_poles_of_their_modes(
    process: TransferFunction, n: int, interaction: float, loop: Controller
) -> None:
    """Poles by encirclement equal the roots of the two modes' characteristic polynomials."""
    assume(abs(interaction) > 1e-3)
    scaled = TransferFunction([interaction * c for c in process.num], process.den)
    plant = ParallelPlant(n, process, scaled)
    roots = [
        closed_loop_poles(process, factor, loop)
        for factor in [1 + (n - 1) * interaction, *[1 - interaction] * (n - 1)]
    ]
    assume(all(np.abs(r.real).min() > 1e-3 for r in roots))
    expected = sum(int(np.sum(r.real > 0)) for r in roots)
    claim = Claim(plant, UNCERTAINTY, PERFORMANCE, (loop,) * n, ANY_LEVEL)
    assert unstable_poles(claim) == expected


@settings(max_examples=25, deadline=None, suppress_health_check=SLOW_AND_FILTERED)
@given(LOOPS, LOOPS, interactions(-0.9, 0.9), st.sampled_from([ParallelPlant, MatrixPlant]))
def test_different_loops_have_the_roots_of_the_determinant(
    first: Controller, second: Controller, interaction: float, kind: type
) -> None:
    """Two loops on a third-order process: det(I + G C) over a common denominator."""
    process = TransferFunction([1], [1, 3, 3, 1])
    other = TransferFunction([interaction or 0.1], process.den)
    plant = (
        ParallelPlant(2, process, other)
        if kind is ParallelPlant
        else MatrixPlant([[process, other], [other, process]])
    )
    (num_1, den_1), (num_2, den_2) = polynomials(first), polynomials(second)
    den_1, den_2 = np.polymul(process.den, den_1), np.polymul(process.den, den_2)
    det = reduce(
        np.polyadd,
        [
            np.polymul(den_1, den_2),
            np.polymul(num_1, den_2),
            np.polymul(num_2, den_1),
            (1 - other.num[0] ** 2) * np.polymul(num_1, num_2),
        ],
    )
    roots = np.roots(det)
    assume(np.abs(roots.real).min() > 1e-3)
    claim = Claim(plant, UNCERTAINTY, PERFORMANCE, (first, second), ANY_LEVEL)
    assert unstable_poles(claim) == int(np.sum(roots.real > 0))


@pytest.mark.parametrize(("gain", "expected"), [(0.99, 0), (1.01, 2)])
def test_the_limit_of_stability_with_dead_time_is_met(gain: float, expected: int) -> None:
    """1/(s + 1) exp(-s) under proportional-integral control, on either side of its limit.

    With tau_I = 1 the loop is k exp(-s)/s, stable for k < pi/2.
    """
    claim = Claim(
        first_order(1, 1, 1, 0, 1.0),
        UNCERTAINTY,
        PERFORMANCE,
        (Controller(gain * math.pi / 2, 1.0),),
        ANY_LEVEL,
    )
    assert unstable_poles(claim) == expected


@pytest.mark.parametrize(("gain", "expected"), [(0.999, 0), (1.001, 2)])
def test_two_modes_with_dead_time_have_a_limit_each(gain: float, expected: int) -> None:
    """With a = 0.5 the easy mode, 1 + a, sets the limit."""
    claim = Claim(
        first_order(2, 1, 1, 0.5, 1.0),
        UNCERTAINTY,
        PERFORMANCE,
        (Controller(gain * math.pi / 3, 1.0),) * 2,
        ANY_LEVEL,
    )
    assert unstable_poles(claim) == expected


def test_a_positive_feedback_has_its_one_real_pole() -> None:
    """A gain of the wrong sign makes one unstable pole in each mode."""
    claim = Claim(
        first_order(3, 1, 10, 0.2),
        UNCERTAINTY,
        PERFORMANCE,
        (Controller(-0.5, 10.0),) * 3,
        ANY_LEVEL,
    )
    outcome = certify(claim)
    assert isinstance(outcome, CertificateFailure)
    assert outcome.unstable_poles == 3
