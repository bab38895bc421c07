"""Figures and reports over HTTP."""

from __future__ import annotations

import json
import uuid
from typing import Any

import httpx
import pytest
from fake_tune import ENDLESS
from samples import ROBUSTNESS, altered, tuning

from service.analyses.decouple import EXAMPLE as DECOUPLING
from service.analyses.identify import EXAMPLE as IDENTIFICATION
from service.analyses.interaction import EXAMPLE as INTERACTION
from service.analyses.parallel_drives import EXAMPLE as DRIVES
from service.analyses.relay import EXAMPLE as RELAY
from service.analyses.step_response import EXAMPLE as STEPS
from service.http.kept import Kept, key_of
from service.problems import UnavailableError
from service.schemas.figures import FiguresResult


@pytest.fixture(scope="module")
def finished(client: httpx.Client) -> str:
    """Return the path of a tuning that has ended."""
    response = client.post("/v1/tunings", json=tuning(seed=30), headers={"Prefer": "wait=60"})
    assert response.json()["status"] == "succeeded", response.text
    return response.headers["Location"]


def drawn(response: httpx.Response) -> FiguresResult:
    """Return the figures of an answer that must be one."""
    assert response.status_code == 200, response.text
    return FiguresResult.model_validate(response.json())


def test_a_tuning_has_figures_and_both_templates(client: httpx.Client, finished: str) -> None:
    """What can be drawn is there, what cannot says why, and templates come once for all."""
    result = drawn(client.get(f"{finished}/figures", params={"unit": "min"}))
    assert list(result.figures) == [
        "step_single", "step_easy", "step_difficult", "step_load", "landscape",
    ]  # fmt: skip
    assert result.omitted["mu"] == "the result has no curves"
    assert result.figures["step_easy"].layout["xaxis3"]["title"]["text"] == "time (min)"
    assert "template" not in result.figures["step_easy"].layout
    colours = [t["layout"]["font"]["color"] for t in result.templates.model_dump().values()]
    assert len(set(colours)) == 2


@pytest.mark.parametrize("resource", ["figures", "sheet"])
def test_what_was_drawn_is_not_computed_twice(
    client: httpx.Client, finished: str, resource: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second request finds the first one's answer; one in another unit does not."""
    first = client.get(f"{finished}/{resource}", params={"unit": "min"})
    assert first.status_code == 200

    async def refuse(*_: object) -> bytes:
        message = "No process is left."
        raise UnavailableError(message, {})

    monkeypatch.setattr("service.http.routes.figures.computed", refuse)
    assert client.get(f"{finished}/{resource}", params={"unit": "min"}).json() == first.json()
    assert client.get(f"{finished}/{resource}", params={"unit": "s"}).status_code == 503


def test_answers_are_kept_within_bounds() -> None:
    """The one that was not asked for longest goes first, and one that is too long is not kept."""
    kept = Kept(room=100)
    for name in (b"a", b"b", b"c"):
        kept.keep(name, name * 40)
        kept.get(b"a")
    kept.keep(b"d", b"d" * 101)
    assert [kept.get(name) is not None for name in (b"a", b"b", b"c", b"d")] == [
        True,
        False,
        True,
        False,
    ]
    assert key_of("ab", "c") != key_of("a", "bc")


@pytest.mark.parametrize("resource", ["figures", "report"])
def test_a_running_tuning_has_none_yet(client: httpx.Client, resource: str) -> None:
    """Before there is a result the answer is a conflict that names the state."""
    job = client.post("/v1/tunings", json=tuning(ENDLESS)).json()
    response = client.get(f"/v1/tunings/{job['id']}/{resource}")
    client.delete(f"/v1/tunings/{job['id']}")
    assert response.status_code == 409
    assert "has no result" in response.json()["detail"]


@pytest.mark.parametrize("resource", ["figures", "report"])
def test_an_unknown_tuning_has_none(client: httpx.Client, resource: str) -> None:
    """A tuning that does not exist is not found."""
    assert client.get(f"/v1/tunings/{uuid.uuid4().hex}/{resource}").status_code == 404


@pytest.mark.parametrize("unit", ["<b>min</b>", "", "x" * 21, "a&b"])
@pytest.mark.parametrize("resource", ["figures", "report"])
def test_units_that_titles_cannot_hold_are_refused(
    client: httpx.Client, finished: str, resource: str, unit: str
) -> None:
    """A unit is a short plain text: Plotly reads titles as HTML."""
    response = client.get(f"{finished}/{resource}", params={"unit": unit})
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == "/query/unit"


@pytest.mark.parametrize(
    ("kind", "request_body", "names"),
    [
        ("robustness", ROBUSTNESS, ["mu"]),
        ("interaction", INTERACTION, ["rga", "rga_frequency"]),
        ("step-responses", {**STEPS, "duration": 120.0, "samples": 61}, ["step_response"]),
        ("relay-experiments", RELAY, ["relay", "nyquist"]),
        ("decouplings", DECOUPLING, ["decoupled"]),
        ("parallel-drives", DRIVES, ["drives"]),
        ("identifications", IDENTIFICATION, ["record_1", "errors"]),
    ],
)
def test_the_answer_of_an_analysis_is_drawn_as_it_came(
    client: httpx.Client, kind: str, request_body: dict[str, Any], names: list[str]
) -> None:
    """Whatever an analysis answers, its figures accept."""
    response = client.post(f"/v1/{kind}", json=request_body, headers={"Prefer": "wait=60"})
    assert response.status_code == 200, response.text
    answer = response.json()
    if "links" in answer:  # computed as a job
        answer = answer["result"]
    result = drawn(client.post(f"/v1/figures/{kind}", json=answer))
    assert list(result.figures) == names


def test_unstable_loops_have_no_curves_to_draw(client: httpx.Client) -> None:
    """The analysis of unstable loops gives no figure, and says why."""
    answer = client.post("/v1/robustness", json=altered(ROBUSTNESS, "/plant/dead_time", 10)).json()
    assert answer["curves"] is None
    result = drawn(client.post("/v1/figures/robustness", json=answer))
    assert (result.figures, list(result.omitted)) == ({}, ["mu"])


def test_loops_without_settings_have_no_responses(client: httpx.Client) -> None:
    """A decoupling with an unbounded loop gives no figure, and says why."""
    result = drawn(client.post("/v1/figures/decouplings", json={"closed_loop": None}))
    assert (result.figures, list(result.omitted)) == ({}, ["decoupled"])


def test_a_trade_off_is_drawn(client: httpx.Client) -> None:
    """Points of a sweep become a curve with gaps."""
    points = [{"value": 0.1, "tau_p": 12.0}, {"value": 0.9, "tau_p": None}]
    body = {"parameter": "epsilon", "points": points}
    result = drawn(client.post("/v1/figures/trade-offs", json=body))
    assert result.figures["trade_off"].data[0]["y"] == [12.0, None]


@pytest.mark.parametrize(
    ("kind", "body", "pointer"),
    [
        ("robustness", {"peaks": None, "curves": {"omega": [0.0]}}, "/curves/omega/0"),
        (
            "robustness",
            {
                "peaks": None,
                "curves": {
                    "omega": [0.1],
                    "robust_performance": [0.1, 0.2],
                    "robust_stability": [0.1],
                    "nominal_performance": [0.1],
                },
            },
            "/curves",
        ),
        (
            "interaction",
            {"relative_gains": [[1.0, 2.0]], "curves": {"omega": [], "relative_gains": None}},
            "",
        ),
        (
            "interaction",
            {
                "relative_gains": None,
                "curves": {"omega": [1.0], "relative_gains": [[[{"re": 1.0, "im": 0.0}], []]]},
            },
            "/curves",
        ),
        (
            "step-responses",
            {
                "time": [0.0, 1.0],
                "responses": [{"units": [0], "set_point": [], "output": [], "input": []}],
            },
            "",
        ),
        (
            "relay-experiments",
            {"time": [0.0], "units": [[0]], "outputs": [], "inputs": [[1.0]], "switchings": []},
            "",
        ),
        (
            "decouplings",
            {"closed_loop": {"omega": [1.0], "exact": [[[]]], "approximate": [[]]}},
            "/closed_loop",
        ),
        (
            "parallel-drives",
            {
                "simulation": {
                    "original": {
                        "time": [0.0, 1.0],
                        "set_point": [1.0, 1.0],
                        "output": [0.0, 1.0],
                        "efforts": [[1.0], [1.0, 2.0]],
                    },
                    "mended": None,
                }
            },
            "/simulation/original",
        ),
        ("trade-offs", {"parameter": "<theta>", "points": []}, "/parameter"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    client: httpx.Client, kind: str, body: dict[str, Any], pointer: str
) -> None:
    """Series of different lengths, frequencies that have no logarithm: named by pointer."""
    response = client.post(f"/v1/figures/{kind}", json=body)
    assert response.status_code == 422, response.text
    assert pointer in [error["pointer"] for error in response.json()["errors"]]


def test_the_report_is_a_file_with_a_policy_of_its_own(client: httpx.Client, finished: str) -> None:
    """The report comes as a download and permits its own scripts, by digest, and no others."""
    response = client.get(f"{finished}/report", params={"unit": "min"})
    assert response.status_code == 200
    assert response.headers["Content-Type"] == "text/html; charset=utf-8"
    name = f"mutune-{finished.rpartition('/')[2][:8]}.html"
    assert response.headers["Content-Disposition"] == f'attachment; filename="{name}"'
    policy = response.headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert policy in response.text.replace("&#39;", "'")
    assert finished.rpartition("/")[2] in response.text
    assert "τP = 30 min" in response.text


def test_figures_are_plain_json(client: httpx.Client, finished: str) -> None:
    """No base64 arrays, no NaN: any reader of JSON can draw them."""
    text = client.get(f"{finished}/figures").text
    assert "bdata" not in text
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the answer"))
