"""Tuning beside known settings, with the response."""

from __future__ import annotations

from typing import Any

import pytest

from service.analyses.retune import ANALYSIS, EXAMPLE, RetuneRequest
from service.printing import Line
from service.schemas import TuningResult
from solver.model.errors import InvalidInputError


def retuned(**changes: Any) -> TuningResult:
    """Return what is found for the example with some fields changed."""
    return TuningResult.model_validate(
        ANALYSIS.compute(RetuneRequest.model_validate({**EXAMPLE, **changes}))
    )


def test_a_demand_that_moves_a_little_moves_the_settings() -> None:
    """A larger error costs speed; the demand holds, and the status says local."""
    before, after = retuned(), retuned(uncertainty={"epsilon": 0.21, "theta": 1.0})
    assert before.status == after.status == "local"
    assert before.tau_p == pytest.approx(18.4455, abs=1e-3)
    assert before.tau_p < after.tau_p < 1.1 * before.tau_p
    assert after.demand_met
    assert isinstance(ANALYSIS.table(after)[0], Line)
    said = [part.text for part in ANALYSIS.table(after) if isinstance(part, Line)]
    assert any(text.startswith("The model may be wrong") for text in said)


def test_settings_to_start_from_are_needed() -> None:
    """A request without them is refused by its pointer."""
    with pytest.raises(InvalidInputError) as caught:
        RetuneRequest.model_validate({**EXAMPLE, "search": {}}).build()
    assert caught.value.field == "/search/start"
