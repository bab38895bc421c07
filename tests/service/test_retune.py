"""Tuning beside known settings, with the response."""

from __future__ import annotations

from typing import Any

import pytest

from service.analyses.retune import ANALYSIS, EXAMPLE, RetuneRequest
from service.printing import Line
from service.schemas import TuningResult
from solver.model.errors import InvalidInputError
from solver.tuning.tuner import tune


def retuned(**changes: Any) -> TuningResult:
    """Return what is found for the example with some fields changed."""
    return TuningResult.model_validate(
        ANALYSIS.compute(RetuneRequest.model_validate({**EXAMPLE, **changes}))
    )


def test_a_demand_that_moves_a_little_moves_the_settings() -> None:
    """A larger error costs speed; the demand holds, and the status says local."""
    before, after = retuned(), retuned(uncertainty={"epsilon": 0.21, "theta": 1.0})
    assert before.status == after.status == "local"
    assert 18.4455 - 1e-4 < before.tau_p < 18.4455 * (1 + 5e-4)
    assert before.peaks is not None
    assert before.peaks.robust_performance.value == pytest.approx(1, abs=1e-6)
    assert before.tau_p < after.tau_p < 1.1 * before.tau_p
    assert after.demand_met
    assert isinstance(ANALYSIS.table(after)[0], Line)
    said = [part.text for part in ANALYSIS.table(after) if isinstance(part, Line)]
    assert any(text.startswith("The model may be wrong") for text in said)


def test_settings_far_from_the_demand_are_led_to_it() -> None:
    """Slow loops of three units come within a per mille of the optimum beside them, 35.4117."""
    plant = {**EXAMPLE["plant"], "n": 3}
    start = [{"gain": gain, "integral_time": 60} for gain in (4, 3, 2)]
    request = RetuneRequest.model_validate({**EXAMPLE, "plant": plant, "search": {"start": start}})
    quick = tune(request.build())
    assert quick.tau_p is not None
    assert quick.tau_p < 1.001 * 35.4117
    assert quick.settings_tolerance is None


def test_settings_to_start_from_are_needed() -> None:
    """A request without them is refused by its pointer."""
    with pytest.raises(InvalidInputError) as caught:
        RetuneRequest.model_validate({**EXAMPLE, "search": {}}).build()
    assert caught.value.field == "/search/start"
