"""Bad input over HTTP: each fault is a problem that names the field, and never a 500."""

import json
from typing import Any

import httpx
import pytest
from samples import TUNING, altered, tuning

from service.analyses.controller_forms.request import ControllerFormsRequest
from service.schemas import RequestError, TuningRequest, parse_tuning_request
from service.schemas.parsing import parse

PATH = "/v1/tunings"
UNSTABLE = "the plant is open-loop unstable (pole at 1); stabilise it with an inner loop first"
TF = {"num": [1], "den": [100, 1]}
PARALLEL = {"kind": "parallel", "n": 2, "process": TF, "interaction": TF}


TWO_FORMS = (
    "two forms at once: give epsilon and theta, or gain_error and dead_time_error, or a weight"
)


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/plant", None, "/plant"),
        ("/plant", {}, "/plant/kind"),
        ("/plant/kind", "cubic", "/plant/kind"),
        ("/plant/n", 0, "/plant/n"),
        ("/plant/n", 10**6, "/plant/n"),
        ("/plant/n", 2.5, "/plant/n"),
        ("/plant/n", "2", "/plant/n"),
        ("/plant/gain", 0, "/plant/gain"),
        ("/plant/gain", True, "/plant/gain"),
        ("/plant/gain", 1e308, "/plant/gain"),
        ("/plant/gain", float("nan"), "/plant/gain"),
        ("/plant/gain", float("inf"), "/plant/gain"),
        ("/plant/gain", 1e-308, "/plant/gain"),
        ("/plant/interaction", 1e-308, "/plant/interaction"),
        ("/plant/time_constant", 1e-308, "/plant/time_constant"),
        ("/plant/time_constant", -1, "/plant/time_constant"),
        ("/plant/dead_time", -1, "/plant/dead_time"),
        ("/plant/colour", "red", "/plant/colour"),
        ("/plant/a~b", 1, "/plant/a~0b"),
        ("/uncertainty", {}, "/uncertainty/epsilon"),
        ("/uncertainty/epsilon", 0, "/uncertainty/epsilon"),
        ("/uncertainty/theta", 1e-308, "/uncertainty/theta"),
        ("/uncertainty/weight", TF, "/uncertainty"),
        ("/uncertainty", {"weight": {"num": [1], "den": [1, -1]}}, "/uncertainty/weight/den"),
        ("/performance/max_peak", 1, "/performance/max_peak"),
        ("/performance/offset", 1e-308, "/performance/offset"),
        ("/controller/kind", "P", "/controller/kind"),
        ("/controller/group_sizes", [1, 1], "/controller/group_sizes"),
        (
            "/controller",
            {"arrangement": "grouped", "group_sizes": [1, 2]},
            "/controller/group_sizes",
        ),
        ("/controller/bounds", {"gain": [2, 1]}, "/controller/bounds/gain"),
        ("/objective", "mu", "/performance/tau_p"),
        ("/search/starts", 0, "/search/starts"),
        ("/search/time_limit", 0, "/search/time_limit"),
        ("/plant", {**PARALLEL, "process": {"num": [], "den": [1]}}, "/plant/process/num"),
        ("/plant", {**PARALLEL, "process": {"num": [1], "den": [0, 0]}}, "/plant/process/den"),
        ("/plant", {**PARALLEL, "process": {"num": [1, 0], "den": [1]}}, "/plant/process/num"),
        ("/plant", {**PARALLEL, "interaction": {"num": [1]}}, "/plant/interaction/den"),
        ("/plant", {"kind": "matrix", "elements": [[TF, TF]]}, "/plant/elements/0"),
        (
            "/plant",
            {"kind": "matrix", "elements": [[{"num": [1, 1], "den": [1]}]]},
            "/plant/elements/0/0/num",
        ),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """A faulty value is a 422 problem with the pointer of that value."""
    body = json.dumps(altered(TUNING, pointer, value))
    response = client.post(PATH, content=body, headers={"Content-Type": "application/json"})
    assert response.status_code == 422
    assert response.headers["content-type"] == "application/problem+json"
    problem = response.json()
    assert problem.keys() == {"type", "title", "status", "detail", "errors"}
    assert problem["status"] == 422
    assert blamed in [fault["pointer"] for fault in problem["errors"]]


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b'{"plant": ', b"\xff\xfe", b"[" * 100_000, b'{"a":' * 100_000, b"nul"],
    ids=["empty", "brace", "truncated", "not text", "deep list", "deep object", "half word"],
)
def test_text_that_is_not_json_is_400(client: httpx.Client, body: bytes) -> None:
    """Text that is not JSON, however deep, is a 400 problem."""
    response = client.post(PATH, content=body, headers={"Content-Type": "application/json"})
    assert response.status_code == 400
    assert response.json()["type"] == "urn:mutune:problem:not-json"


@pytest.mark.parametrize("number", [b"1" * 5000, b"1e400", b"-Infinity", b"1" + b"0" * 400])
def test_number_beyond_all_bounds_is_refused(client: httpx.Client, number: bytes) -> None:
    """A number that no double holds is a 4xx problem."""
    body = json.dumps(altered(TUNING, "/plant/gain", "@")).encode().replace(b'"@"', number)
    response = client.post(PATH, content=body, headers={"Content-Type": "application/json"})
    assert response.status_code in {400, 422}


@pytest.mark.parametrize("media_type", ["text/plain", "application/x-www-form-urlencoded", ""])
def test_other_media_type_is_415(client: httpx.Client, media_type: str) -> None:
    """A body that is not declared as JSON is refused."""
    response = client.post(PATH, content=b"{}", headers={"Content-Type": media_type})
    assert response.status_code == 415
    assert response.json()["status"] == 415


def test_body_above_the_limit_is_413(client: httpx.Client) -> None:
    """A body of 2 MB is refused, declared or streamed."""
    headers = {"Content-Type": "application/json"}
    for content in (b" " * 2_000_000, iter([b" " * 100_000] * 20)):
        response = client.post(PATH, content=content, headers=headers)
        assert response.status_code == 413
        assert response.json()["title"] == "The body is too large"


def test_unknown_path_and_method_are_problems(client: httpx.Client) -> None:
    """Errors of routing have the same form."""
    for response, status in (
        (client.get("/v1/nothing"), 404),
        (client.put(PATH, json={}), 405),
        (client.get(f"{PATH}?limit=0"), 422),
        (client.get(f"{PATH}/not-an-id"), 422),
    ):
        assert response.status_code == status
        assert response.headers["content-type"] == "application/problem+json"
        assert response.json()["status"] == status


def test_refused_method_is_told_which_there_are(client: httpx.Client) -> None:
    """One Allow header, with the methods of all routes of the path."""
    assert client.put(PATH, json={}).headers.get_list("allow") == ["GET, POST"]


def test_names_of_fields_are_looked_up_once_for_all_faults() -> None:
    """The schema that knows them takes 25 ms to make: a faulty request must not take a second."""
    made = []

    class Asked(TuningRequest):
        @classmethod
        def model_json_schema(cls, *args: Any, **kwargs: Any) -> dict[str, Any]:
            made.append(cls)
            return super().model_json_schema(*args, **kwargs)

    with pytest.raises(RequestError) as refused:
        parse(Asked, json.dumps({f"plant{number}": 1 for number in range(50)}))
    assert len(refused.value.faults) == 20
    assert len(made) == 1


@pytest.mark.parametrize("right", [0, 60])
def test_of_very_many_faults_the_first_are_told(right: int) -> None:
    """A list of 30,000 wrong entries names some of the first, or how many there are."""
    loops = [{"gain": 1.0, "integral_time": 2.0}] * right + [1] * 30_000
    with pytest.raises(RequestError) as caught:
        parse(ControllerFormsRequest, json.dumps({"loops": loops}))
    (first, *others) = caught.value.faults
    if right:
        assert first.detail.startswith("30000 faults")
        assert not others
    else:
        assert first.pointer == "/loops/0"
        assert len(others) == 19


def test_all_faults_are_reported_at_once(client: httpx.Client) -> None:
    """A request with two faults is answered with both."""
    request = altered(altered(TUNING, "/plant/n", 0), "/plant/gain", "x")
    faults = client.post(PATH, json=request).json()["errors"]
    assert {fault["pointer"] for fault in faults} == {"/plant/n", "/plant/gain"}


@pytest.mark.parametrize(
    ("pointer", "value", "faults"),
    [
        (
            "/plant/interacton",
            0.5,
            [("/plant/interacton", "no such field; did you mean interaction?")],
        ),
        ("/plant/process", {}, [("/plant/process", "no such field")]),
        (
            "/plant/kind",
            "fist_order",
            [("/plant/kind", "no such kind; did you mean first_order?")],
        ),
        (
            "/plant",
            {"kind": "matrix", "elements": [[{"num": [], "den": [1]}]]},
            [("/plant/elements/0/0/num", "at least 1 entry needed")],
        ),
        (
            "/plant",
            {"kind": "matrix", "elements": [[{"num": [1], "den": [1, 1], "deadtime": 1}]]},
            [("/plant/elements/0/0/deadtime", "no such field; did you mean dead_time?")],
        ),
        ("/zzz", 1, [("/zzz", "no such field")]),
        (
            "/plant",
            {"kind": "matrix", "elements": [[{"num": [1], "den": [1, -1]}]]},
            [("/plant/elements/0/0/den", UNSTABLE)],
        ),
        (
            "/scenarios",
            [{"name": "x", "in_service": []}],
            [("/scenarios/0/in_service", "at least 1 entry needed")],
        ),
        (
            "/scenarios",
            [{"name": "x", "in_service": {"any": 0}}],
            [("/scenarios/0/in_service/any", "Input should be greater than or equal to 1")],
        ),
        (
            "/uncertainty/epsilon",
            [0.1, "a"],
            [("/uncertainty/epsilon/1", "Input should be a valid number")],
        ),
        (
            "/uncertainty",
            {"weight": {"num": [0.2], "den": [1, 1]}, "theta": 1},
            [("/uncertainty", TWO_FORMS)],
        ),
    ],
)
def test_one_fault_is_one_error(
    client: httpx.Client, pointer: str, value: object, faults: list[tuple[str, str]]
) -> None:
    """A fault is told once, at its place, at once, with the name that was meant."""
    body = altered(TUNING, pointer, value)
    if pointer.endswith("interacton"):
        del body["plant"]["interaction"]
    response = client.post(PATH, json=body)
    assert response.status_code == 422
    told = [(error["pointer"], error["detail"]) for error in response.json()["errors"]]
    assert told == faults


def test_whole_numbers_may_be_written_with_a_point(client: httpx.Client) -> None:
    """2.0 units are two units: many writers print no integers."""
    assert client.post(PATH, json=altered(TUNING, "/plant/n", 2.0)).status_code == 202


@pytest.mark.parametrize(
    ("uncertainty", "pointers"),
    [
        ({"gain_error": 0.2}, ["/uncertainty/dead_time_error"]),
        ({"epsilon": "much", "theta": 1}, ["/uncertainty/epsilon"]),
        ({"epsilon": [0.2, "much"], "theta": 1}, ["/uncertainty/epsilon/1"]),
        ({"weight": {"num": [1], "den": ["x"]}}, ["/uncertainty/weight/den/0"]),
        ({}, ["/uncertainty/epsilon", "/uncertainty/theta"]),
        ({"epsilon": 0.2, "theta": 1, "gain_error": 0.1}, ["/uncertainty"]),
        ({"epsilon": 0.2, "dead_time_error": 1}, ["/uncertainty"]),
        ({"weight": {"num": [1], "den": [1, 1]}, "epsilon": 0.2}, ["/uncertainty"]),
    ],
)
def test_pointers_lead_through_the_body_whatever_form_a_field_has(
    uncertainty: dict[str, object], pointers: list[str]
) -> None:
    """No name of a form stands in a pointer, and what two forms refuse is one fault."""
    text = json.dumps({**tuning(1), "uncertainty": uncertainty})
    with pytest.raises(RequestError) as refused:
        parse_tuning_request(text)
    assert [fault.pointer for fault in refused.value.faults] == pointers


def test_a_kind_that_is_missing_is_asked_for_with_all_that_there_are(client: httpx.Client) -> None:
    """One fault, at its place, with the names that may stand there."""
    response = client.post(PATH, json=altered(TUNING, "/plant", {"n": 2}))
    assert response.status_code == 422
    (error,) = response.json()["errors"]
    assert error["pointer"] == "/plant/kind"
    asked, _, kinds = error["detail"].partition(": ")
    assert asked == "a kind is needed"
    assert {"first_order", "matrix", "parallel", "state_space"} <= set(kinds.split(", "))
