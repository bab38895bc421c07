"""What a demand costs: the same tuning over a range of one parameter."""

from __future__ import annotations

import json
from typing import Any

import pytest
from samples import altered, tuning

from service.batch.sweep import Variation
from service.figures import trade_off
from service.schemas import RequestError, TuningRequest, parse_tuning_request
from service.schemas.trade_off import TradeOff
from service.trade_off import Collected, sweep
from service.tuned import RequestedTuning
from solver.model.errors import InvalidInputError
from solver.tuning.tuner import tune

REQUEST = tuning(seed=1, starts=4)


def parsed(request: dict[str, Any]) -> TuningRequest:
    """Return the request, checked."""
    return parse_tuning_request(json.dumps(request))


def test_each_point_is_the_tuning_at_its_value() -> None:
    """In ascending order, whatever the order asked for, with the best identical settings beside."""
    found = sweep(parsed(REQUEST), "uncertainty.epsilon", [0.3, 0.1])
    assert [point.value for point in found.points] == [0.1, 0.3]
    for point in found.points:
        request = parsed(altered(REQUEST, "/uncertainty/epsilon", point.value))
        result = RequestedTuning.of(request, tune(request.build())).result
        assert point.tau_p == result.tau_p
        assert result.comparison is not None
        assert point.identical == result.comparison.identical_value


def test_infeasible_values_are_gaps_and_progress_is_told() -> None:
    """A permitted peak near 1 cannot be met: no time constant, a gap in the figure."""
    told: list[float] = []
    request = parsed(altered(REQUEST, "/uncertainty/epsilon", 0.5))
    found = sweep(
        request,
        "performance.max_peak",
        [1.0001, 3.0],
        lambda progress: told.append(progress.fraction),
    )
    assert found.parameter == "performance.max_peak"
    assert found.points[0].tau_p is None
    assert found.points[1].tau_p is not None
    assert told
    figure = trade_off(TradeOff.model_validate(found.model_dump()), unit="min")
    assert figure.data[0]["y"][0] is None


def test_values_that_no_request_can_have_are_refused() -> None:
    """By schema or by the solver: never a point."""
    with pytest.raises((RequestError, InvalidInputError), match="epsilon"):
        sweep(parsed(REQUEST), "uncertainty.epsilon", [-0.1])


def test_a_second_field_gives_curves() -> None:
    """The field of most numbers is the axis; each value of the other one is a curve."""
    collected = Collected(
        [
            Variation("controller.arrangement", ("identical", "independent")),
            Variation("uncertainty.epsilon", (0.2, 0.1)),
        ]
    )
    for arrangement, tau_p in (("identical", 30.0), ("independent", 20.0)):
        for epsilon in (0.2, 0.1):
            fields = {
                "controller": {"arrangement": arrangement},
                "uncertainty": {"epsilon": epsilon},
            }
            collected.add(fields, {"tau_p": tau_p * epsilon} if epsilon < 0.2 else None)
    found = collected.trade_off()
    assert (found.parameter, found.by) == ("uncertainty.epsilon", "controller.arrangement")
    drawn = trade_off(found)
    assert [(curve["name"], list(curve["x"]), list(curve["y"])) for curve in drawn.data] == [
        ("controller.arrangement = identical", [0.1, 0.2], [3.0, None]),
        ("controller.arrangement = independent", [0.1, 0.2], [2.0, None]),
    ]


@pytest.mark.parametrize("names", [["a", "b"], ["a"], ["x", "y", "z"]])
def test_what_no_figure_shows_is_refused(names: list[str]) -> None:
    """Words alone have no axis, and three fields are one too many."""
    values = {"a": ("p", "q"), "b": ("r",)}
    with pytest.raises(RequestError, match="one field of numbers"):
        Collected([Variation(name, values.get(name, (1.0, 2.0))) for name in names])
