"""Peaks of mu over all frequencies: proven, attained, and never below what a dense grid finds."""

from __future__ import annotations

import numpy as np
import pytest

from solver.certificate.record import Certificate, Claim
from solver.certificate.search import certify
from solver.certificate.verify import check
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.axis import BRACKET, proven_peaks
from solver.robustness.curves import LoopAnalysis
from solver.robustness.record import GuaranteeStatus
from solver.stability.closed_loop import is_stable
from tests.solver.robustness.unusual_loops import (
    UnusualLoop,
    best_bound,
    dense_peak,
    draw,
    draw_any,
    matrices,
    unstable_count,
)
from tests.zoo import USUAL, ZOO

COARSE = 3_000  # points of a check here; the bench takes 20,000
TAU_P = 30.0


def single(num: list[float], den: list[float], dead_time: float = 0.0) -> MatrixPlant:
    """A plant with one loop."""
    return MatrixPlant([[TransferFunction(num, den, dead_time)]])


def test_a_peak_far_beyond_the_plants_corners_is_found() -> None:
    """1/(s + 1)^2 with a gain of a million peaks where the loop does: at omega = 1000."""
    found = proven_peaks(
        single([1], [1, 2, 1]), Uncertainty.from_error(0.01, 0), Performance(tau_p=1),
        [Controller(1e6, 1)],
    )  # fmt: skip
    # There |1 + L| is 2e-3 and |T| = |S| = 1/2e-3 = 500 and more: |w_I T| + |w_P S|.
    omega = np.linspace(999.9, 1000.1, 20_001)
    s = 1j * omega
    L = 1e6 * (1 + 1 / s) / (s + 1) ** 2
    right = (0.01 * np.abs(L) + 0.5 * np.abs((s + 1) / s)) / np.abs(1 + L)
    assert found.peaks.robust_performance.value == pytest.approx(right.max(), rel=1e-6)
    assert found.peaks.robust_stability.value == pytest.approx(10, rel=1e-3)
    assert found.guarantee.status is GuaranteeStatus.PROVEN


def test_a_spike_between_the_points_of_a_grid_is_found() -> None:
    """A loop close to its limit has a spike that hides between the points of any fixed grid."""
    found = proven_peaks(
        single([1], [10, 1], 1), Uncertainty.from_error(0.0005, 0.001),
        Performance(max_peak=40, tau_p=2), [Controller(15.9, 1000)],
    )  # fmt: skip
    assert found.peaks.robust_performance.value == pytest.approx(1.18376, rel=1e-5)
    assert found.peaks.robust_performance.omega == pytest.approx(1.61983, rel=1e-5)


@pytest.mark.parametrize("damping", [1e-3, 1e-5, 1e-7])
def test_lightly_damped_poles_of_the_plant_are_found(damping: float) -> None:
    """A resonance of any sharpness: S or T peaks on its flank, and the bracket closes there."""
    plant = single([1], [1, 2 * damping, 1])
    loops = [Controller(1e-3 * damping, 10)]
    found = proven_peaks(plant, Uncertainty.from_error(0.1, 0.1), Performance(tau_p=1e5), loops)
    assert found.proven == (True, True, True)
    assert found.unstable == 0


@pytest.mark.parametrize("case", ZOO, ids=str)
def test_the_level_of_a_guarantee_can_be_certified(case) -> None:
    """What the quick enclosures prove, the certificate's exact ones prove as well."""
    performance = Performance(tau_p=TAU_P)
    found = proven_peaks(case.plant, Uncertainty.from_error(0.2, 1), performance, case.loops)
    peak, guarantee = found.peaks.robust_performance.value, found.guarantee
    assert guarantee.status is GuaranteeStatus.PROVEN
    assert guarantee.level == pytest.approx((1 + BRACKET) * peak)
    level = peak * (1 + 2 * BRACKET)
    claim = Claim(case.plant, Uncertainty.from_error(0.2, 1), performance, tuple(case.loops), level)
    certificate = certify(claim)
    assert isinstance(certificate, Certificate)
    assert check(certificate).ok


def test_too_many_different_loops_leave_the_question_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beyond the proof's reach the result says so, why, and what to do."""
    monkeypatch.setattr("solver.robustness.axis.MOST_PROVEN", 3)
    loops = [Controller(1 + 1e-3 * unit, 100) for unit in range(4)]
    plant = first_order(4, 1, 100, 0.01, 1)
    found = proven_peaks(plant, Uncertainty.from_error(0.2, 1), Performance(tau_p=TAU_P), loops)
    assert found.guarantee.status is GuaranteeStatus.OPEN
    assert found.guarantee.reason is not None
    assert "more than 3 loops differ" in found.guarantee.reason
    assert "settings that several loops share count once" in found.guarantee.reason


def test_a_proof_of_too_many_steps_is_given_up_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is said of the curve where the steps ran out."""
    monkeypatch.setattr("solver.robustness.axis.MAX_STEPS", 3)
    task = first_order(2, 1, 100, 0.949), Uncertainty.from_error(0.2, 1), Performance(tau_p=TAU_P)
    axis = proven_peaks(*task, [Controller(46.3, 101), Controller(22.8, 3.15)])
    assert axis.guarantee.status is GuaranteeStatus.OPEN
    assert axis.guarantee.reason is not None
    assert "too many steps" in axis.guarantee.reason


def test_loops_beyond_any_reach_are_refused_at_once() -> None:
    """Three hundred unlike loops end in a sentence, not in an hour; equal ones cost nothing."""
    plant = first_order(300, 1, 100, 0.001, 1)
    task = plant, Uncertainty.from_error(0.2, 1), Performance(tau_p=TAU_P)
    with pytest.raises(InvalidInputError, match="at most 100 different settings") as refused:
        analyse(*task, [Controller(1 + 1e-3 * unit, 100) for unit in range(300)])
    assert refused.value.field == "/loops"
    found = proven_peaks(*task, [Controller(1 + unit // 150, 100) for unit in range(300)])
    assert found.guarantee.status is GuaranteeStatus.PROVEN


def test_many_unstable_poles_are_counted_exactly() -> None:
    """A high gain with dead time: as many as an independent winding count finds."""
    drawn = draw(np.random.default_rng(58))
    counted = unstable_count(drawn, 20_000)
    result = analyse(drawn.plant, drawn.uncertainty, drawn.performance, drawn.loops)
    assert result.unstable_poles == counted
    assert counted is not None
    assert counted > 60


def test_a_flat_curve_towards_zero_is_proven_there() -> None:
    """Where mu is highest at omega = 0 the proof reaches 0 too, units of the outputs far apart."""
    drawn = draw(np.random.default_rng(324))
    found = proven_peaks(drawn.plant, drawn.uncertainty, drawn.performance, drawn.loops)
    assert found.proven == (True, True, True)


def _check(drawn: UnusualLoop) -> None:
    """Hold peak and stability against a dense grid and an independent winding count."""
    stable = is_stable(drawn.plant, drawn.loops)
    counted = unstable_count(drawn, COARSE)
    if counted is not None:
        assert stable == (counted == 0)
    if not stable:
        return
    found = proven_peaks(drawn.plant, drawn.uncertainty, drawn.performance, drawn.loops)
    assert found.unstable in {0, None}
    peak = found.peaks.robust_performance.value
    assert dense_peak(drawn, peak, COARSE) <= peak * (1 + 1e-6)


@pytest.mark.parametrize("seed", range(100))
def test_unusual_loops(seed: int) -> None:
    """No dense grid finds a higher peak, and an independent winding count the same stability."""
    _check(draw(np.random.default_rng(seed)))


@pytest.mark.parametrize("seed", range(60))
def test_unusual_loops_of_every_kind(seed: int) -> None:
    """P, PD, PID, free filters, full uncertainty, permitted offsets: the same holds."""
    _check(draw_any(np.random.default_rng(seed)))


def test_proportional_control_is_proven_down_to_zero() -> None:
    """A permitted offset keeps mu finite at steady state, where the proof must reach."""
    plant, loops = first_order(2, 1, 100, 0.5, 1), [Controller(20, None), Controller(10, None, 1)]
    performance = Performance(tau_p=20, offset=0.2)
    found = proven_peaks(plant, Uncertainty.from_error(0.2, 1), performance, loops)
    assert found.guarantee.status is GuaranteeStatus.PROVEN
    assert found.unstable == 0
    level = found.guarantee.level
    claim = Claim(plant, Uncertainty.from_error(0.2, 1), performance, tuple(loops), level)
    certificate = certify(claim)
    assert isinstance(certificate, Certificate)
    assert check(certificate).ok


def test_proportional_control_of_integrating_loops_needs_no_offset() -> None:
    """An integrating plant leaves no offset of a set point: the demand can be bounded."""
    plant = ParallelPlant(1, TransferFunction([1], [10, 1, 0]), TransferFunction([0], [1]))
    performance = Performance(tau_p=100)
    found = proven_peaks(
        plant, Uncertainty.from_error(0.2, 1), performance, [Controller(0.05, None)]
    )
    assert found.peaks.robust_performance.value < 10


LEVEL, SHARED = (TransferFunction([gain], [1.0, 0.0], 0.1) for gain in (1.0, 0.2))
HEATED = MatrixPlant(
    [
        [LEVEL, TransferFunction([0.3], [5.0, 1.0])],
        [TransferFunction([0.2], [3.0, 1.0]), TransferFunction([1.0], [10.0, 1.0], 0.2)],
    ]
)


@pytest.mark.parametrize(
    ("plant", "loops", "offset"),
    [
        (first_order(2, 1, 100, 0.949), [Controller(5, 50), Controller(8.5, None)], 0.5),
        (
            first_order(4, 1, 100, 0.3),
            [Controller(5 + k, (50, None)[k % 2]) for k in range(4)],
            0.5,
        ),
        (HEATED, [Controller(0.5, 50), Controller(0.2, None)], 0.1),
        (HEATED, [Controller(0.5, None), Controller(0.2, 5)], 0.0),
        (ParallelPlant(2, LEVEL, SHARED), [Controller(0.5, None), Controller(0.2, None)], 0.0),
        (ParallelPlant(2, LEVEL, SHARED), [Controller(0.5, 50), Controller(0.2, None)], 0.0),
    ],
)
def test_loops_with_and_without_integral_action_are_proven_side_by_side(
    plant: Plant, loops: list[Controller], offset: float
) -> None:
    """Down to zero, whatever integrates there: the controller, the plant, or neither."""
    uncertainty = Uncertainty.from_error(0.2, 1)
    performance = Performance(tau_p=40, offset=offset)
    axis = proven_peaks(plant, uncertainty, performance, loops)
    assert axis.guarantee.status is GuaranteeStatus.PROVEN
    assert axis.unstable == 0
    drawn = UnusualLoop(plant, uncertainty, performance, tuple(loops))
    level = axis.guarantee.level
    assert dense_peak(drawn, 0.999 * level, points=500) <= level * (1 + 1e-9)
    low = np.geomspace(1e-6, 1e-2, 9)
    assert all(best_bound(N) <= level * (1 + 1e-6) for N in matrices(drawn, low))


@pytest.mark.parametrize(
    "loops", [[Controller(20, None)] * 2, [Controller(20, 50), Controller(9, None, 1)]]
)
def test_an_offset_that_is_not_permitted_is_refused(loops: list[Controller]) -> None:
    """Without integral action mu grows without bound towards zero: no number stands for that."""
    plant = first_order(2, 1, 100, 0.5, 1)
    with pytest.raises(InvalidInputError, match="no offset is permitted") as error:
        proven_peaks(plant, Uncertainty.from_error(0.2, 1), Performance(tau_p=20), loops)
    assert error.value.field == "/performance/offset"


@pytest.mark.parametrize("gain", [0.02, 0.1, 1 / 6, 0.3, 0.9])
def test_a_gain_behind_dead_time_alone(gain: float) -> None:
    """At infinity the phase takes every value: the supremum is (2 k + 1/2)/(1 - k), proven."""
    plant = ParallelPlant(1, TransferFunction([1], [1], 5), TransferFunction([0], [1]))
    found = proven_peaks(
        plant, Uncertainty.from_error(0.2, 1), Performance(tau_p=1e5), [Controller(gain, 100)]
    )
    exact = (2 * gain + 0.5) / (1 - gain)
    assert found.peaks.robust_performance.value == pytest.approx(exact, rel=2e-6)
    assert found.guarantee.status is GuaranteeStatus.PROVEN
    assert found.guarantee.level >= exact


def test_many_phases_at_infinity_are_told() -> None:
    """Two loops with dead time fed through: proven, or the reason and a bound are told."""
    element = TransferFunction([2, 1], [10, 1], 5)
    other = TransferFunction([0.4, 0.1], [8, 1], 3)
    plant = MatrixPlant([[element, other], [other, element]])
    task = (plant, Uncertainty.from_error(0.2, 1), Performance(tau_p=300))
    alike = proven_peaks(*task, [Controller(1, 20)] * 2)
    # L at infinity has elements of 0.2 and 0.05 at most, the row sum 1/4: (2/4 + 1/2)/(1 - 1/4).
    assert alike.guarantee.status is GuaranteeStatus.PROVEN
    assert alike.peaks.robust_performance.value <= 4 / 3 <= alike.guarantee.level
    unlike = proven_peaks(*task, [Controller(2, 20), Controller(2.2, 20)])
    assert unlike.guarantee.status is GuaranteeStatus.OPEN
    said = str(unlike.guarantee.reason)
    assert "has any phase" in said
    # The bound is hardly above what was found.
    bound, peak = float(said.rpartition(" ")[2]), unlike.peaks.robust_performance.value
    assert peak < bound < peak * (1 + 1e-3)


def test_the_worst_phase_far_out_is_met_though_few_digits_tell_it() -> None:
    """A dead time of thousands of corner periods feeds through: the supremum is at infinity."""
    drawn = draw_any(np.random.default_rng(21781))
    found = proven_peaks(drawn.plant, drawn.uncertainty, drawn.performance, drawn.loops)
    gain = np.abs(drawn.plant.element(0, 0).num[0] / drawn.plant.element(0, 0).den[0])
    loop = drawn.loops[0]
    assert loop.derivative_time is not None
    assert loop.filter_time is not None
    gain *= loop.gain * loop.derivative_time / loop.filter_time
    w_I = drawn.uncertainty.weight.num[0] / drawn.uncertainty.weight.den[0]
    supremum = (w_I * gain + 1 / drawn.performance.max_peak) / (1 - gain)
    assert found.peaks.robust_performance.value == pytest.approx(supremum, rel=1e-6)


def test_no_peak_is_made_of_rounding_where_integrators_cancel() -> None:
    """Four integrators that differ in dead time alone: towards zero their difference is lost."""
    integrators = [
        [TransferFunction([1], [1, 0], dead_time) for dead_time in row] for row in ((1, 2), (3, 1))
    ]
    plant, loops = MatrixPlant(integrators), [Controller(0.1, 10)] * 2
    performance = Performance(tau_p=20)
    found = analyse(plant, Uncertainty.from_error(0.1, 0.5), performance, loops)
    assert found.peaks is not None
    assert found.guarantee is not None
    assert found.guarantee.status is GuaranteeStatus.OPEN
    # The weak direction: gain 3/2, so |w_P S| -> (1/(2 tau_P s)) s/(0.01 * 1.5) = 1/0.6.
    assert found.peaks.nominal_performance.value == pytest.approx(1 / 0.6, rel=1e-3)
    assert 1 / 0.6 < found.peaks.robust_performance.value < 3


def test_the_highest_of_many_maxima_nearly_alike_is_refined() -> None:
    """A long dead time in the interaction turns often: the samples show another maximum higher."""
    process, late = (TransferFunction((a,), (1000, 1), delay) for a, delay in ((1, 0), (0.5, 100)))
    plant = ParallelPlant(2, process, late)
    loops = [Controller(436.37877725, 1243.9178658), Controller(251.27992095, 923.7943903)]
    performance = Performance(tau_p=4.12761)
    found = proven_peaks(plant, USUAL, performance, loops).peaks.robust_performance
    blocks, controllers = group_loops(plant, loops)
    dense = LoopAnalysis(blocks, controllers, USUAL, performance).robust_performance(
        np.linspace(0.4582, 0.4585, 301)
    )
    assert found.value == pytest.approx(dense.max(), rel=1e-8)
