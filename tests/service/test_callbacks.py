"""Notices of ends: to whom, signed, tried again, and to nobody else."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from fake_tune import BROKEN
from pydantic import ValidationError
from real import until
from samples import tuning
from serving import served

from service.configuration import Configuration
from service.http import notices
from service.http.app import create_app
from service.jobs import callbacks

SECRET = b"0123456789abcdef0123456789abcdef"


class Receiver:
    """An HTTP server that answers as it is told, and keeps what it got."""

    def __init__(self) -> None:
        self.answers: list[int] = []
        self.got: list[tuple[dict[str, str], bytes]] = []
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:  # the base class's name
                body = self.rfile.read(int(self.headers["content-length"]))
                receiver.got.append((dict(self.headers.items()), body))
                status = receiver.answers.pop(0) if receiver.answers else 204
                self.send_response(status)
                if status == 302:
                    self.send_header("Location", f"{receiver.url}/elsewhere")
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/hooks"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """Stop."""
        self._server.shutdown()
        self._server.server_close()

    def about(self, subject: str) -> list[tuple[dict[str, str], dict[str, Any]]]:
        """Return headers and documents of the notices of a job or batch."""
        found = [(headers, json.loads(body)) for headers, body in self.got]
        return [one for one in found if one[1]["data"]["id"] == subject]


@pytest.fixture(scope="module")
def receiver() -> Iterator[Receiver]:
    """Return a receiver."""
    found = Receiver()
    yield found
    found.close()


@pytest.fixture(scope="module")
def client(
    _fake_tuner: None, receiver: Receiver, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[httpx.Client]:
    """Client of a service that may call the receiver."""
    folder = tmp_path_factory.mktemp("callbacks")
    (folder / "secret").write_bytes(SECRET + b"\n")
    configuration = Configuration(
        data_dir=folder / "data",
        workers=1,
        callback_urls=(receiver.url,),
        callback_key_file=folder / "secret",
    )
    with served(create_app(configuration)) as client:
        yield client


def test_ends_are_told_and_signed(client: httpx.Client, receiver: Receiver) -> None:
    """Success, failure and the end of a batch, each once; the signature is over id, time, body."""
    headers = {"Callback-URL": f"{receiver.url}/a"}
    made = [
        client.post("/v1/tunings", json=tuning(seed), headers=headers).json()["id"]
        for seed in (0, BROKEN)
    ]
    again = client.post("/v1/tunings", json=tuning(0), headers=headers).json()["id"]
    body = {"tunings": [tuning(31), tuning(32)]}
    batch = client.post("/v1/batches", json=body, headers=headers).json()["id"]
    until(lambda: all(receiver.about(subject) for subject in (*made, again, batch)), "notices")
    told = [receiver.about(subject)[0][1] for subject in (*made, batch)]
    assert [one["type"] for one in told] == ["tuning.ended", "tuning.ended", "batch.ended"]
    assert [one["data"]["status"] for one in told] == ["succeeded", "failed", "finished"]
    assert told[0]["data"]["link"] == f"/v1/tunings/{made[0]}"
    for head, text in receiver.got:
        signed = f"{head['webhook-id']}.{head['webhook-timestamp']}.".encode() + text
        digest = base64.b64encode(hmac.new(SECRET, signed, hashlib.sha256).digest()).decode()
        assert head["webhook-signature"] == f"v1,{digest}"


def test_receiver_that_fails_is_told_again(
    client: httpx.Client, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a fault, and after a redirect, which is not followed; never after it has answered."""
    monkeypatch.setattr(callbacks, "WAITS", (0.0,) * 8)
    receiver.answers[:] = [500, 302]
    headers = {"Callback-URL": receiver.url}
    job = client.post("/v1/tunings", json=tuning(41), headers=headers).json()["id"]
    until(lambda: len(receiver.about(job)) == 3, "the third try")
    after = client.post("/v1/tunings", json=tuning(42), headers=headers).json()["id"]
    until(lambda: receiver.about(after), "the next notice")
    assert len(receiver.about(job)) == 3
    assert len({head["webhook-id"] for head, _ in receiver.about(job)}) == 1


def test_url_that_is_not_allowed_is_refused(client: httpx.Client, receiver: Receiver) -> None:
    """Before anything is accepted."""
    for path, body in (("/v1/tunings", tuning(51)), ("/v1/batches", {"tunings": [tuning(51)]})):
        headers = {"Callback-URL": receiver.url.replace("hooks", "other")}
        refused = client.post(path, json=body, headers=headers)
        assert refused.status_code == 422
        assert refused.json()["type"] == "urn:mutune:problem:invalid-parameter"


@pytest.mark.parametrize(
    ("url", "allowed"),
    [
        ("https://plant.example/hooks", True),
        ("https://plant.example/hooks/a?b=c", True),
        ("https://PLANT.example/hooks/", True),
        ("https://plant.example/hooks2", False),
        ("https://plant.example/hooks/../admin", False),
        ("https://plant.example/hooks/%2e%2E/admin", False),
        ("https://plant.example/hooks/..\\admin", False),
        ("http://plant.example/hooks", False),
        ("https://plant.example:444/hooks", False),
        ("https://plant.example.evil.example/hooks", False),
        ("https://user@plant.example/hooks", False),
        ("https://plant.example@evil.example/hooks", False),
        ("https://plant.example/hooks#x", False),
        ("https://plant.example/hooks\r\nX: y", False),
        ("https://plant.example:x/hooks", False),
        ("file:///hooks", False),
        ("//plant.example/hooks", False),
        ("", False),
    ],
)
def test_only_urls_below_an_allowed_one(url: str, allowed: bool) -> None:
    """Same scheme, host and port, and a path below, however it is written."""
    assert notices.is_allowed(url, ("https://plant.example/hooks",)) is allowed


def test_callbacks_need_a_secret_that_is_long_enough(tmp_path: Path) -> None:
    """A service that would send what anybody could have sent does not start."""
    short = tmp_path / "short"
    short.write_text("secret\n")
    for given in (None, short, tmp_path / "none"):
        with pytest.raises(ValidationError, match="MUTUNE_CALLBACK_KEY_FILE"):
            Configuration(callback_urls=("https://plant.example",), callback_key_file=given)
    with pytest.raises(ValidationError, match="MUTUNE_CALLBACK_URLS"):
        Configuration(callback_urls=("ftp://plant.example",), callback_key_file=short)
