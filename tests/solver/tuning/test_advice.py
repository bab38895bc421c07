"""Sentences on how a result may be used, and that they are true."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.tuning.advice import advice, weights_factor
from solver.tuning.specification import Objective, Specification

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
PERFORMANCE = Performance(max_peak=2, offset=0, tau_p=26)
PLANT = first_order(2, 1.0, 100.0, 0.949)
UNLIKE = (Controller(47.65, 101.2), Controller(20.0, 3.0))


def _factor(text: str) -> float:
    found = re.search(r"to ([0-9.e+-]+) times", text)
    assert found is not None
    return float(found[1])


def test_either_unit_may_take_either_setting() -> None:
    """Identical units with unlike settings: interchanged, the peak is the same, and it is said."""
    specification = Specification(PLANT, UNCERTAINTY, PERFORMANCE, objective=Objective.MU)
    sentence, *_ = advice(specification, PERFORMANCE, UNLIKE, 1.0)
    assert "either unit may take any" in sentence
    peaks = [
        analyse(PLANT, UNCERTAINTY, PERFORMANCE, loops).peaks for loops in (UNLIKE, UNLIKE[::-1])
    ]
    assert peaks[0] is not None
    assert peaks[1] is not None
    assert peaks[0].robust_performance.value == pytest.approx(peaks[1].robust_performance.value)


def test_nothing_is_interchanged_that_may_not_be() -> None:
    """Alike settings, unlike units and unlike outputs: no such sentence."""
    specification = Specification(PLANT, UNCERTAINTY, PERFORMANCE, objective=Objective.MU)
    assert "interchanged" not in " ".join(advice(specification, PERFORMANCE, UNLIKE[:1] * 2, 1.0))
    lag = TransferFunction([1], [10, 1])
    matrix = MatrixPlant([[lag, TransferFunction([0.3], [10, 1])], [lag, lag]])
    other = Specification(matrix, UNCERTAINTY, PERFORMANCE, objective=Objective.MU)
    assert "interchanged" not in " ".join(advice(other, PERFORMANCE, UNLIKE, 1.0))
    scaled = replace(PERFORMANCE, output_scale=(1.0, 2.0))
    unlike = Specification(PLANT, UNCERTAINTY, scaled, objective=Objective.MU)
    assert "interchanged" not in " ".join(advice(unlike, scaled, UNLIKE, 1.0))


def test_the_bandwidth_is_that_of_the_weight() -> None:
    """SLH eq. 29: omega_B = 1/(M tau_P) is where the weight's asymptote crosses 1."""
    specification = Specification(PLANT, UNCERTAINTY, PERFORMANCE, objective=Objective.MU)
    sentence = advice(specification, PERFORMANCE, UNLIKE, 1.0)[1]
    assert f"{1 / 52:.4g} rad" in sentence
    weight = PERFORMANCE.weight
    low = 1e-6
    asymptote = abs(weight.response([low])[0]) * low
    assert asymptote == pytest.approx(1 / 52, rel=1e-6)


@pytest.mark.parametrize("tau_p", [60.0, 10.0])
def test_both_weights_times_the_factor_make_mu_one(tau_p: float) -> None:
    """SLH, section 5: mu = 0.7 lets both weights grow by 1/0.7; mu above 1 makes them shrink."""
    performance = Performance(max_peak=2, offset=0, tau_p=tau_p)
    loops = (Controller(30.0, 60.0),) * 2
    peaks = analyse(PLANT, UNCERTAINTY, performance, loops).peaks
    assert peaks is not None
    peak = peaks.robust_performance.value
    text = weights_factor(peak)
    factor = _factor(text)
    assert ("may grow" in text) == (peak <= 1)
    # c w_P is the weight of M/c, with tau_P as it was and no offset.
    error = replace(UNCERTAINTY, weight=_scaled(UNCERTAINTY.weight, factor))
    scaled = Performance(max_peak=2 / factor, offset=0, tau_p=tau_p)
    again = analyse(PLANT, error, scaled, loops).peaks
    assert again is not None
    assert again.robust_performance.value == pytest.approx(1, abs=1e-3)


def _scaled(weight: TransferFunction, factor: float) -> TransferFunction:
    return TransferFunction([factor * each for each in weight.num], weight.den)


def test_the_relative_gain_is_judged_at_the_bandwidth() -> None:
    """Large at rest and there; large at rest only; small: nothing is said."""
    constant = Specification(PLANT, UNCERTAINTY, PERFORMANCE, objective=Objective.MU)
    text = " ".join(advice(constant, PERFORMANCE, UNLIKE, 1.0))
    assert "relative gain is 10.1 (at rest 10.1), large" in text
    slow = MatrixPlant(
        [
            [TransferFunction([1], [10, 1]), TransferFunction([0.97], [1000, 1])],
            [TransferFunction([0.97], [1000, 1]), TransferFunction([1], [10, 1])],
        ]
    )
    fading = Specification(slow, UNCERTAINTY, PERFORMANCE, objective=Objective.MU)
    assert "moderate: what is difficult at rest" in " ".join(
        advice(fading, PERFORMANCE, UNLIKE, 1.0)
    )
    weak = Specification(
        first_order(3, 1.0, 100.0, 0.2), UNCERTAINTY, PERFORMANCE, objective=Objective.MU
    )
    assert "relative gain" not in " ".join(advice(weak, PERFORMANCE, UNLIKE[:1] * 3, 1.0))
