"""The limit over HTTP: what any controller could do, beside single loops."""

from __future__ import annotations

from typing import Any

import pytest

from service.analyses.limit import ANALYSIS, LimitRequest, LimitResult
from service.printing import Line
from solver.model.errors import InvalidInputError
from solver.model.plants import first_order
from solver.model.state_space import StateSpace
from solver.model.weights import Performance, Uncertainty
from solver.robustness.centralised import ModeController, analyse_centralised

REQUEST: dict[str, Any] = {
    "plant": {"kind": "first_order", "n": 2, "gain": 1, "time_constant": 10, "interaction": 0.5},
    "uncertainty": {"epsilon": 0.2, "theta": 1},
    "controller": {"kind": "PI", "arrangement": "identical"},
    "search": {"time_limit": 60},
}


@pytest.fixture(scope="module")
def answer() -> dict[str, Any]:
    """The limit of a small plant, as JSON."""
    return ANALYSIS.compute(LimitRequest.model_validate(REQUEST))


def test_values_are_in_order_and_the_verdict_quotes_them(answer: dict[str, Any]) -> None:
    """Lower bound, limit, built controller, single loops; the sentence says so."""
    result = LimitResult.model_validate(answer)
    assert result.multivariable is not None
    assert result.lower_bound.value is not None
    assert result.value is not None
    assert result.decentralised.value is not None
    assert (
        result.lower_bound.value
        < result.value
        <= result.multivariable.tau_p
        < result.decentralised.value
    )
    ratio = result.decentralised.value / result.multivariable.tau_p
    assert result.verdict.endswith(f"would be {ratio:.1f} times as fast.")
    first = ANALYSIS.table(result)[0]
    assert isinstance(first, Line)
    assert first.text == result.verdict


def test_the_controller_in_the_result_has_the_peak_beside_it(answer: dict[str, Any]) -> None:
    """Read back from JSON and analysed again, it meets the demand as claimed."""
    result = LimitResult.model_validate(answer)
    built = result.multivariable
    assert built is not None
    assert built.total is not None
    assert built.difference is not None
    parts = [StateSpace(each.A, each.B, each.C, each.D) for each in (built.total, built.difference)]
    again = analyse_centralised(
        first_order(2, 1, 10, 0.5),
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=built.tau_p),
        ModeController(*parts),
    )
    assert again.peaks is not None
    assert again.peaks.robust_performance.value == pytest.approx(
        built.peaks.robust_performance.value, rel=1e-6
    )
    assert again.peaks.robust_performance.value <= 1


def test_a_plant_without_limit_says_so_in_words() -> None:
    """No number where nothing ends the bandwidth."""
    request = {**REQUEST, "uncertainty": {"epsilon": 0.2, "theta": 0}, "search": {"time_limit": 2}}
    answer = ANALYSIS.compute(LimitRequest.model_validate(request))
    assert answer["status"] == "unlimited"
    assert answer["value"] is None
    assert "nothing in the model ends the bandwidth" in answer["verdict"]


def test_a_singular_plant_is_refused_by_name() -> None:
    """No controller holds both outputs of a plant with a = 1."""
    request = {**REQUEST, "plant": {**REQUEST["plant"], "interaction": 1}}
    with pytest.raises(InvalidInputError, match="differences is singular"):
        ANALYSIS.compute(LimitRequest.model_validate(request))
