"""The Python client against a running service."""

from collections.abc import AsyncIterator, Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import httpx
import pytest
from fake_tune import ENDLESS, SLOW, UNSUPPORTED
from fastapi import FastAPI, Response
from fastapi.responses import PlainTextResponse, StreamingResponse
from pydantic import BaseModel
from samples import ROBUSTNESS, altered, tuning
from serving import served

from service.analyses.decouple import DecouplingRequest
from service.analyses.integrity import IntegrityRequest
from service.analyses.interaction import InteractionRequest
from service.analyses.parallel_drives import ParallelDrivesRequest
from service.analyses.relay import RelayExperimentRequest
from service.analyses.step_response import StepResponseRequest
from service.client import Client, JobEndedError, ServiceError, ServiceUnreachableError
from service.configuration import Configuration
from service.http.app import create_app
from service.keys import KeyFile, Scope
from service.schemas import TuningRequest
from service.schemas.jobs import JobProgress


def connect(http: httpx.Client) -> Client:
    """Return a client of the same service, once that listens."""
    http.get("/")
    return Client(str(http.base_url))


@pytest.fixture
def mutune(client: httpx.Client) -> Iterator[Client]:
    """Client of the running service."""
    with connect(client) as mutune:
        yield mutune


def test_tune_returns_the_result(mutune: Client) -> None:
    """Submitting and waiting are one call."""
    assert mutune.tune(tuning(seed=8001)).tau_p == 8001


def test_request_model_and_mapping_are_the_same(mutune: Client) -> None:
    """A request may be a model or its JSON object."""
    model = TuningRequest.model_validate(tuning(seed=8002))
    assert mutune.submit(model).request == mutune.submit(tuning(seed=8002)).request


def test_progress_is_told_while_waiting(mutune: Client) -> None:
    """The callback hears of a rising fraction and of the best value."""
    heard: list[JobProgress] = []
    job = mutune.submit(tuning(ENDLESS, starts=2))

    def hear(progress: JobProgress) -> None:
        heard.append(progress)
        if len(heard) == 3:
            mutune.cancel(job.id)

    assert mutune.wait(job.id, hear).status == "cancelled"
    fractions = [progress.fraction for progress in heard]
    assert fractions == sorted(fractions)
    assert any(0 < progress.fraction < 1 and progress.best for progress in heard)


def test_same_idempotency_key_gives_the_same_job(mutune: Client) -> None:
    """A submission repeated under its key starts nothing new."""
    first = mutune.submit(tuning(seed=8003), "key of the client's test")
    assert mutune.submit(tuning(seed=8003), "key of the client's test").id == first.id


def test_cancelled_job_ends(mutune: Client) -> None:
    """A cancelled job is waited for like any other, and then deleted."""
    job = mutune.submit(tuning(seed=ENDLESS))
    mutune.cancel(job.id)
    ended = mutune.wait(job.id)
    assert ended.status == "cancelled"
    assert ended == mutune.get(job.id)
    assert str(JobEndedError(ended)) == f"job {job.id} cancelled"
    assert mutune.forget(job.id) == ended
    with pytest.raises(ServiceError, match="There is no tuning"):
        mutune.get(job.id)


def test_failed_tuning_says_why(mutune: Client) -> None:
    """A tuning without result raises, with the service's reason."""
    with pytest.raises(JobEndedError, match="failed: open-loop unstable") as raised:
        mutune.tune(tuning(seed=UNSUPPORTED))
    assert raised.value.job.error is not None
    assert raised.value.job.error.errors[0].pointer == "/plant/process/den"


def test_refused_request_names_the_field(mutune: Client) -> None:
    """The service's problem reaches the caller."""
    with pytest.raises(ServiceError, match="/plant/n") as raised:
        mutune.submit(altered(tuning(), "/plant/n", 0))
    assert raised.value.status == 422
    assert raised.value.problem is not None
    assert [fault.pointer for fault in raised.value.problem.errors] == ["/plant/n"]


def test_robustness_is_answered(mutune: Client) -> None:
    """The published settings reach mu = 1 at their published time constant."""
    peaks = mutune.robustness(ROBUSTNESS).peaks
    assert peaks is not None
    assert peaks.robust_performance.value == pytest.approx(1.00034840, abs=1e-7)


@pytest.mark.parametrize(
    ("method", "request_model", "reads"),
    [
        ("integrity", IntegrityRequest, lambda result: result.stable is True),
        ("interaction", InteractionRequest, lambda result: result.recommended.inputs == [0, 1]),
        ("decoupling", DecouplingRequest, lambda result: len(result.loops) == 2),
        ("parallel_drives", ParallelDrivesRequest, lambda result: result.analysis.stable),
        ("step_response", StepResponseRequest, lambda result: result.end == "complete"),
        ("relay_experiment", RelayExperimentRequest, lambda r: r.behaviour == "limit_cycle"),
    ],
)
def test_analyses_are_answered(
    mutune: Client,
    method: str,
    request_model: type[BaseModel],
    reads: Callable[[Any], object],
) -> None:
    """Each analysis takes the example of its documentation and returns its result model."""
    (example,) = request_model.model_json_schema()["examples"]
    assert reads(getattr(mutune, method)(example))


def test_service_that_is_not_there_is_named() -> None:
    """Nothing listens: the address is in the message."""
    with (
        Client("http://127.0.0.1:9") as nobody,
        pytest.raises(ServiceUnreachableError, match=r"127\.0\.0\.1:9"),
    ):
        nobody.get("0" * 32)


def test_answer_of_a_proxy_is_reported_by_its_status() -> None:
    """An error that is no problem document is still a ServiceError."""
    app = FastAPI()

    @app.get("/v1/tunings/{job_id}")
    def get(job_id: str) -> PlainTextResponse:
        return PlainTextResponse(f"no upstream for {job_id}", status_code=502)

    with (
        served(app) as proxy,
        connect(proxy) as mutune,
        pytest.raises(ServiceError, match="502") as raised,
    ):
        mutune.get("0" * 32)
    assert raised.value.problem is None


def test_results_of_a_batch_come_in_order(mutune: Client) -> None:
    """Each item has its result or its error; the slow first one holds its place."""
    requests = [tuning(seed=SLOW, starts=20), tuning(seed=UNSUPPORTED), tuning(seed=8005)]
    batch = mutune.submit_batch(requests, "batch of the client's test")
    assert mutune.submit_batch(requests, "batch of the client's test").id == batch.id
    items = list(mutune.results(batch.id))
    assert [item.index for item in items] == [0, 1, 2]
    assert [item.result.tau_p if item.result else None for item in items] == [SLOW, None, 8005]
    assert items[1].error is not None
    assert items[1].error.detail == "open-loop unstable"


def test_results_of_a_batch_as_a_table(mutune: Client) -> None:
    """Comma-separated values once all have ended, a row a request."""
    batch = mutune.submit_batch([tuning(seed=SLOW, starts=21), tuning(seed=8010)])
    lines = mutune.table(batch.id).splitlines()
    assert lines[0].startswith("line,job,search.seed,")
    assert [line.split(",")[0] for line in lines] == ["line", "1", "2"]
    assert [item.index for item in mutune.results(batch.id, curves=False)] == [0, 1]


def test_results_outlive_a_restart_of_the_service(client: httpx.Client, mutune: Client) -> None:
    """A stream of results that breaks off is taken up at the next item."""
    batch = mutune.submit_batch([tuning(seed=8006), tuning(seed=8007)])
    whole = list(mutune.results(batch.id))
    app, starts = FastAPI(), list[int]()

    @app.get("/v1/batches/{batch_id}")
    def get(batch_id: str) -> Response:
        return PlainTextResponse(client.get(f"/v1/batches/{batch_id}").text)

    @app.get("/v1/batches/{batch_id}/results")
    def results(batch_id: str, start: int) -> Response:
        starts.append(start)
        text = client.get(f"/v1/batches/{batch_id}/results?start={start}").text
        if len(starts) == 1:
            return PlainTextResponse("restarting", status_code=503)
        return PlainTextResponse(text.splitlines(keepends=True)[0])

    with served(app) as restarted, connect(restarted) as waiting:
        assert list(waiting.results(batch.id)) == whole
    assert starts == [0, 0, 1]


def test_api_key_is_sent(tmp_path: Path) -> None:
    """A service with keys knows the client by its key."""
    keys = KeyFile(tmp_path / "keys.jsonl")
    key = keys.create("test", tuple(Scope))
    configuration = Configuration(
        data_dir=tmp_path, workers=1, api_keys_file=tmp_path / "keys.jsonl"
    )
    with served(create_app(configuration)) as http:
        http.get("/healthz")
        for api_key, status in ((None, 401), (key, 404)):
            with (
                Client(str(http.base_url), api_key) as mutune,
                pytest.raises(ServiceError) as raised,
            ):
                mutune.get("0" * 32)
            assert raised.value.status == status


def test_waiting_outlives_a_restart_of_the_service(client: httpx.Client, mutune: Client) -> None:
    """A stream that breaks off, or a proxy's 503, is taken up again until the job is done."""
    done = mutune.wait(mutune.submit(tuning(seed=8004)).id)
    app, calls = FastAPI(), count()

    async def broken() -> AsyncIterator[str]:
        yield 'event: progress\ndata: {"progress": {"fraction": 0.5, "best": null}}\n\n'
        message = "the connection breaks"
        raise ConnectionError(message)

    @app.get("/v1/tunings/{job_id}/events")
    def events(job_id: str) -> Response:
        match next(calls):
            case 0:
                return StreamingResponse(broken())
            case 1:
                return PlainTextResponse("restarting", status_code=503)
        return PlainTextResponse(client.get(f"/v1/tunings/{job_id}/events").text)

    heard: list[JobProgress] = []
    with served(app) as restarted, connect(restarted) as waiting:
        assert waiting.wait(done.id, heard.append) == done
    assert heard[0].fraction == 0.5
