"""API keys: who may do what, and what others see of it."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from fake_tune import ENDLESS
from real import until
from samples import ROBUSTNESS, tuning
from serving import served

from service.configuration import Configuration
from service.http.access import RateLimiter
from service.http.app import create_app
from service.keys import Key, KeyFile, KeyFileError, Scope


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> KeyFile:
    """Return an empty file of keys."""
    return KeyFile(tmp_path_factory.mktemp("keys") / "keys.jsonl")


@pytest.fixture(scope="module")
def client(
    _fake_tuner: None, keys: KeyFile, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[httpx.Client]:
    """Client of a service with keys."""
    configuration = Configuration(
        data_dir=tmp_path_factory.mktemp("data"),
        workers=1,
        api_keys_file=keys._path,  # noqa: SLF001 - the fixture's own file
        requests_per_minute=60,
        max_queued=2,
        max_time_limit=100,
    )
    with served(create_app(configuration)) as client:
        yield client


def bearer(keys: KeyFile, *scopes: Scope) -> dict[str, str]:
    """Return the header of a new key."""
    return {"Authorization": f"Bearer {keys.create('test', scopes or tuple(Scope))}"}


@pytest.mark.parametrize(
    "authorization", [None, "Bearer x", "Bearer mutune_0_0", "Basic eDp5", "Bearer"]
)
def test_request_without_a_valid_key_is_401(
    client: httpx.Client, authorization: str | None
) -> None:
    """Whatever is not a key is refused, and the answer says what is needed."""
    headers = {} if authorization is None else {"Authorization": authorization}
    for response in (
        client.get("/v1/tunings", headers=headers),
        client.post("/v1/robustness", json=ROBUSTNESS, headers=headers),
    ):
        assert response.status_code == 401
        assert response.headers["www-authenticate"] == "Bearer"
        assert response.json()["type"] == "urn:mutune:problem:unauthorized"


def test_health_and_documentation_need_no_key(client: httpx.Client) -> None:
    """Probes and documentation are open; measurements are not."""
    for path in ("/healthz", "/openapi.json", "/docs"):
        assert client.get(path).status_code == 200
    assert client.get("/metrics").status_code == 401


def test_scope_limits_what_a_key_may_do(client: httpx.Client, keys: KeyFile) -> None:
    """A reading key looks and does not start."""
    reader = bearer(keys, Scope.READ)
    assert client.get("/v1/tunings", headers=reader).status_code == 200
    refused = client.post("/v1/tunings", json=tuning(), headers=reader)
    assert refused.status_code == 403


def test_job_of_one_key_is_404_to_another(client: httpx.Client, keys: KeyFile) -> None:
    """Neither the job nor its events exist for another key, and lists are apart."""
    ann, bob = bearer(keys), bearer(keys)
    path = client.post("/v1/tunings", json=tuning(), headers=ann).headers["location"]
    assert client.get(path, headers=ann).status_code == 200
    for method, where in (("get", path), ("delete", path), ("get", f"{path}/events")):
        assert client.request(method, where, headers=bob).status_code == 404
    assert client.get("/v1/tunings", headers=bob).json()["items"] == []


def test_revoked_key_is_refused_at_once(client: httpx.Client, keys: KeyFile) -> None:
    """The service reads its file of keys again when it changes."""
    header = bearer(keys)
    assert client.get("/v1/tunings", headers=header).status_code == 200
    assert keys.revoke(header["Authorization"].split("_")[1])
    assert client.get("/v1/tunings", headers=header).status_code == 401


def test_too_many_requests_are_429(client: httpx.Client, keys: KeyFile) -> None:
    """A key that asks too often is told when to come back; another key is not affected."""
    busy = bearer(keys)
    answers = [client.get("/v1/tunings", headers=busy) for _ in range(70)]
    refused = [answer for answer in answers if answer.status_code == 429]
    assert refused
    assert int(refused[0].headers["retry-after"]) >= 1
    assert client.get("/v1/tunings", headers=bearer(keys)).status_code == 200


def test_full_queue_is_429(client: httpx.Client, keys: KeyFile) -> None:
    """A batch beyond the quota is refused as a whole, with a time to come back."""
    header = bearer(keys)
    body = {"tunings": [tuning(seed=number) for number in range(20, 23)]}
    response = client.post("/v1/batches", json=body, headers=header)
    assert response.status_code == 429
    assert "retry-after" in response.headers
    assert client.get("/v1/tunings", headers=header).json()["items"] == []


def test_time_limit_beyond_the_service_is_refused(client: httpx.Client, keys: KeyFile) -> None:
    """A job that may run longer than the service permits is a 422 problem."""
    request = tuning(time_limit=101)
    response = client.post("/v1/tunings", json=request, headers=bearer(keys))
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == "/search/time_limit"


def test_file_of_keys_holds_no_token(keys: KeyFile) -> None:
    """What the file holds does not open the service."""
    token = keys.create("eve", [Scope.READ])
    secret = token.split("_", 2)[2]
    text = keys._path.read_text()  # noqa: SLF001 - the fixture's own file
    assert secret not in text
    key = keys.verify(token)
    assert isinstance(key, Key)
    assert keys.verify(f"mutune_{key.id}_{key.digest}") is None
    assert keys.verify(token.replace("mutune", "other")) is None


def test_file_that_holds_something_else_is_refused(tmp_path: Path) -> None:
    """A damaged file of keys is an error, not an empty one."""
    path = tmp_path / "keys"
    path.write_text("hello\n")
    with pytest.raises(KeyFileError, match="not a file of API keys"):
        KeyFile(path).all()


def test_bucket_refills_at_its_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """A caller may spend a minute's requests at once, and then as many as come back."""
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    limiter = RateLimiter(60)
    assert [limiter.spend("ann") for _ in range(60)] == [0.0] * 60
    assert limiter.spend("ann") == pytest.approx(1)
    now = 1.5
    assert limiter.spend("ann") == 0
    assert limiter.spend("ann") == pytest.approx(0.5)
    assert limiter.spend("bob") == 0


@pytest.mark.usefixtures("_fake_tuner")
@pytest.mark.parametrize("as_batch", [False, True])
def test_caller_with_little_work_does_not_wait_for_one_with_much(
    as_batch: bool, tmp_path: Path
) -> None:
    """Two workers, four tunings without end of one key: that of another begins at once."""
    keys = KeyFile(tmp_path / "keys.jsonl")
    configuration = Configuration(
        data_dir=tmp_path,
        workers=2,
        api_keys_file=tmp_path / "keys.jsonl",
    )
    busy, other = bearer(keys), bearer(keys)
    long = [tuning(ENDLESS, starts=1 + number) for number in range(4)]
    with served(create_app(configuration)) as client:

        def states(headers: dict[str, str]) -> list[str]:
            found = client.get("/v1/tunings", headers=headers).json()["items"]
            return sorted(each["status"] for each in found)

        if as_batch:
            links = client.post("/v1/batches", json={"tunings": long}, headers=busy).json()["links"]
            begun = [links["self"]]
        else:
            begun = [
                client.post("/v1/tunings", json=each, headers=busy).json()["links"]["self"]
                for each in long
            ]
        until(lambda: states(busy) == ["queued"] * 2 + ["running"] * 2, "two jobs that run")
        answer = client.post("/v1/tunings", json=tuning(77), headers={**other, "Prefer": "wait=60"})
        assert answer.json()["status"] == "succeeded"
        assert "queued" in states(busy)
        for path in begun:
            client.delete(path, headers=busy)
        until(lambda: set(states(busy)) == {"cancelled"}, "the end of all")
