"""What whoever runs the service relies on: refusals, logs, headers, many and slow clients."""

import json
import resource
import socket
import sqlite3
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest
from fake_tune import ENDLESS
from fastapi.testclient import TestClient
from pydantic import ValidationError
from real import PATIENCE, until
from samples import altered, tuning
from serving import captured_logs, served
from typer.testing import CliRunner

from service.cli.commands import app
from service.configuration import Configuration
from service.http.app import create_app
from service.jobs import database

PATH = "/v1/tunings"


def finished(client: httpx.Client, seed: int) -> str:
    """Return the path of a tuning that has ended, for a plant whose result is long."""
    request = altered(tuning(seed), "/plant/n", 200)
    request = altered(request, "/controller/arrangement", "identical")
    response = client.post(PATH, json=request, headers={"Prefer": "wait=60"})
    assert response.json()["status"] == "succeeded"
    return response.headers["location"]


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "plant.example"])  # noqa: S104
def test_address_open_to_others_without_keys_is_refused(
    host: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without API keys only this machine may call, unless --insecure says otherwise."""
    monkeypatch.delenv("MUTUNE_API_KEYS_FILE", raising=False)
    result = CliRunner().invoke(app, ["serve", "--host", host])
    assert result.exit_code == 2
    assert "no API keys are set" in result.output


def test_ended_tuning_known_to_the_caller_is_not_sent_again(client: httpx.Client) -> None:
    """An ended tuning has an ETag, and is 304 to whoever sends it; one that runs has none."""
    path = finished(client, 801)
    tag = client.get(path).headers["etag"]
    again = client.get(path, headers={"If-None-Match": tag})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == tag
    assert client.get(path, headers={"If-None-Match": 'W/"other"'}).status_code == 200
    running = client.post(PATH, json=tuning(ENDLESS)).headers["location"]
    assert "etag" not in client.get(running).headers
    client.delete(running)


def test_long_answers_are_compressed_and_streams_are_not(client: httpx.Client) -> None:
    """A client that takes gzip gets it, except where it reads line by line."""
    path = finished(client, 802)
    assert client.get(path).headers["content-encoding"] == "gzip"
    plain = client.get(path, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert "content-encoding" not in client.get(f"{path}/events").headers


def test_log_tells_no_content(client: httpx.Client) -> None:
    """A request is logged by method, path, status and time; not its query, body or key."""
    with captured_logs() as entries:
        client.post(
            f"{PATH}?token=of-the-query",
            json=tuning(803),
            headers={"Authorization": "Bearer of-the-header"},
        )
        client.post(PATH, json={"plant": "of-the-body"})
        # An answer may arrive before its line is written.
        until(lambda: len({entry.get("status") for entry in entries}) > 1, "two lines")
    told = [entry for entry in entries if entry["event"] == "request"]
    assert {tuple(sorted(entry)) for entry in told} == {
        ("event", "log_level", "method", "milliseconds", "path", "status")
    }
    assert {(entry["path"], entry["status"]) for entry in told} >= {(PATH, 202), (PATH, 422)}
    assert "of-the" not in json.dumps(entries)


@pytest.mark.usefixtures("_fake_tuner")
def test_locked_database_is_503_with_a_time_to_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While another program holds the file nothing is accepted, and nothing is half-done."""
    monkeypatch.setattr(database, "_BUSY_SECONDS", 0.05)
    with (
        served(create_app(Configuration(data_dir=tmp_path, workers=1))) as client,
        closing(sqlite3.connect(tmp_path / "mutune.sqlite3", isolation_level=None)) as holder,
    ):
        holder.execute("BEGIN IMMEDIATE")
        for path, body in ((PATH, tuning()), ("/v1/batches", {"tunings": [tuning(1), tuning(2)]})):
            refused = client.post(path, json=body)
            assert refused.status_code == 503
            assert int(refused.headers["retry-after"]) >= 1
            assert refused.json()["type"] == "urn:mutune:problem:unavailable"
        assert client.get(PATH).json()["items"] == []  # reading goes on
        holder.execute("ROLLBACK")
        accepted = client.post(PATH, json=tuning(), headers={"Prefer": "wait=60"})
        assert accepted.json()["status"] == "succeeded"
        assert len(client.get(PATH).json()["items"]) == 1


def test_a_thousand_followers_hear_the_end_and_hold_nobody_up(client: httpx.Client) -> None:
    """A thousand streams are open, most unread; others are answered, and all hear the end."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 8192), hard))
    followers = min(1000, (min(hard, 8192) - 500) // 2)  # both ends are in this process
    ahead = [tuning(ENDLESS, starts=1 + index) for index in range(10)]
    batch = client.post("/v1/batches", json={"tunings": ahead}).json()["links"]["self"]
    path = client.get(f"{PATH}?limit=1").json()["items"][0]["links"]["self"]  # the last in turn
    address = (client.base_url.host, client.base_url.port)
    with ExitStack() as stack:
        stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        streams = []
        for _ in range(followers):
            stream = stack.enter_context(socket.create_connection(address, timeout=PATIENCE))
            stream.sendall(f"GET {path}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            streams.append(stream)
        for stream in streams:
            assert stream.recv(17) == b"HTTP/1.1 200 OK\r\n"
        assert client.get(path).json()["status"] == "queued"
        assert finished(client, 804)
        client.delete(batch)
        for stream in streams:
            heard = b""
            while b"event: done" not in heard:
                heard = heard[-20:] + stream.recv(65536)


def test_contact_for_vulnerabilities(client: httpx.Client) -> None:
    """The administrator's, as RFC 9116 has it; without one there is no such file."""
    path = "/.well-known/security.txt"
    assert client.get(path).status_code == 404
    configuration = Configuration(security_contact="mailto:security@plant.example")
    other = TestClient(create_app(configuration), base_url="http://localhost")
    fields = dict(line.split(": ", 1) for line in other.get(path).text.splitlines())
    assert fields["Contact"] == "mailto:security@plant.example"
    assert datetime.fromisoformat(fields["Expires"]) > datetime.now(UTC)
    with pytest.raises(ValidationError, match="security_contact"):
        Configuration(security_contact="nobody")
