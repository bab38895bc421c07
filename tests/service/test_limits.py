"""The limit over HTTP: what any controller could do, beside single loops."""

from __future__ import annotations

import json
from typing import Any

import pytest

from service.analyses.limit import ANALYSIS, LimitRequest, LimitResult
from service.analyses.robustness import ANALYSIS as ROBUSTNESS
from service.analyses.robustness import RobustnessRequest
from service.beyond import alternatives_to_json, comparison_table, with_limit
from service.printing import Grid, Line, in_unit
from service.schemas.alternatives import Alternatives
from service.schemas.tunings import TuningRequest
from service.wording import number
from solver.limits.comparison import ControllerComparison, Entry, Family
from solver.limits.lower_bound import Limitation, LowerBound
from solver.limits.manual import OneInManual
from solver.limits.record import Limit, LimitStatus
from solver.model.errors import InvalidInputError
from solver.model.mode_controller import ModeController
from solver.model.plants import first_order
from solver.model.state_space import StateSpace
from solver.model.weights import Performance, Uncertainty
from solver.robustness.centralised import analyse_centralised

EXAMPLE: dict[str, Any] = LimitRequest.model_json_schema()["examples"][0]
REQUEST: dict[str, Any] = {**EXAMPLE, "search": {"time_limit": 900}}


@pytest.fixture(scope="module")
def answer() -> dict[str, Any]:
    """The limit of a small plant, the example of the documentation, as JSON."""
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
    families = {each.family: each for each in result.alternatives}
    best = min(
        value
        for name in ("identical_pi", "unlike_pi", "unlike_pid", "unlike_pidf")
        if (value := families[name].value) is not None
    )
    ratio = best / result.multivariable.tau_p
    (title,) = (each.title for each in result.alternatives if each.ratio == 1)
    assert f", {ratio:.1f} times as fast as {title}." in result.verdict
    assert f"of any order reaches {number(result.value, 3)}" in result.verdict
    assert f"({result.multivariable.states} states)" in result.verdict
    assert families["identical_pi"].value == pytest.approx(result.decentralised.value, rel=1e-6)
    assert families["multivariable"].value == result.multivariable.tau_p
    for each in result.alternatives:
        assert each.value is not None
        assert each.ratio == pytest.approx(each.value / best)
        assert number(each.value, 3) in result.verdict
        assert each.manual is not None
        assert each.manual.stable
    parts = ANALYSIS.table(result)
    assert isinstance(parts[0], Line)
    assert parts[0].text == result.verdict.splitlines()[0]
    grid = next(part for part in in_unit(parts, "min") if isinstance(part, Grid))
    assert list(grid.heads) == ["", "τP, min", f"over {title}", "μ, one in manual"]
    rows = {row[0]: row[1:] for row in grid.rows}
    for each in result.alternatives:
        assert each.value is not None
        assert each.manual is not None
        value, ratio, manual = rows[each.title]
        assert (value, ratio) == (number(each.value), number(each.value / best, 3))
        assert manual == number(each.manual.peak, 3)
    assert rows["any controller"][0] == number(result.value)
    assert rows["none below, proven"][0] == number(result.lower_bound.value)


def test_the_example_of_the_documentation_is_printed_and_drawn(answer: dict[str, Any]) -> None:
    """Its result is JSON without NaN, matches its model, and people can read it."""
    text = json.dumps(answer, allow_nan=False)
    assert ANALYSIS.table(LimitResult.model_validate_json(text))
    assert ANALYSIS.figures is not None
    drawn = ANALYSIS.figures.drawn.model_validate_json(text)
    assert ANALYSIS.figures.draw(drawn, "min")["figures"]


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
    request = {
        **REQUEST,
        "uncertainty": {"epsilon": 0.2, "theta": 0},
        "search": {"time_limit": 1e-3},
    }
    answer = ANALYSIS.compute(LimitRequest.model_validate(request))
    assert answer["status"] == "unlimited"
    assert answer["value"] is None
    assert "nothing in the model ends the bandwidth" in answer["verdict"]


def test_a_singular_plant_is_refused_by_name() -> None:
    """No controller holds both outputs of a plant with a = 1."""
    request = {**REQUEST, "plant": {**REQUEST["plant"], "interaction": 1}}
    with pytest.raises(InvalidInputError, match="differences is singular"):
        ANALYSIS.compute(LimitRequest.model_validate(request))


@pytest.mark.parametrize("family", ["static_decoupling", "one_way_decoupling", "mode_control"])
def test_a_structure_in_the_result_is_a_request_of_robustness(
    answer: dict[str, Any], family: str
) -> None:
    """Its controller, sent as it stands, meets the demand at the tau_p that is stated."""
    (found,) = (each for each in answer["alternatives"] if each["family"] == family)
    request = {
        "plant": REQUEST["plant"],
        "uncertainty": REQUEST["uncertainty"],
        "performance": {"tau_p": found["value"]},
        "controller": found["controller"],
    }
    result = ROBUSTNESS.compute(RobustnessRequest.model_validate_json(json.dumps(request)))
    peak = result["peaks"]["robust_performance"]["value"]
    assert 0.999 < peak <= 1 + 1e-6


def test_a_comparison_keeps_its_time_limit_as_a_whole() -> None:
    """Not even the loops of the request have more: the lower bound is there, and a sentence."""
    answer = LimitResult.model_validate(
        ANALYSIS.compute(LimitRequest.model_validate({**REQUEST, "search": {"time_limit": 1e-3}}))
    )
    assert answer.status == "time_limit"
    assert answer.value is None
    assert answer.lower_bound.value is not None
    assert "No time was left" in answer.verdict


def _beside(**search: Any) -> dict[str, Any]:
    request = TuningRequest.model_validate({**REQUEST, "search": search})
    return with_limit(request, {"search": {"elapsed_seconds": 0.5}})


def test_kinds_without_a_value_say_why() -> None:
    """None found and out of time are not the same; a loop that runs away in manual is named."""
    bound = LowerBound(0.5, 1j, Limitation.UNCERTAINTY)
    entries = (
        Entry(Family.UNLIKE_PI, 8.0, manual=OneInManual(0, stable=False, peak=None)),
        Entry(Family.UNLIKE_PID, None, exhausted=True),
        Entry(Family.STATIC_DECOUPLING, None),
        Entry(Family.MODE_CONTROL, None, exhausted=True),
    )
    limit = Limit(LimitStatus.TIME_LIMIT, "tau_p", 4.0, bound)
    document = alternatives_to_json(ControllerComparison(entries, limit))
    found = Alternatives.model_validate(document)
    heads, rows = comparison_table(found.alternatives, "tau_p", found.limit, 0.5)
    assert heads == ("", "τP", "over unlike PI", "μ, one in manual")
    assert rows == [
        ("unlike PI", "8", "1", "unstable"),
        ("PID", "out of time", "", ""),
        ("static decoupling", "none found", "", ""),
        ("mode control", "out of time", "", ""),
        ("any controller", "4", "0.5", ""),
        ("none below, proven", "0.5", "0.0625", ""),
    ]
    first, *others = found.verdict.splitlines()
    assert first.startswith("Single loops reach τP = 8 (unlike PI); a multivariable controller")
    assert first.endswith("could reach 4 (none was built), 2.0 times as fast as unlike PI.")
    assert others == [
        "None found within the time: static decoupling, mode control.",
        "The best found of any order reaches 4; nothing linear can go below 0.5.",
    ]


def test_a_tuning_has_a_limit_only_where_it_was_asked_for() -> None:
    """Without `search.limit` the result is left as it was."""
    assert "limit" not in _beside(time_limit=10)


def test_a_limit_for_which_no_time_is_left_says_so() -> None:
    """The search took all of the time: no limit, the lower bound all the same, and a sentence."""
    found = Alternatives.model_validate(_beside(time_limit=0.5, limit=True)["limit"])
    assert found.status == "time_limit"
    assert found.limit is None
    assert found.lower_bound is not None
    assert found.lower_bound.value is not None
    assert "No time was left" in found.verdict


def test_what_was_found_before_the_end_is_kept() -> None:
    """Asked to end once the single loops are there, a comparison keeps them."""
    calls = iter(range(10**9))

    def stop() -> bool:
        return next(calls) > 400

    request = TuningRequest.model_validate(
        {**REQUEST, "search": {"time_limit": 900, "limit": True}}
    )
    document = with_limit(request, {"search": {"elapsed_seconds": 0.5}}, stop)
    found = Alternatives.model_validate(document["limit"])
    assert found.status == "time_limit"
    assert found.alternatives
    assert all(each.value is None or each.value > 0 for each in found.alternatives)


def test_a_plant_without_a_limit_keeps_its_tuning() -> None:
    """A singular plant: the result of the tuning stands, and the sentence says why."""
    request = {**REQUEST, "plant": {**REQUEST["plant"], "interaction": 1}}
    asked = TuningRequest.model_validate({**request, "search": {"time_limit": 900, "limit": True}})
    found = with_limit(asked, {"tau_p": 3.0, "search": {"elapsed_seconds": 0.5}})
    assert found["tau_p"] == 3.0
    assert found["limit"]["status"] == "not_covered"
    assert "singular" in found["limit"]["verdict"]
