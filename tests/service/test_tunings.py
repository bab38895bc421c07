"""Tunings over HTTP."""

import json
from typing import Any

import httpx
import pytest
from fake_tune import BROKEN, DEADLY, ENDLESS, SLOW, STUCK, UNSUPPORTED
from real import until
from samples import altered, tuning

from service.schemas import TuningResult

PATH = "/v1/tunings"


def start(client: httpx.Client, request: dict[str, Any], **headers: str) -> dict[str, Any]:
    """Start a tuning and return the job."""
    response = client.post(PATH, json=request, headers=headers)
    assert response.status_code in {200, 202}, response.text
    job: dict[str, Any] = response.json()
    assert response.headers["location"] == job["links"]["self"]
    return job


def running(client: httpx.Client, request: dict[str, Any]) -> dict[str, Any]:
    """Start a tuning, and return it once it runs."""
    job = start(client, request)
    until(lambda: client.get(job["links"]["self"]).json()["status"] == "running", "a job that runs")
    return job


def end(client: httpx.Client, job: dict[str, Any]) -> dict[str, Any]:
    """Follow a job to its end and return it."""
    return events(client, job)[-1][1]


def events(client: httpx.Client, job: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Follow a job to its end and return all its events."""
    response = client.get(job["links"]["events"])
    assert response.headers["content-type"].startswith("text/event-stream")
    result = []
    for block in response.text.strip().split("\n\n"):
        if block.startswith(":"):  # a comment that keeps the connection open
            continue
        name, data = block.split("\n")
        result.append((name.removeprefix("event: "), json.loads(data.removeprefix("data: "))))
    return result


def test_accepted_tuning_ends_with_a_result_of_the_documented_form(client: httpx.Client) -> None:
    """A tuning is answered 202 with its place, and ends with a result that fits its schema."""
    response = client.post(PATH, json=tuning(seed=7001))
    assert response.status_code == 202
    job = end(client, response.json())
    assert job["status"] == "succeeded"
    assert job["progress"] == {"fraction": 1, "best": 7001}
    assert job["created_at"] <= job["started_at"] <= job["finished_at"]
    assert TuningResult.model_validate(job["result"]).tau_p == 7001
    assert client.get(job["links"]["self"]).json() == job


def test_request_comes_back_with_all_defaults(client: httpx.Client) -> None:
    """The job shows the request as it was understood."""
    request = start(client, tuning(seed=7002))["request"]
    assert request["search"] == {
        "seed": 7002, "starts": None, "time_limit": 60.0, "start": None, "optimality_gap": False,
        "limit": False,
    }  # fmt: skip
    assert request["controller"]["arrangement"] == "independent"


def test_wait_answers_with_the_finished_job(client: httpx.Client) -> None:
    """With Prefer: wait the answer is the finished job."""
    response = client.post(PATH, json=tuning(), headers={"Prefer": "wait=60"})
    assert response.status_code == 200
    assert response.headers["preference-applied"] == "wait=60"
    assert response.json()["status"] == "succeeded"


def test_wait_that_is_too_short_answers_202(client: httpx.Client) -> None:
    """A job that does not end in the time that the caller waits is answered 202."""
    response = client.post(PATH, json=tuning(ENDLESS), headers={"Prefer": "wait=0"})
    assert response.status_code == 202
    client.delete(response.headers["location"])


def test_progress_rises_and_the_last_event_is_the_job(client: httpx.Client) -> None:
    """Events: progress that never falls, then the job as it has ended."""
    job = start(client, tuning(ENDLESS))
    fractions: list[float] = []
    last = ""
    with client.stream("GET", job["links"]["events"]) as stream:
        for line in stream.iter_lines():
            name, _, text = line.partition(": ")
            if name == "event":
                last = text
            elif name == "data" and last == "progress":
                fractions.append(json.loads(text)["progress"]["fraction"])
                if len(fractions) == 3:
                    client.delete(job["links"]["self"])
            elif name == "data":
                ended = json.loads(text)
    assert last == "done"
    assert ended["status"] == "cancelled"
    assert fractions == sorted(fractions)
    assert any(0 < fraction < 1 for fraction in fractions)


def test_running_tuning_is_cancelled(client: httpx.Client) -> None:
    """DELETE ends a running job with the best so far, and a second DELETE changes nothing."""
    job = running(client, tuning(ENDLESS))
    assert client.delete(job["links"]["self"]).status_code in {200, 202}
    ended = end(client, job)
    assert ended["status"] == "cancelled"
    assert ended["result"]["status"] == "time_limit"
    assert ended["progress"]["best"] == ended["result"]["tau_p"]
    again = client.delete(job["links"]["self"])
    assert again.status_code == 200
    assert again.json() == ended


def test_ended_tuning_is_deleted(client: httpx.Client) -> None:
    """With `forget` a job that has ended goes for ever; one that runs stays, also of a batch."""
    done = client.post(PATH, json=tuning(11), headers={"Prefer": "wait=60"}).json()
    lasting = running(client, tuning(ENDLESS))
    refused = client.delete(lasting["links"]["self"], params={"forget": True})
    assert refused.status_code == 409
    assert client.get(lasting["links"]["self"]).json()["status"] == "running"
    client.delete(lasting["links"]["self"])
    assert client.delete(done["links"]["self"], params={"forget": True}).json() == done
    assert client.get(done["links"]["self"]).status_code == 404
    batch = client.post("/v1/batches", json={"tunings": [tuning(12)]}).json()
    client.get(batch["links"]["results"])
    (kept,) = client.get(PATH, params={"batch": batch["id"]}).json()["items"]
    assert client.delete(kept["links"]["self"], params={"forget": True}).status_code == 409


def test_queued_tuning_is_cancelled_at_once(client: httpx.Client) -> None:
    """A job that waits for a worker is cancelled in the table."""
    ahead = [start(client, tuning(ENDLESS)) for _ in range(2)]
    waiting = start(client, tuning(ENDLESS))
    response = client.delete(waiting["links"]["self"])
    assert response.status_code == 200
    assert response.json()["status"] == "cancelled"
    for job in ahead:
        client.delete(job["links"]["self"])
        assert end(client, job)["status"] == "cancelled"


def test_worker_that_does_not_answer_is_restarted(client: httpx.Client) -> None:
    """A computation that ignores its callback is ended with its worker; the next one runs."""
    job = running(client, tuning(STUCK))
    client.delete(job["links"]["self"])
    assert end(client, job)["status"] == "cancelled"
    for _ in range(2):
        assert end(client, start(client, tuning()))["status"] == "succeeded"


def test_poison_ends_as_failed_after_three_attempts(client: httpx.Client) -> None:
    """A job that kills each worker fails with the reason; others are not harmed."""
    poison = start(client, tuning(DEADLY))
    healthy = [start(client, tuning(SLOW, starts=20)) for _ in range(4)]
    ended = end(client, poison)
    assert ended["status"] == "failed"
    assert "3 attempts" in ended["error"]["detail"]
    assert [end(client, job)["status"] for job in healthy] == ["succeeded"] * 4


def test_plant_that_the_solver_refuses_fails_with_the_field(client: httpx.Client) -> None:
    """What only the solver finds out ends as a failed job that names the field."""
    ended = end(client, start(client, tuning(UNSUPPORTED)))
    assert ended["status"] == "failed"
    assert ended["error"]["type"] == "urn:mutune:problem:unsupported-plant"
    assert ended["error"]["errors"][0]["pointer"] == "/plant/process/den"


def test_fault_of_the_solver_tells_nothing_of_its_inside(client: httpx.Client) -> None:
    """An unforeseen exception ends as a failed job without its message."""
    ended = end(client, start(client, tuning(BROKEN)))
    assert ended["status"] == "failed"
    assert ended["error"]["status"] == 500
    assert "a fault of the solver" not in json.dumps(ended)


def test_same_idempotency_key_gives_the_same_job(client: httpx.Client) -> None:
    """A repeated request with its key creates nothing; another request with it is refused."""
    first = start(client, tuning(), **{"Idempotency-Key": "one"})
    again = start(client, tuning(), **{"Idempotency-Key": "one"})
    assert again["id"] == first["id"]
    other = client.post(PATH, json=tuning(8), headers={"Idempotency-Key": "one"})
    assert other.status_code == 409


def test_pages_hold_every_job_once_newest_first(client: httpx.Client) -> None:
    """Following `next` visits every job once."""
    mine = [start(client, tuning(seed=100 + index))["id"] for index in range(5)]
    seen: list[str] = []
    path: str | None = f"{PATH}?limit=2"
    while path is not None:
        page = client.get(path).json()
        assert len(page["items"]) <= 2
        seen += [job["id"] for job in page["items"]]
        path = page["next"]
    assert seen[:5] == mine[::-1]
    assert len(seen) == len(set(seen))


def test_pages_can_be_restricted_to_a_state(client: httpx.Client) -> None:
    """With ?status= only jobs in that state are listed, on every page."""
    ids = {end(client, start(client, tuning(UNSUPPORTED)))["id"] for _ in range(2)}
    page = client.get(f"{PATH}?status=failed&limit=1").json()
    second = client.get(page["next"]).json()
    assert {page["items"][0]["id"], second["items"][0]["id"]} == ids


@pytest.mark.parametrize("method", ["get", "delete"])
def test_unknown_job_is_404(client: httpx.Client, method: str) -> None:
    """A job that does not exist is a 404 problem."""
    response = client.request(method, f"{PATH}/{'0' * 32}")
    assert response.status_code == 404
    assert response.headers["content-type"] == "application/problem+json"


def test_thousand_units_are_answered(client: httpx.Client) -> None:
    """A result for n = 1000 lists a loop for each unit."""
    job = end(
        client,
        start(
            client,
            altered(altered(tuning(), "/plant/n", 1000), "/controller/arrangement", "identical"),
        ),
    )
    assert len(job["result"]["loops"]) == 1000
