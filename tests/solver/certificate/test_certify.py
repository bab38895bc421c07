"""Certificates exist above the peak of mu and nowhere else, and their scales hold on any grid."""

from __future__ import annotations

import math

import numpy as np
import pytest
from certified_loops import (
    PUBLISHED,
    PUBLISHED_PEAK,
    level_at,
    loops_to_certify,
    mu_over,
    peak_of,
    published,
)
from hypothesis import HealthCheck, assume, given, settings
from zoo import ZOO, Case

from solver.certificate.record import Certificate, Claim
from solver.certificate.search import CertificateFailure, Obstacle, certify, prove
from solver.certificate.verify import check
from solver.model.controllers import Controller
from solver.model.errors import Cancelled, InvalidInputError, UnsupportedPlantError
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.robustness.axis import proven_peaks

SLOW_AND_FILTERED = [HealthCheck.too_slow, HealthCheck.filter_too_much]

UNCERTAINTY = Uncertainty.from_error(0.2, 1)
Loops = tuple[Plant, Uncertainty, Performance, tuple[Controller, ...]]


def grid(certificate: Certificate, points: int) -> np.ndarray:
    """Frequencies inside every interval and at its ends."""
    omega = []
    for proven in certificate.intervals:
        low, high = proven.interval.low, proven.interval.high
        low, high = (low or high / 1e4), (low * 1e4 if math.isinf(high) else high)
        omega.append(np.geomspace(low, high, points))
    return np.concatenate(omega)


def certified(claim: Claim) -> Certificate:
    """Return the certificate of a claim that holds, checked."""
    certificate = certify(claim)
    assert isinstance(certificate, Certificate), certificate
    assert check(certificate).ok
    return certificate


def test_the_published_settings_are_certified_at_1_0004(certificate: Certificate) -> None:
    """SLH section 5: the peak is 1.00034840, and every frequency is below 1.0004."""
    assert check(certificate).ok
    assert level_at(grid(certificate, 50), certificate).max() <= 1.0004


def test_the_published_settings_are_refused_at_1_0003() -> None:
    """SLH section 5: mu exceeds 1.0003 near 0.0314, and the refusal says so."""
    failure = certify(published(1.0003))
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle is Obstacle.EXCEEDED
    assert failure.omega == pytest.approx(0.0314362, rel=0.1)
    assert 1.0003 < (failure.mu or 0) <= PUBLISHED_PEAK + 1e-8


def test_a_level_within_1e_6_of_the_peak_is_certified() -> None:
    """The enclosures leave no gap that matters: 1.00034840 < 1.000349."""
    certified(published(1.000349))


def test_a_resonance_between_the_points_of_a_grid_is_caught() -> None:
    """A resonance far narrower than the spacing of a 100-point grid stands out in no point."""
    omega = np.geomspace(1e-3, 1e2, 100)
    centre = math.sqrt(omega[70] * omega[71])
    damping = 1e-5
    resonance = [1, 2 * 40 * damping * centre, centre**2]
    anti = [1, 2 * damping * centre, centre**2]
    process = TransferFunction(np.convolve([1.0], resonance), np.convolve([100, 1], anti))
    plant = ParallelPlant(2, process, TransferFunction([0.5], [100, 1]))
    loops = (Controller(30, 100), Controller(25, 90))
    task = (plant, UNCERTAINTY, Performance(tau_p=30.0), loops)
    seen = mu_over(omega, *task).max()
    assert seen < 0.95
    failure = certify(Claim(*task, 1.0))
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle is Obstacle.EXCEEDED
    assert failure.omega == pytest.approx(centre, rel=0.01)
    true_peak = mu_over(centre * (1 + np.linspace(-1e-2, 1e-2, 20001)), *task).max()
    assert true_peak > 1.05
    certified(Claim(*task, 1.002 * true_peak))


@settings(max_examples=200, deadline=None, suppress_health_check=SLOW_AND_FILTERED)
@given(loops_to_certify())
def test_the_level_is_never_below_the_peak_and_within_one_per_cent_of_it(task: Loops) -> None:
    """Random stable loops: certified at 1.005 times the dense peak, and with scales that hold."""
    peak = peak_of(*task)
    assume(peak < 10)  # at the verge of instability no grid shows the peak
    certificate = certify(Claim(*task, 1.005 * peak))
    if isinstance(certificate, CertificateFailure):
        assume(certificate.obstacle is not Obstacle.UNSTABLE)
        pytest.fail(f"{certificate} with a peak of {peak}")
    assert level_at(grid(certificate, 5), certificate).max() <= 1.005 * peak * (1 + 1e-9)


@settings(max_examples=25, deadline=None, suppress_health_check=SLOW_AND_FILTERED)
@given(loops_to_certify())
def test_nothing_is_certified_below_the_peak(task: Loops) -> None:
    """Random stable loops: a level 1e-6 under a value that mu takes is refused."""
    peak = peak_of(*task)
    assume(peak < 10)
    failure = certify(Claim(*task, peak * (1 - 1e-6)))
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle in {Obstacle.EXCEEDED, Obstacle.UNSTABLE}


def test_the_certificate_does_not_depend_on_the_unit_of_time() -> None:
    """Minutes or seconds: the same number of intervals, at 60 times lower frequencies."""
    plant, _, _, loops = PUBLISHED
    in_seconds = Claim(
        first_order(2, 1, 6000, 0.949),
        Uncertainty.from_error(0.2, 60),
        Performance(tau_p=19.0 * 60),
        tuple(Controller(loop.gain, loop.integral_time * 60) for loop in loops),
        1.001,
    )
    first, second = certified(published(1.001)), certified(in_seconds)
    assert plant.n == 2
    assert len(first.intervals) == len(second.intervals)
    assert second.intervals[0].interval.high == pytest.approx(
        first.intervals[0].interval.high / 60, rel=1e-9
    )


def test_a_dead_time_in_the_uncertainty_weight_changes_nothing() -> None:
    """Only its magnitude counts: as many intervals prove the claim."""
    plant, uncertainty, performance, loops = PUBLISHED
    weight = TransferFunction(uncertainty.weight.num, uncertainty.weight.den, dead_time=3.0)
    delayed = certified(Claim(plant, Uncertainty(weight), performance, loops, 1.01))
    assert len(delayed.intervals) == len(certified(published(1.01)).intervals)


LAG = TransferFunction([1], [10, 1])
MILD = Uncertainty.from_error(0.1, 0.5)
# Kinds that the zoo lacks.
FURTHER = (
    Case(
        "fifty units in two groups",
        first_order(50, 1, 100, -0.015),
        (Controller(40, 100),) * 25 + (Controller(20, 60),) * 25,
    ),
    Case(
        "long dead time, full-block uncertainty",
        first_order(2, 1, 10, 0.3, 50.0),
        (Controller(0.15, 20), Controller(0.2, 25)),
        Uncertainty.from_error(0.1, 0.5, Structure.FULL),
        Performance(tau_p=300.0),
    ),
    Case(
        "integrating in one mode only",
        ParallelPlant(3, TransferFunction([11, 1], [1, 0.1, 0]), TransferFunction([1], [0.1, 0])),
        (Controller(0.02, 300),) * 3,
        MILD,
        Performance(tau_p=80.0),
    ),
    Case(
        "order twenty",
        ParallelPlant(
            2,
            TransferFunction([1], np.poly([-1] * 20)),
            TransferFunction([0.5], np.poly([-1] * 20)),
        ),
        (Controller(0.1, 10), Controller(0.12, 9)),
        MILD,
        Performance(tau_p=200.0),
    ),
    Case(
        "matrix with a zero element and dead time",
        MatrixPlant(
            [[LAG, TransferFunction([0], [1])], [TransferFunction([0.4], [30, 1], 1.0), LAG]]
        ),
        (Controller(2, 10), Controller(2, 10)),
        MILD,
        Performance(tau_p=10.0),
    ),
)


@pytest.mark.parametrize("case", [*ZOO, *FURTHER], ids=str)
def test_every_kind_of_plant_is_certified_close_to_its_peak(case: Case) -> None:
    """Within 0.2 per cent of the peak on a dense grid, and the whole loop confirms the scales."""
    task = (case.plant, case.uncertainty, case.performance, case.loops)
    peak = mu_over(np.geomspace(1e-7, 1e4, 5000), *task).max()
    certificate = certified(Claim(*task, 1.002 * peak))
    assert level_at(grid(certificate, 5), certificate).max() <= 1.002 * peak * (1 + 1e-9)


def test_unstable_loops_have_no_certificate() -> None:
    """At gains ten times too high for the dead time, the failure counts the unstable poles."""
    plant = first_order(2, 1, 100, 0.5, 5.0)
    task = (plant, UNCERTAINTY, Performance(tau_p=100.0))
    failure = certify(Claim(*task, (Controller(300, 60),) * 2, 1e6))
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle is Obstacle.UNSTABLE
    assert failure.unstable_poles > 0


def test_a_pole_at_the_origin_leaves_the_claim_unresolved() -> None:
    """With a = 1 the integrators' difference acts on nothing; the search ends near s = 0."""
    task = (first_order(2, 1, 100, 1.0), UNCERTAINTY, Performance(offset=0.1, tau_p=100.0))
    failure = certify(Claim(*task, (Controller(10, 100), Controller(9, 100)), 20.0))
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle is Obstacle.UNRESOLVED
    assert failure.omega is not None
    assert failure.omega < 1e-10


def test_plants_that_are_unstable_in_open_loop_are_refused() -> None:
    """An unstable pole is outside what the encirclement count covers."""
    plant = ParallelPlant(1, TransferFunction([1], [1, -1]), LAG)
    with pytest.raises(UnsupportedPlantError, match="pole"):
        certify(Claim(plant, UNCERTAINTY, Performance(tau_p=1.0), (Controller(1, 1),), 1.0))


def test_a_missing_time_constant_is_named() -> None:
    """The level of mu is undefined without a performance weight."""
    plant, uncertainty, _, loops = PUBLISHED
    with pytest.raises(InvalidInputError) as fault:
        certify(Claim(plant, uncertainty, Performance(), loops, 1.0))
    assert fault.value.field == "/performance/tau_p"


def test_too_many_different_settings_have_no_certificate() -> None:
    """Twenty-one different loops are refused at once; as many equal ones are not."""
    plant = first_order(21, 1, 100, 0.01)
    different = tuple(Controller(10 + unit, 100) for unit in range(21))
    task = (plant, UNCERTAINTY, Performance(tau_p=100.0))
    assert certify(Claim(*task, different, 2.0)) == CertificateFailure(Obstacle.TOO_LARGE)
    certified(Claim(*task, different[:1] * 21, 2.0))


def test_an_interruption_ends_the_search() -> None:
    """What the callback raises reaches the caller."""

    def stop() -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        certify(published(1.0004), stop)


def test_the_same_claim_has_the_same_certificate(certificate: Certificate) -> None:
    """The search is deterministic to the last digit."""
    assert certify(published(1.0004)) == certificate


def test_a_loop_without_integral_action_has_no_certificate_and_says_so() -> None:
    """P control of an integrating process: stable, mu finite, and the reason has words."""
    plant = ParallelPlant(1, TransferFunction([1], [1, 0]), TransferFunction([0], [1]))
    claim = Claim(plant, UNCERTAINTY, Performance(tau_p=20), (Controller(0.3, None),), 1.1)
    failure = certify(claim)
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle is Obstacle.PROPORTIONAL


def test_loops_with_and_without_integral_action_have_a_certificate_together() -> None:
    """Each column of the loop takes the powers of s of its own controller."""
    loops = (Controller(5.0, 50.0), Controller(8.5, None))
    performance = Performance(tau_p=40, offset=0.5)
    claim = Claim(first_order(2, 1, 100, 0.3), UNCERTAINTY, performance, loops, 0.606)
    assert certified(claim).claim == claim


def test_a_proof_that_takes_too_long_beside_a_result_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Many unlike settings: the search says that it was cut short, not that it met an obstacle."""
    loops = tuple(Controller(20 + unit, 100) for unit in range(3))
    task = (first_order(3, 1, 100, 0.1, 1), UNCERTAINTY, Performance(tau_p=30))
    failure = certify(Claim(*task, loops, 10.0), attempts=3)
    assert isinstance(failure, CertificateFailure)
    assert failure.obstacle is Obstacle.EXHAUSTED
    monkeypatch.setattr("solver.certificate.search.BESIDE_A_RESULT", 27)
    proof, reasons = prove(*task, loops, 10.0)
    assert proof is None
    assert "more than 3 intervals" in reasons[0]
    assert "mutune.certify" in reasons[0]


@pytest.mark.parametrize("ends", [[1e-4, 0.03, 10.0], [0.5, 2.0], [10.0, 20.0, 1e9]])
def test_ends_that_are_told_are_where_to_try_first(ends: list[float]) -> None:
    """Good ones are used, others divided: the certificate is whole either way."""
    told = certify(published(1.01), ends=ends)
    assert isinstance(told, Certificate)
    assert check(told).ok


def test_the_axis_tells_where_intervals_of_a_certificate_end() -> None:
    """What was proven in doubles is proven again at the same places, or between them too."""
    axis = proven_peaks(*PUBLISHED)
    level = 1.0002 * axis.peaks.robust_performance.value
    ends = axis.ends(level)
    told = certify(published(level), ends=ends)
    assert isinstance(told, Certificate)
    assert {interval.interval.low for interval in told.intervals} >= {0.0, *ends}
    assert len(told.intervals) < len(certified(published(level)).intervals) + 3
    assert check(told).ok
    assert axis.ends(0.9) == []
