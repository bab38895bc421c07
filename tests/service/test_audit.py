"""Who did what: the trail of acts, keys that end and keys with a new secret."""

from __future__ import annotations

import json
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from real import until
from samples import tuning
from serving import captured_logs, served
from typer.testing import CliRunner

from service.audit import Trail
from service.cli.commands import app
from service.configuration import Configuration
from service.http.app import create_app
from service.keys import KeyFile, Scope

FORMS = {"loops": [{"gain": 1.0, "integral_time": 2.0}]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder for keys and trail."""
    return tmp_path_factory.mktemp("audited")


@pytest.fixture(scope="module")
def client(_fake_tuner: None, folder: Path) -> Iterator[httpx.Client]:
    """Client of a service with keys and a trail."""
    configuration = Configuration(
        data_dir=folder / "data",
        workers=1,
        api_keys_file=folder / "keys",
        audit_file=folder / "audit",
        requests_per_minute=60,
    )
    with served(create_app(configuration)) as client:
        yield client


def header(token: str) -> dict[str, str]:
    """Return the header that shows a token."""
    return {"Authorization": f"Bearer {token}"}


def trail(folder: Path) -> list[dict[str, Any]]:
    """Return the acts so far."""
    return [json.loads(line) for line in (folder / "audit").read_text().splitlines()]


def test_acts_are_told_with_key_job_and_address(client: httpx.Client, folder: Path) -> None:
    """What starts, computes, cancels and is refused; not what only looks."""
    token = KeyFile(folder / "keys").create("ann", tuple(Scope))
    key = token.split("_")[1]
    job = client.post("/v1/tunings", json=tuning(), headers=header(token))
    path = job.headers["location"]
    client.get(path, headers=header(token))
    client.post("/v1/controller-forms", json=FORMS, headers=header(token))
    client.post("/v1/controller-forms", json={}, headers=header(token))
    client.delete(path, headers=header(token))
    client.get("/v1/tunings", headers=header("mutune_0_0"))
    until(lambda: trail(folder)[-1]["status"] == 401, "the last act")
    acts = trail(folder)
    assert [(act["action"], act.get("key")) for act in acts] == [
        ("POST /v1/tunings", key),
        ("POST /v1/controller-forms", key),
        ("DELETE /v1/tunings/{job_id}", key),
        ("GET /v1/tunings", None),
    ]
    assert acts[0]["job"] == acts[2]["job"] == path.rpartition("/")[2]
    assert {act["address"] for act in acts} == {"127.0.0.1"}
    assert acts[0]["request_id"] == job.headers["x-request-id"]
    assert acts[0]["time"] <= acts[-1]["time"]
    assert stat.S_IMODE((folder / "audit").stat().st_mode) == 0o600
    assert token.split("_", 2)[2] not in (folder / "audit").read_text()


def test_log_of_requests_has_the_key_and_no_secret(client: httpx.Client, folder: Path) -> None:
    """Also where somebody puts the token into a path."""
    token = KeyFile(folder / "keys").create("bob", tuple(Scope))
    with captured_logs() as entries:
        client.get("/v1/tunings", headers=header(token))
        client.get(f"/v1/tunings/{token}/events", headers=header(token))
        client.get(f"/{token}")
        client.delete(f"/v1/tunings/{token}", headers={"X-Request-Id": token})
        until(lambda: len(entries) > 3, "four lines")
    paths = {entry["path"]: entry.get("key") for entry in entries}
    key = token.split("_")[1]
    assert paths == {
        "/v1/tunings": key,
        "/v1/tunings/KEY/events": key,
        "/KEY": None,
        "/v1/tunings/KEY": None,
    }
    for told in (json.dumps(entries), (folder / "audit").read_text()):
        assert token.split("_", 2)[2] not in told


def test_answers_say_how_many_requests_are_left(client: httpx.Client, folder: Path) -> None:
    """One less with each, and none when it is refused."""
    token = KeyFile(folder / "keys").create("cleo", tuple(Scope))
    answers = [client.get("/v1/tunings", headers=header(token)) for _ in range(70)]
    assert {answer.headers["ratelimit-policy"] for answer in answers} == {'"key";q=60;w=60'}
    assert answers[0].headers["ratelimit"] == '"key";r=59;t=1'
    refused = next(answer for answer in answers if answer.status_code == 429)
    assert refused.headers["ratelimit"].startswith('"key";r=0;t=')


def test_key_ends_by_itself(client: httpx.Client, folder: Path) -> None:
    """From one second to the next, without a restart."""
    keys = KeyFile(folder / "keys")
    lasting = keys.create("a", tuple(Scope), lifetime=3600.0)
    ended = keys.create("b", tuple(Scope), lifetime=0.0)
    assert client.get("/v1/tunings", headers=header(lasting)).status_code == 200
    assert client.get("/v1/tunings", headers=header(ended)).status_code == 401


def test_new_secret_leaves_the_jobs_and_the_old_one_for_a_time(
    client: httpx.Client, folder: Path
) -> None:
    """Both open the same jobs while the grace lasts; without any the old one is out at once."""
    keys = KeyFile(folder / "keys")
    old = keys.create("dora", tuple(Scope))
    path = client.post("/v1/tunings", json=tuning(5), headers=header(old)).headers["location"]
    new = keys.rotate(old.split("_")[1], grace=3600.0)
    assert new is not None
    assert new.split("_")[1] == old.split("_")[1]
    for token in (old, new):
        assert client.get(path, headers=header(token)).status_code == 200
    newest = keys.rotate(old.split("_")[1], grace=0.0)
    assert newest is not None
    statuses = [client.get(path, headers=header(each)).status_code for each in (old, new, newest)]
    assert statuses == [401, 401, 200]
    assert keys.rotate("0" * 16, grace=0.0) is None


def test_commands_for_keys_leave_a_trail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made, changed and removed, by which user of the machine; the list says when each ends."""
    monkeypatch.setenv("MUTUNE_API_KEYS_FILE", str(tmp_path / "keys"))
    monkeypatch.setenv("MUTUNE_AUDIT_FILE", str(tmp_path / "audit"))
    runner = CliRunner()
    token = runner.invoke(app, ["keys", "create", "x", "--days", "0"]).output.strip()
    key = token.split("_")[1]
    assert "EXPIRED" in runner.invoke(app, ["keys", "list"]).output
    again = runner.invoke(app, ["keys", "rotate", key, "--days", "30"]).output.strip()
    assert KeyFile(tmp_path / "keys").verify(again) is not None
    assert "EXPIRED" not in runner.invoke(app, ["keys", "list"]).output
    assert runner.invoke(app, ["keys", "revoke", key]).exit_code == 0
    assert runner.invoke(app, ["keys", "rotate", key]).exit_code == 2
    acts = [json.loads(line) for line in (tmp_path / "audit").read_text().splitlines()]
    assert [act["action"] for act in acts] == ["create_key", "rotate_key", "revoke_key"]
    assert {act["key"] for act in acts} == {key}
    assert all(act["user"] for act in acts)


def test_act_that_cannot_be_written_is_in_the_log(tmp_path: Path) -> None:
    """With the reason; it has happened all the same."""
    with captured_logs() as entries:
        Trail(tmp_path / "none" / "audit").write(action="GET /", key="a")
    (entry,) = entries
    assert entry["log_level"] == "error"
    assert entry["action"] == "GET /"
    assert "No such file" in entry["reason"]
