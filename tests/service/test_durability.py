"""Accepted work survives the violent death of every part, and is done exactly once."""

import json
import os
import random
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from fake_tune import SLOW
from real import Service, until
from samples import tuning


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """Folder of a service, whose log is shown when the test fails."""
    yield tmp_path
    log = tmp_path / "service.log"
    print(log.read_text()[-10_000:] if log.exists() else "no log")  # noqa: T201 - see above


def digits(result: dict[str, Any]) -> dict[str, Any]:
    """Return what must be the same however often a job was interrupted."""
    return {key: value for key, value in result.items() if key != "search"}


def test_no_job_is_lost_or_done_twice_whoever_is_killed(folder: Path) -> None:
    """100 jobs, 12 random kills of workers and of the service: all end once, same digits."""
    chance = random.Random(4)  # noqa: S311 - which process is killed need not be unpredictable
    victims = ["service"] * 2 + ["worker"] * 10
    chance.shuffle(victims)
    service = Service(folder, MUTUNE_MAX_ATTEMPTS="20")  # the kills are not the jobs' fault
    ended = []
    try:
        until(service.is_ready, "the service")
        tunings = [tuning(SLOW, starts=5 + number) for number in range(50)]
        tunings += [tuning(seed=100 + number) for number in range(30)]
        batch = service.client.post("/v1/batches", json={"tunings": tunings}).json()
        jobs = [
            service.client.post("/v1/tunings", json=tuning(500 + number)).json()["id"]
            for number in range(20)
        ]
        for victim in victims:
            done = _finished(service, batch)
            if victim == "service":
                service.kill()
                service.wait_for_children()
                service.end()
                service = Service(folder, MUTUNE_MAX_ATTEMPTS="20")
                until(service.is_ready, "the service")
            else:
                until(service.worker_pids, "a worker")
                with suppress(ProcessLookupError):
                    os.kill(chance.choice(service.worker_pids()), signal.SIGKILL)
            until(lambda: _finished(service, batch) > done, "progress")  # noqa: B023 - used at once
        lines = service.client.get(batch["links"]["results"]).text.splitlines()
        ended = [json.loads(line) for line in lines]
        singles = [service.client.get(f"/v1/tunings/{job}").json() for job in jobs]
        counts = service.client.get(batch["links"]["self"]).json()["states"]
    finally:
        service.end()
    assert [line["index"] for line in ended] == list(range(80))
    assert [line["result"]["tau_p"] for line in ended] == [
        float(item["search"]["seed"]) for item in tunings
    ]
    assert counts["succeeded"] == 80
    assert [job["result"]["tau_p"] for job in singles] == [500.0 + number for number in range(20)]
    assert len({json.dumps(digits(line["result"])) for line in ended[:50]}) == 1


def _finished(service: Service, batch: dict[str, Any]) -> int:
    states = service.client.get(batch["links"]["self"]).json()["states"]
    return sum(states[name] for name in ("succeeded", "failed", "cancelled", "timed_out"))


def test_stopped_service_puts_its_jobs_back(folder: Path) -> None:
    """SIGTERM ends streams cleanly and the process soon; the running job runs again."""
    service = Service(folder)
    try:
        until(service.is_ready, "the service")
        job = service.client.post("/v1/tunings", json=tuning(SLOW, starts=150)).json()
        path = job["links"]["self"]
        until(lambda: service.client.get(path).json()["status"] == "running", "the job to run")
        with service.client.stream("GET", job["links"]["events"]) as stream:
            lines = stream.iter_lines()
            next(lines)
            service.signal(signal.SIGTERM)
            rest = list(lines)  # ends without a protocol error
        assert not any("done" in line for line in rest)
        assert service.wait() in {0, -signal.SIGTERM}  # uvicorn passes the signal on
        service.wait_for_children()
    finally:
        service.end()
    service = Service(folder)
    try:
        until(service.is_up, "the service")
        with service.client.stream("GET", job["links"]["events"]) as stream:
            events = [line for line in stream.iter_lines() if line.startswith("event")]
        assert events[-1] == "event: done"
        assert service.client.get(path).json()["status"] == "succeeded"
    finally:
        service.end()
