"""The zoo's own judge of settings."""

import json

import pytest

from bench.zoo import BEST, value
from bench.zoo_cases import cases
from service.schemas.tunings import TuningRequest

RECORDED = json.loads(BEST.read_text(encoding="utf-8"))
REQUESTS = {name: request for name, _, request in cases()}
SAMPLE = sorted(RECORDED, key=lambda name: len(RECORDED[name]["loops"]))[::40]


@pytest.mark.parametrize("name", SAMPLE)
def test_the_judge_agrees_with_what_is_recorded(name: str) -> None:
    """Settings reach the time constant that is recorded for them."""
    task = TuningRequest.model_validate_json(json.dumps(REQUESTS[name])).build()
    reached = value(task, RECORDED[name]["loops"])
    assert reached == pytest.approx(RECORDED[name]["tau_p"], rel=1e-6)
