"""A PostgreSQL cluster of the tests' own, in a temporary folder, run by a user other than root."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_INSTALLED = sorted(Path("/usr/lib/postgresql").glob("*/bin"))


def _program(name: str) -> str | None:
    found = [str(folder / name) for folder in _INSTALLED if (folder / name).exists()]
    return found[-1] if found else shutil.which(name)


def copy(source: str, target: str) -> None:
    """Copy a database to an empty one, as an administrator would: by a dump."""
    dump, load = _program("pg_dump"), _program("psql")
    assert dump is not None
    assert load is not None
    urls = [url.replace("+psycopg", "") for url in (source, target)]
    made = subprocess.run([dump, urls[0]], check=True, stdout=subprocess.PIPE)  # noqa: S603 - ours
    quiet = [load, "--quiet", "--set", "ON_ERROR_STOP=1", urls[1]]
    subprocess.run(quiet, check=True, input=made.stdout, stdout=subprocess.DEVNULL)  # noqa: S603 - ours


def _run(*command: str) -> None:
    """Run as the user postgres where the tests run as root, which PostgreSQL refuses."""
    prefix = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
    subprocess.run([*prefix, *command], check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - ours


@contextmanager
def cluster() -> Iterator[str]:
    """Yield the SQLAlchemy URL of a fresh cluster; skip where PostgreSQL is not installed."""
    initdb, pg_ctl = _program("initdb"), _program("pg_ctl")
    if initdb is None or pg_ctl is None:
        pytest.skip("PostgreSQL is not installed")
    folder = Path(tempfile.mkdtemp(prefix="mutune-postgres-"))
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    data = str(folder / "data")
    try:
        _run(initdb, "-D", data, "-U", "mutune", "-A", "trust", "--no-sync", "-E", "UTF8")
        options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1 -c fsync=off"
        _run(pg_ctl, "-D", data, "-o", options, "-l", str(folder / "log"), "-w", "start")
        try:
            yield f"postgresql+psycopg://mutune@127.0.0.1:{port}/postgres"
        finally:
            _run(pg_ctl, "-D", data, "-m", "immediate", "-w", "stop")
    finally:
        shutil.rmtree(folder)
