import numpy as np
import pytest
from zoo import COLUMN, SLH, USUAL, ZOO

from solver.certificate.verify import Verdict, check
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.curves import LoopAnalysis

PUBLISHED = (Controller(46.3, 101), Controller(22.8, 3.15))


def test_published_independent_settings():
    """SLH, section 5.3, tau_P = 19: peak 1.00034840 at 0.0314362 (two independent programs)."""
    peak = analyse(SLH, USUAL, Performance(tau_p=19), PUBLISHED).peaks.robust_performance
    assert peak.value == pytest.approx(1.0003484015698523, rel=1e-9)
    assert peak.omega == pytest.approx(0.031436181846091336, rel=1e-4)


@pytest.mark.parametrize(
    ("omega", "mu"),
    [
        (0.001, 0.9977505605324618),
        (0.01, 0.9954792239084027),
        (0.1, 0.956768291607426),
        (1.0, 0.9875772745035227),
        (10.0, 0.6350421969022855),
    ],
)
def test_published_settings_between_the_peaks(omega, mu):
    """mu of the published settings at single frequencies, by SLICOT."""
    curves = analyse(SLH, USUAL, Performance(tau_p=19), PUBLISHED, [omega]).curves
    assert curves.robust_performance == pytest.approx([mu], rel=1e-9)


def test_published_column_settings():
    """SLH eqs. 4-5 with the gains 179 and 47: 1.34 as published (1.34291 exactly)."""
    loops = (Controller(179, 28.9, 0.31), Controller(47, 1.38, 0.27))
    peak = analyse(COLUMN, USUAL, Performance(tau_p=10), loops).peaks.robust_performance
    assert peak.value == pytest.approx(1.342911, abs=1e-6)


def test_unstable_loops_have_no_peaks():
    """mu of an unstable loop means nothing: a status, no numbers."""
    result = analyse(
        first_order(2, 1, 10, 1.5), USUAL, Performance(tau_p=20), [Controller(3, 8)] * 2
    )
    assert not result.nominally_stable
    assert result.unstable_poles == 1
    assert result.peaks is None
    assert result.curves is None
    assert result.warnings


@pytest.mark.parametrize("case", ZOO, ids=str)
def test_peaks_hold_on_a_grid_twenty_times_finer(case):
    """No point of a much finer grid exceeds the reported peak by more than 1e-6."""
    blocks, controllers = group_loops(case.plant, case.loops, case.uncertainty)
    analysis = LoopAnalysis(blocks, controllers, case.uncertainty, case.performance)
    result = analyse(case.plant, case.uncertainty, case.performance, case.loops)
    fine = np.geomspace(analysis.omega[0], analysis.omega[-1], 20 * analysis.omega.size)
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        peak = getattr(result.peaks, name)
        assert getattr(analysis, name)(fine).max() <= peak.value * (1 + 1e-6)


def test_another_time_unit_changes_nothing_but_the_unit():
    """Minutes to seconds: the same mu at frequencies divided by 60."""
    minutes = analyse(SLH, USUAL, Performance(tau_p=19), PUBLISHED).peaks
    seconds = analyse(
        first_order(2, 1, 6000, 0.949),
        Uncertainty.from_error(0.2, 60),
        Performance(tau_p=19 * 60),
        [Controller(loop.gain, 60 * loop.integral_time) for loop in PUBLISHED],
    ).peaks
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        a, b = getattr(minutes, name), getattr(seconds, name)
        assert a.value == pytest.approx(b.value, rel=1e-9)
        assert a.omega == pytest.approx(60 * b.omega, rel=1e-2)


def test_narrow_resonances_are_resolved():
    """A plant mode with damping 1e-4 is seen: its peak is that of the response itself."""
    plant = ParallelPlant(1, TransferFunction([1], [1, 2e-4, 1]), TransferFunction([0], [1]))
    loops = [Controller(1e-5, 0.5)]
    result = analyse(plant, USUAL, Performance(tau_p=1e6), loops)
    omega = np.geomspace(0.99, 1.01, 20001)
    blocks, controllers = group_loops(plant, loops)
    analysis = LoopAnalysis(blocks, controllers, USUAL, Performance(tau_p=1e6))
    assert result.peaks.robust_performance.value >= analysis.robust_performance(omega).max() * (
        1 - 1e-9
    )


@pytest.mark.parametrize(
    ("omega", "where"),
    [([], "/omega"), ([1, 0.0], "/omega/1"), ([-1.0], "/omega/0"), ([[1.0]], "/omega"),
     ([np.nan], "/omega/0"), ([np.inf], "/omega/0"), ("1", "/omega"), ([1j], "/omega")],
)  # fmt: skip
def test_frequencies_must_be_positive_and_finite(omega, where):
    """Bad frequencies are refused by name."""
    with pytest.raises(InvalidInputError) as error:
        analyse(SLH, USUAL, Performance(tau_p=19), PUBLISHED, omega)
    assert error.value.field == where


def test_curves_come_in_the_order_of_the_frequencies():
    """Values can be laid beside the caller's own, unsorted and repeated ones too."""
    omega = [1.0, 0.01, 0.1, 0.01]
    curves = analyse(SLH, USUAL, Performance(tau_p=19), PUBLISHED, omega).curves
    assert curves.omega.tolist() == omega
    for at, value in zip(omega, curves.robust_performance, strict=True):
        (alone,) = analyse(
            SLH, USUAL, Performance(tau_p=19), PUBLISHED, at
        ).curves.robust_performance
        assert alone == pytest.approx(value, rel=1e-12)


def test_a_time_constant_and_one_loop_a_unit_are_needed():
    """What is missing is named."""
    with pytest.raises(InvalidInputError) as error:
        analyse(SLH, USUAL, Performance(), PUBLISHED)
    assert error.value.field == "/performance/tau_p"
    with pytest.raises(InvalidInputError) as error:
        analyse(SLH, USUAL, Performance(tau_p=1), PUBLISHED[:1])
    assert error.value.field == "/loops"


@pytest.mark.parametrize("case", ZOO, ids=str)
def test_every_peak_has_a_worst_case_and_a_proof(case):
    """The lower bound meets the peak, and a level 0.02 % above it is proven for all frequencies."""
    result = analyse(case.plant, case.uncertainty, case.performance, case.loops, certificate=True)
    peak = result.peaks.robust_performance.value
    assert result.lower_bound.value == pytest.approx(peak, rel=1e-6)
    assert result.certificate.claim.gamma == pytest.approx(peak, rel=3e-4)
    assert check(result.certificate).verdict is Verdict.PROVEN


@pytest.mark.parametrize("a", [0.99, 0.9999, 0.999999])
def test_the_limit_at_low_frequency_of_a_weak_direction_is_reached(a):
    """Identical loops near a = 1: mu(0) is epsilon + tau_I/(M tau_P k (1 - a)), SLH eq. 31."""
    loops = (Controller(20, 60),) * 2
    demand = Performance(tau_p=100)
    found = analyse(first_order(2, 1, 100, a), Uncertainty.from_error(0.2, 1), demand, loops)
    limit = 0.2 + 60 / (2 * 100 * 20 * (1 - a))
    assert found.peaks.robust_performance.value == pytest.approx(limit, rel=3e-8)


@pytest.mark.parametrize(("error", "warned"), [(20.0, 1), (1.0, 1), (0.99, 0)])
def test_an_error_of_all_that_an_input_is_is_doubted(error, warned):
    """20 is 2000 %, where 20 % may be meant: said once, with the way to write it."""
    found = analyse(
        first_order(2, 1.0, 10.0, 0.3), Uncertainty.from_error(error, 1.0), Performance(tau_p=10),
        (Controller(0.5, 10),) * 2,
    )  # fmt: skip
    told = [warning for warning in found.warnings if f"{100 * error:.4g} % at steady" in warning]
    assert len(told) == warned
