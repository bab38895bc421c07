"""A copy of the database becomes a service again; the first start says what it is doing."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

import postgres
import pytest
from fake_tune import SLOW
from real import until
from samples import tuning
from serving import served

from service.configuration import Configuration
from service.http.app import create_app
from service.jobs import forking

WAIT = {"Prefer": "wait=60"}


def restored(old: Configuration, new: Configuration, copy: Callable[[], None]) -> None:
    """Check that the database of `old`, copied while it works, is that of a service `new`."""
    with served(create_app(old)) as client:
        done = client.post("/v1/tunings", json=tuning(61), headers=WAIT).json()
        running = client.post("/v1/tunings", json=tuning(SLOW, starts=150)).json()["links"]["self"]
        waiting = client.post("/v1/tunings", json=tuning(62)).json()["links"]["self"]
        until(lambda: client.get(running).json()["status"] == "running", "a job that runs")
        copy()
        client.delete(running)
    with served(create_app(new)) as client:
        assert client.get(done["links"]["self"]).json() == done
        for path in (running, waiting):
            until(lambda path=path: client.get(path).json()["status"] == "succeeded", path)


@pytest.mark.usefixtures("_fake_tuner")
def test_copy_of_the_file_made_while_it_works_is_restored(tmp_path: Path) -> None:
    """Results are there to the last digit, and what was running or waiting runs again."""
    first, second = tmp_path / "first", tmp_path / "second"
    second.mkdir()

    def copy() -> None:
        with (
            closing(sqlite3.connect(first / "mutune.sqlite3")) as source,
            closing(sqlite3.connect(second / "mutune.sqlite3")) as target,
        ):
            source.backup(target)

    restored(*(Configuration(data_dir=each, workers=1) for each in (first, second)), copy)


@pytest.mark.usefixtures("_fake_tuner")
def test_dump_of_postgresql_made_while_it_works_is_restored(tmp_path: Path) -> None:
    """As a file is."""
    with postgres.cluster() as first, postgres.cluster() as second:
        configurations = (
            Configuration(data_dir=tmp_path, database_url=each, workers=1)
            for each in (first, second)
        )
        restored(*configurations, partial(postgres.copy, first, second))


def test_process_that_is_started_first_tells_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through a file in memory, which needs no folder; nothing once it is done."""
    monkeypatch.setattr(forking, "_kept", {})
    monkeypatch.setenv("MUTUNE_START_PROGRESS", "")
    assert forking.progress() is None
    forking.listen()
    for text, told in (("compiling", "compiling"), ("", None)):
        program = f"from service.jobs import forking; forking.tell({text!r})"
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        subprocess.run([sys.executable, "-c", program], check=True, env=environment)  # noqa: S603 - our own
        assert forking.progress() == told


def test_progress_that_nobody_hears_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process that asked for it may have gone, or there is none."""
    monkeypatch.setenv("MUTUNE_START_PROGRESS", "/proc/0/fd/9")
    forking.tell("compiling")
    monkeypatch.delenv("MUTUNE_START_PROGRESS")
    forking.tell("compiling")
