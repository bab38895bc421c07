"""How the service starts, or says in one line why it does not."""

from __future__ import annotations

import os
import signal
import socket
import sqlite3
import ssl
import stat
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import httpx
import pytest
from certificates import certificates
from fake_tune import ENDLESS
from real import MUTUNE, Process, Service, free_port, until
from samples import tuning


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Ends what a test has started."""
    with ExitStack() as stack:
        yield stack


def refused(stack: ExitStack, folder: Path, **environment: str) -> tuple[int, str]:
    """Return exit status and last line of a service that does not start."""
    service = Service(folder, **environment)
    stack.callback(service.end)
    status = service.wait()
    text = (folder / "service.log").read_text()
    assert "Traceback" not in text
    return status, text.splitlines()[-1]


def test_second_service_and_newer_database_and_private_files(
    stack: ExitStack, tmp_path: Path
) -> None:
    """Exit status 5 and the reason; the folder is this user's alone; SIGTERM ends streams."""
    first = Service(tmp_path, MUTUNE_WORKERS="1")
    stack.callback(first.end)
    until(first.is_ready, "the service")
    data = tmp_path / "data"
    assert stat.S_IMODE(data.stat().st_mode) == 0o700
    assert {stat.S_IMODE(file.stat().st_mode) for file in data.iterdir()} == {0o600}

    elsewhere = tmp_path / "second"
    elsewhere.mkdir()
    status, line = refused(stack, elsewhere, MUTUNE_DATA_DIR=str(data))
    assert status == 5
    assert "another mutune serves from" in line
    assert first.is_up()

    job = first.client.post("/v1/tunings", json=tuning(ENDLESS)).json()
    with first.client.stream("GET", job["links"]["events"]) as events:
        lines = events.iter_lines()
        next(lines)
        first.signal(signal.SIGTERM)
        for _ in lines:
            pass
    first.wait()

    with closing(sqlite3.connect(data / "mutune.sqlite3")) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
        connection.commit()
    status, line = refused(stack, tmp_path)
    assert status == 5
    assert "newer mutune" in line


def test_port_that_is_taken(stack: ExitStack, tmp_path: Path) -> None:
    """Exit status 5 and the address."""
    listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
    service = Service(tmp_path, port=listening.getsockname()[1])
    stack.callback(service.end)
    assert service.wait() == 5
    assert str(service.port) in (tmp_path / "service.log").read_text().splitlines()[-1]


@pytest.mark.parametrize(
    ("name", "value"),
    [("WORKERS", "abc"), ("WORKERS", "0"), ("CORS_ORIGINS", "abc"), ("TLS_CERT_FILE", "absent")],
)
def test_setting_that_cannot_be_is_named(
    stack: ExitStack, tmp_path: Path, name: str, value: str
) -> None:
    """Exit status 2, and the variable."""
    status, line = refused(stack, tmp_path, **{f"MUTUNE_{name}": value})
    assert status == 2
    assert line.startswith("error: ")
    assert "MUTUNE_" + name.partition("_")[0] in line


def test_database_that_never_answers(stack: ExitStack, tmp_path: Path) -> None:
    """It is waited for, as long as the settings say; then exit status 5, without the password."""
    url = f"postgresql+psycopg://user:secret@127.0.0.1:{free_port()}/mutune"
    status, line = refused(stack, tmp_path, MUTUNE_DATABASE_URL=url, MUTUNE_START_WAIT="1")
    assert status == 5
    assert "does not answer" in line
    text = (tmp_path / "service.log").read_text()
    assert "trying again" in text
    assert "secret" not in text


def test_https(stack: ExitStack, tmp_path: Path) -> None:
    """A certificate serves HTTPS."""
    files = certificates(tmp_path)
    port = free_port()
    service = Process(
        tmp_path / "service.log",
        *(MUTUNE, "serve", "--port", str(port)),
        *("--certfile", files["MUTUNE_TLS_CERT_FILE"], "--keyfile", files["MUTUNE_TLS_KEY_FILE"]),
        MUTUNE_DATA_DIR=str(tmp_path / "data"),
        MUTUNE_WORKERS="1",
    )
    stack.callback(service.end)
    context = ssl.create_default_context(cafile=files["MUTUNE_TLS_CA_FILE"])
    context.check_hostname = False

    def answers() -> bool:
        try:
            url = f"https://127.0.0.1:{port}/healthz"
            return httpx.get(url, verify=context).status_code == 200
        except httpx.TransportError:
            return False

    until(answers, "HTTPS")
    os.kill(service.pid, signal.SIGTERM)
    service.wait()
