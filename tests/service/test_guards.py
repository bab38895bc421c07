"""What is kept out: foreign names and pages, slow senders. HEAD, and callers who left."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from fake_tune import ENDLESS
from real import PATIENCE, until
from samples import ROBUSTNESS, tuning
from serving import captured_logs, served

from service.configuration import Configuration
from service.http import guards
from service.http.app import create_app
from service.schemas import parsing


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "evil.example:80"])
def test_name_of_elsewhere_is_refused(client: httpx.Client, host: str) -> None:
    """A page whose name was made to mean this machine can neither read nor start."""
    for request in (
        client.build_request("GET", "/v1/tunings"),
        client.build_request("POST", "/v1/tunings", json=tuning()),
    ):
        request.headers["host"] = host
        response = client.send(request)
        assert response.status_code == 421
        assert response.json()["type"] == "urn:mutune:problem:misdirected"


@pytest.mark.parametrize("host", ["localhost:8000", "127.0.0.1", "[::1]:8000", "192.0.2.7:1"])
def test_names_of_this_host_are_served(client: httpx.Client, host: str) -> None:
    """Addresses and localhost, with any port."""
    assert client.get("/v1/tunings", headers={"Host": host}).status_code == 200


def test_page_of_another_origin_may_not_write(client: httpx.Client) -> None:
    """Origin and Host must agree; without an Origin it is no page."""
    own = f"http://{client.base_url.netloc.decode()}"
    for origin, status in ((own, 200), ("http://evil.example", 403), ("null", 403)):
        response = client.post("/v1/robustness", json=ROBUSTNESS, headers={"Origin": origin})
        assert response.status_code == status


@pytest.mark.usefixtures("_fake_tuner")
def test_names_and_origins_can_be_permitted(tmp_path: Path) -> None:
    """The settings add to what is known."""
    configuration = Configuration(
        data_dir=tmp_path,
        workers=1,
        allowed_hosts=("mutune.example",),
        cors_origins=("https://page.example",),
    )
    with served(create_app(configuration)) as client:
        headers = {"Host": "mutune.example", "Origin": "https://page.example"}
        response = client.post("/v1/robustness", json=ROBUSTNESS, headers=headers)
        assert response.status_code == 200
        assert response.headers["access-control-allow-origin"] == "https://page.example"


@pytest.mark.parametrize("path", ["/", "/healthz", "/v1/tunings", "/openapi.json"])
def test_head_is_get_without_the_body(client: httpx.Client, path: str) -> None:
    """The same status and type, and nothing else."""
    response, full = client.head(path), client.get(path)
    assert (response.status_code, response.content) == (full.status_code, b"")
    assert response.headers["content-type"] == full.headers["content-type"]


def test_head_of_a_stream_ends(client: httpx.Client) -> None:
    """The events of a job that runs on: the head comes at once."""
    job = client.post("/v1/tunings", json=tuning(ENDLESS)).json()
    response = client.head(job["links"]["events"])
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/event-stream")
    client.delete(job["links"]["self"])


@pytest.fixture
def connection(client: httpx.Client) -> Iterator[socket.socket]:
    """Return a connection on which nothing has been sent."""
    address = (client.base_url.host, client.base_url.port)
    with socket.create_connection(address, timeout=PATIENCE) as connection:
        yield connection


def _head(length: int) -> bytes:
    return (
        b"POST /v1/robustness HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        b"Content-Length: %d\r\n\r\n" % length
    )


def test_body_that_comes_too_slowly_is_refused(
    connection: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Answered 408 in time, though something came again and again."""
    monkeypatch.setattr(guards, "_PATIENCE", 0.5)
    connection.sendall(_head(1000))
    while not select.select([connection], [], [], 0.1)[0]:
        connection.sendall(b" ")
    assert connection.recv(100).startswith(b"HTTP/1.1 408")


def test_caller_who_leaves_within_a_body_is_no_fault(
    client: httpx.Client, connection: socket.socket
) -> None:
    """The log has status 499 for it, and no error."""
    with captured_logs() as lines:
        connection.sendall(_head(1000) + b"{")
        time.sleep(0.2)
        connection.close()
        until(lambda: any(line.get("status") == 499 for line in lines), "the line in the log")
    assert all(line["log_level"] != "error" for line in lines)
    assert client.get("/healthz").status_code == 200


def _start(connection: socket.socket, *headers: bytes, body: bytes = b"") -> bytes:
    head = b"POST /v1/robustness HTTP/1.1\r\nHost: localhost\r\n" + b"\r\n".join(headers)
    connection.sendall(head + b"\r\n\r\n" + body)
    return connection.recv(12)


def test_head_that_is_too_large_is_refused(connection: socket.socket) -> None:
    """Also where it came in one piece."""
    assert _start(connection, b"X: " + b"a" * 40_000) == b"HTTP/1.1 431"


def test_body_of_two_lengths_is_refused(connection: socket.socket) -> None:
    """A proxy might believe one of them, and take the rest for another request."""
    lengths = b"Content-Length: 5", b"Transfer-Encoding: chunked"
    assert _start(connection, *lengths, body=b"0\r\n\r\n") == b"HTTP/1.1 400"


def test_words_are_found_for_the_first_faults_alone(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sixty thousand unknown fields are answered with twenty of them."""
    found = []
    names = parsing.field_names
    monkeypatch.setattr(parsing, "field_names", lambda *given: found.append(1) or names(*given))
    response = client.post("/v1/robustness", json={f"k{number}": 1 for number in range(60_000)})
    assert response.status_code == 422
    assert len(response.json()["errors"]) == 20
    assert len(found) <= 60


@pytest.mark.parametrize("media_type", ["application/json", "application/x-ndjson"])
def test_text_nested_without_end_is_a_fault_of_the_request(
    client: httpx.Client, media_type: str
) -> None:
    """In a batch too, whose faulty items are kept as they came."""
    deep = "[" * 100_000 + "]" * 100_000
    text = deep if media_type.endswith("ndjson") else f'{{"tunings": [{deep}]}}'
    headers = {"Content-Type": media_type}
    refused = client.post("/v1/batches", content=text, headers=headers)
    assert refused.status_code == 400
