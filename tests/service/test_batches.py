"""Batches over HTTP."""

import csv
import io
import json
from typing import Any

import httpx
import pytest
from fake_tune import ENDLESS, SLOW, UNSUPPORTED
from samples import altered, tuning

from service.batch.request_lines import read_items
from service.jobs.records import BatchItem, JobStatus, Outcome
from service.schemas import parse_batch_tuning, parse_tuning_request
from service.schemas.batches import item_to_json

PATH = "/v1/batches"


def start(client: httpx.Client, *tunings: dict[str, Any], **headers: str) -> dict[str, Any]:
    """Start a batch and return it."""
    response = client.post(PATH, json={"tunings": tunings}, headers=headers)
    assert response.status_code == 202, response.text
    batch: dict[str, Any] = response.json()
    assert response.headers["location"] == batch["links"]["self"]
    return batch


def results(client: httpx.Client, batch: dict[str, Any], query: str = "") -> list[dict[str, Any]]:
    """Return the results of a batch, once they are all there."""
    response = client.get(batch["links"]["results"] + query)
    assert response.headers["content-type"] == "application/x-ndjson"
    return [json.loads(line) for line in response.text.splitlines()]


def newest(client: httpx.Client) -> list[str]:
    """Return the id of the newest job, where there is one."""
    return [job["id"] for job in client.get("/v1/tunings?limit=1").json()["items"]]


def test_results_come_in_order(client: httpx.Client) -> None:
    """A line a tuning, in the order of the request, whatever ends first."""
    batch = start(client, tuning(SLOW, starts=50), *(tuning(200 + index) for index in range(20)))
    lines = results(client, batch)
    assert [line["index"] for line in lines] == list(range(21))
    assert [line["result"]["tau_p"] for line in lines[1:]] == list(range(200, 220))
    ended = client.get(batch["links"]["self"]).json()
    assert ended["status"] == "finished"
    assert ended["states"]["succeeded"] == ended["count"] == 21


def test_results_can_begin_anywhere(client: httpx.Client) -> None:
    """A reader that was interrupted goes on where it was."""
    batch = start(client, *(tuning(300 + index) for index in range(5)))
    assert [line["index"] for line in results(client, batch, "?start=3")] == [3, 4]


def test_equal_tunings_are_computed_once(client: httpx.Client) -> None:
    """Equal requests, defaults written out or not, share a job."""
    spelled_out = {**tuning(9), "objective": "tau_p", "certificate": "none"}
    lines = results(client, start(client, tuning(9), tuning(10), spelled_out))
    assert lines[0]["id"] == lines[2]["id"] != lines[1]["id"]
    assert lines[0]["result"] == lines[2]["result"]


def test_tunings_of_a_batch_carry_a_certificate_where_they_ask_only() -> None:
    """Single requests carry one; ten thousand results stay small."""
    text = json.dumps(tuning(9))
    assert parse_tuning_request(text).certificate == "full"
    assert parse_batch_tuning(text).certificate == "none"
    asked = json.dumps({**tuning(9), "certificate": "full"})
    assert parse_batch_tuning(asked).certificate == "full"
    (item,) = read_items(text.encode())
    assert json.loads(item.request)["certificate"] == "none"


def test_tunings_of_a_batch_tell_tolerances_of_the_model_where_they_ask_only() -> None:
    """Single requests tell them; they take longer than many a search."""
    text = json.dumps(tuning(9))
    assert parse_tuning_request(text).build().model_tolerance is True
    assert parse_batch_tuning(text).build().model_tolerance is False
    asked = json.dumps({**tuning(9), "model_tolerance": True})
    assert parse_batch_tuning(asked).build().model_tolerance is True


def test_failure_is_reported_for_its_item_alone(client: httpx.Client) -> None:
    """An item that fails leaves the others alone."""
    lines = results(client, start(client, tuning(11), tuning(UNSUPPORTED), tuning(12)))
    assert lines[1]["error"]["type"] == "urn:mutune:problem:unsupported-plant"
    assert [lines[0]["result"]["tau_p"], lines[2]["result"]["tau_p"]] == [11, 12]


def test_batch_is_cancelled_as_a_whole(client: httpx.Client) -> None:
    """What runs stops, what waits never starts, and the results say so."""
    batch = start(client, *(tuning(ENDLESS, starts=1 + index) for index in range(10)))
    assert client.delete(batch["links"]["self"]).status_code == 202
    lines = results(client, batch)
    assert {line["error"]["type"] for line in lines} == {"urn:mutune:problem:cancelled"}
    assert client.get(batch["links"]["self"]).json()["states"]["cancelled"] == 10


def test_interactive_tuning_overtakes_a_batch(client: httpx.Client) -> None:
    """A single tuning does not wait for long ones of a batch, which are done again."""
    batch = start(client, *(tuning(ENDLESS, starts=100 + index) for index in range(20)))
    response = client.post("/v1/tunings", json=tuning(13), headers={"Prefer": "wait=60"})
    assert response.json()["status"] == "succeeded"
    states = client.get(batch["links"]["self"]).json()["states"]
    assert states["succeeded"] + states["failed"] == 0
    client.delete(batch["links"]["self"])
    results(client, batch)


def test_same_idempotency_key_gives_the_same_batch(client: httpx.Client) -> None:
    """A repeated batch with its key creates nothing; another one with it is refused."""
    key = {"Idempotency-Key": "batch one"}
    first = start(client, tuning(14), **key)
    assert start(client, tuning(14), **key)["id"] == first["id"]
    other = client.post(PATH, json={"tunings": [tuning(15)]}, headers=key)
    assert other.status_code == 409


@pytest.mark.parametrize(
    ("body", "status", "pointer"),
    [
        ({"tunings": []}, 422, "/tunings"),
        ({"tunings": {}}, 422, ""),
        ({"items": [tuning()]}, 422, ""),
        ({"tunings": [tuning()], "extra": 1}, 422, ""),
        ({"tunings": [tuning(), altered(tuning(), "/plant/n", 0)]}, 422, "/tunings/1/plant/n"),
        ({"tunings": [altered(tuning(), "/plant/gain", 0)]}, 422, "/tunings/0/plant/gain"),
        ({"tunings": [tuning(), "x]"]}, 422, "/tunings/1"),
    ],
)
def test_faulty_batch_is_refused_as_a_whole(
    client: httpx.Client, body: object, status: int, pointer: str
) -> None:
    """One faulty item refuses the batch and is named; nothing is accepted."""
    before = newest(client)
    response = client.post(PATH, json=body)
    assert response.status_code == status
    assert response.json()["errors"][0]["pointer"] == pointer
    assert newest(client) == before


@pytest.mark.parametrize("body", ['{"tunings": [', '{"tunings": [{"a": "b}', '{"tunings": [1 2]}'])
def test_text_that_is_not_json_is_refused(client: httpx.Client, body: str) -> None:
    """A text that ends early, or is no JSON, is a 4xx problem."""
    headers = {"Content-Type": "application/json"}
    assert client.post(PATH, content=body, headers=headers).status_code == 400


def test_unknown_batch_is_404(client: httpx.Client) -> None:
    """A batch that does not exist is a 404 problem for every method."""
    path = f"{PATH}/{'0' * 32}"
    for response in (client.get(path), client.delete(path), client.get(f"{path}/results")):
        assert response.status_code == 404


def test_all_faults_are_named_at_once(client: httpx.Client) -> None:
    """Whoever mends a batch of thousands wants to do so once."""
    tunings = [tuning(), altered(tuning(), "/plant/n", 0), tuning(), {"plant": 3}]
    answer = client.post("/v1/batches", json={"tunings": tunings})
    assert answer.status_code == 422
    pointers = {fault["pointer"] for fault in answer.json()["errors"]}
    assert "/tunings/1/plant/n" in pointers
    assert any(pointer.startswith("/tunings/3/") for pointer in pointers)


@pytest.mark.parametrize("form", ["before", "after", "lines"])
def test_faulty_tunings_can_be_skipped(client: httpx.Client, form: str) -> None:
    """They become jobs that have failed, each in its place and with its fault."""
    tunings = [tuning(seed=77), altered(tuning(), "/plant/n", 0), tuning(seed=78)]
    if form == "lines":
        lines = "\n".join(json.dumps(each) for each in tunings) + "\r\n\n"
        headers = {"Content-Type": "application/x-ndjson"}
        answer = client.post("/v1/batches?on_error=skip", content=lines, headers=headers)
    else:
        option, array = {"on_error": "skip"}, {"tunings": tunings}
        body = option | array if form == "before" else array | option
        answer = client.post("/v1/batches", json=body)
    assert answer.status_code == 202, answer.text
    batch = answer.json()
    lines = client.get(batch["links"]["results"]).text.splitlines()
    items = [json.loads(line) for line in lines]
    assert [item["index"] for item in items] == [0, 1, 2]
    assert [item.get("result", {}).get("tau_p") for item in items] == [77, None, 78]
    assert items[1]["error"]["errors"][0]["pointer"] == "/plant/n"
    assert client.get(f"/v1/batches/{batch['id']}").json()["states"]["failed"] == 1
    assert batch["id"] in {each["id"] for each in client.get("/v1/batches").json()["items"]}
    jobs = client.get(f"/v1/tunings?batch={batch['id']}").json()["items"]
    assert {job["batch"] for job in jobs} == {batch["id"]}


@pytest.mark.parametrize("body", [{"on_error": "ignore"}, {"colour": "red"}])
def test_other_members_are_refused(client: httpx.Client, body: dict) -> None:
    """A misspelt option is not taken for the default."""
    assert client.post("/v1/batches", json={"tunings": [tuning()]} | body).status_code == 422


def test_results_in_the_order_of_completion(client: httpx.Client) -> None:
    """A slow item does not hold up those behind it."""
    slow = tuning(seed=SLOW, starts=50)
    quick = [tuning(seed=1000 + number) for number in range(4)]
    batch = client.post("/v1/batches", json={"tunings": [slow, *quick]}).json()
    answer = client.get(f"{batch['links']['results']}?order=completion")
    indices = [json.loads(line)["index"] for line in answer.text.splitlines()]
    assert sorted(indices) == [0, 1, 2, 3, 4]


def test_a_known_result_is_taken(client: httpx.Client) -> None:
    """An equal request ends at once, with its own identity; no-cache computes it anew."""
    request = tuning(seed=4321)
    first = client.post("/v1/tunings", json=request, headers={"Prefer": "wait=60"}).json()
    again = client.post("/v1/tunings", json=request | {"id": "R-8", "title": "again"})
    assert again.status_code == 200
    job = again.json()
    assert job["id"] != first["id"]
    assert job["started_at"] is None
    assert job["result"] == first["result"] | {"id": "R-8"}
    anew = client.post("/v1/tunings", json=request, headers={"Cache-Control": "no-cache"})
    assert anew.status_code == 202
    batch = client.post("/v1/batches", json={"tunings": [request, tuning(seed=4322)]}).json()
    items = client.get(batch["links"]["results"]).text.splitlines()
    assert [json.loads(item)["result"]["tau_p"] for item in items] == [4321, 4322]


def test_results_without_curves(client: httpx.Client) -> None:
    """All but the curves is as it was."""
    batch = start(client, tuning(40), tuning(UNSUPPORTED))
    whole, short = results(client, batch), results(client, batch, "?curves=false")
    assert short == whole  # the tuner of these tests draws none
    item = BatchItem(
        3, "a" * 32, Outcome(JobStatus.SUCCEEDED, '{"tau_p": 0.1, "curves": {"omega": [1]}}')
    )
    line = json.loads(item_to_json(item, curves=False))
    assert line == {"index": 3, "id": "a" * 32, "result": {"tau_p": 0.1, "curves": None}}
    assert json.loads(item_to_json(item))["result"]["curves"] == {"omega": [1]}


def table(client: httpx.Client, batch: dict[str, Any], query: str = "") -> list[dict[str, str]]:
    """Return the rows of the table of a batch."""
    response = client.get(batch["links"]["results"] + query, headers={"Accept": "text/csv"})
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/csv")
    assert response.headers["vary"] == "Accept"
    return list(csv.DictReader(io.StringIO(response.text)))


def test_results_as_a_table(client: httpx.Client) -> None:
    """A row a request or a loop: the fields that differ, what was found, what went wrong."""
    named = [{**tuning(seed), "id": f"R-{seed}"} for seed in (50, 51, UNSUPPORTED)]
    body = {"tunings": [*named, {"plant": 1}], "on_error": "skip"}
    batch = client.post(PATH, json=body).json()
    rows = table(client, batch)
    assert [row["line"] for row in rows] == ["1", "2", "3", "4"]
    assert [row["id"] for row in rows] == ["R-50", "R-51", f"R-{UNSUPPORTED}", ""]
    assert [row["status"] for row in rows] == ["optimal", "optimal", "error", "error"]
    assert [row["tau_p"] for row in rows] == ["50.0", "51.0", "", ""]
    assert [row["search.seed"] for row in rows][:2] == ["50", "51"]
    assert rows[3]["error"]
    assert rows[0]["job"] == results(client, batch)[0]["id"]
    assert [row["line"] for row in table(client, batch, "?start=2")] == ["3", "4"]
    loops = table(client, batch, "?rows=loop&form=parallel")
    assert [row["loop"] for row in loops] == ["1", "2", "1", "2", "", ""]
    assert float(loops[0]["proportional_gain"]) != 0


def test_a_table_of_requests_that_are_none(client: httpx.Client) -> None:
    """Whatever a faulty one holds: half characters, formulas as names, nesting without end."""
    deep: Any = 1
    for _ in range(800):
        deep = [deep]
    faulty = [{"=1+1": "\ud800", "\udfff": 2}, {"deep": deep}]
    content = json.dumps({"tunings": faulty, "on_error": "skip"})
    headers = {"Content-Type": "application/json"}
    batch = client.post(PATH, content=content, headers=headers).json()
    rows = table(client, batch)
    assert [row["status"] for row in rows] == ["error", "error"]
    assert rows[0]["'=1+1"] == "\\ud800"
    assert rows[0]["\\udfff"] == "2"
    assert "(nested deeper)" in rows[1].values()


def test_a_table_waits_for_the_whole_batch(client: httpx.Client) -> None:
    """What is asked for right after the start is complete, too."""
    batch = start(client, tuning(SLOW, starts=20), tuning(60))
    assert [row["status"] for row in table(client, batch)] == ["optimal", "optimal"]
