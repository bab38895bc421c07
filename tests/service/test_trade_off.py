"""What a demand costs: the same tuning over a range of one parameter."""

from __future__ import annotations

import json
from typing import Any

import pytest
from samples import altered, tuning

from service.figures import trade_off
from service.schemas import RequestError, TuningRequest, parse_tuning_request
from service.schemas.trade_off import TradeOff
from service.trade_off import sweep
from service.tuned import Tuned
from solver.model.errors import InvalidInputError
from solver.tuning.tuner import tune

REQUEST = tuning(seed=1, starts=4)


def parsed(request: dict[str, Any]) -> TuningRequest:
    """Return the request, checked."""
    return parse_tuning_request(json.dumps(request))


def test_each_point_is_the_tuning_at_its_value() -> None:
    """In ascending order, whatever the order asked for, with the best identical settings beside."""
    found = sweep(parsed(REQUEST), "epsilon", [0.3, 0.1])
    assert [point.value for point in found.points] == [0.1, 0.3]
    for point in found.points:
        request = parsed(altered(REQUEST, "/uncertainty/epsilon", point.value))
        result = Tuned.of(request, tune(request.build())).result
        assert point.tau_p == result.tau_p
        assert result.comparison is not None
        assert point.identical == result.comparison.identical_value


def test_infeasible_values_are_gaps_and_progress_is_told() -> None:
    """A permitted peak near 1 cannot be met: no time constant, a gap in the figure."""
    told: list[float] = []
    request = parsed(altered(REQUEST, "/uncertainty/epsilon", 0.5))
    found = sweep(
        request, "max_peak", [1.0001, 3.0], lambda progress: told.append(progress.fraction)
    )
    assert found.parameter == "max_peak"
    assert found.points[0].tau_p is None
    assert found.points[1].tau_p is not None
    assert told
    figure = trade_off(TradeOff.model_validate(found.model_dump()), unit="min")
    assert figure.data[0]["y"][0] is None


def test_values_that_no_request_can_have_are_refused() -> None:
    """By schema or by the solver: never a point."""
    with pytest.raises((RequestError, InvalidInputError), match="epsilon"):
        sweep(parsed(REQUEST), "epsilon", [-0.1])
