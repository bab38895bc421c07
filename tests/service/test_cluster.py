"""Several processes: a Dask scheduler with workers that come and go, two services on PostgreSQL."""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import network
import postgres
import pytest
from certificates import certificates
from fake_tune import SLOW
from real import MUTUNE, Process, Service, free_port, until
from samples import tuning
from serving import served

from service.configuration import Configuration
from service.http.app import create_app
from service.jobs import engine


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Ends what a test has started."""
    with ExitStack() as stack:
        yield stack


def test_workers_and_scheduler_come_and_go_while_a_batch_runs(
    stack: ExitStack, tmp_path: Path
) -> None:
    """Killed workers and a killed scheduler cost time and nothing else."""
    address = f"tcp://127.0.0.1:{free_port()}"

    def scheduler() -> Process:
        command = (MUTUNE, "scheduler", "--port", address.rpartition(":")[2])
        process = Process(tmp_path / "scheduler.log", *command)
        stack.callback(process.end)
        return process

    def worker() -> Process:
        command = (MUTUNE, "worker", "--scheduler", address)
        process = Process(tmp_path / "worker.log", *command, MUTUNE_WORKERS="1")
        stack.callback(process.end)
        return process

    first_scheduler, first_worker = scheduler(), worker()
    service = Service(tmp_path, MUTUNE_SCHEDULER=address)
    stack.callback(service.end)
    until(service.is_ready, "the first worker")
    tunings = [tuning(SLOW, starts=30 + number) for number in range(12)]
    batch = service.client.post("/v1/batches", json={"tunings": tunings}).json()

    def finished() -> int:
        states = service.client.get(batch["links"]["self"]).json()["states"]
        assert states["failed"] == 0
        succeeded: int = states["succeeded"]
        return succeeded

    until(finished, "the first result")
    worker()
    first_worker.kill()
    at_the_loss = finished()
    until(lambda: finished() > at_the_loss + 1, "results of the second worker")
    first_scheduler.kill()
    scheduler()
    lines = service.client.get(batch["links"]["results"]).text.splitlines()
    assert [json.loads(line)["result"]["tau_p"] for line in lines] == [float(SLOW)] * 12


def test_worker_on_another_host_computes(stack: ExitStack, tmp_path: Path) -> None:
    """A worker that shares nothing but network and certificates with the others takes jobs.

    The other host is a network namespace behind a pair of interfaces.
    """
    stack.enter_context(network.changing())
    name, subnet = f"mutune-{os.getpid()}", f"10.{213 + os.getpid() % 32}.{os.getpid() % 251}"
    if shutil.which("ip") is None or not _ip("netns", "add", name):
        pytest.skip("network namespaces are not permitted here")
    stack.callback(_ip, "netns", "delete", name)  # the interfaces go with it
    inside = ("netns", "exec", name, "ip")
    assert _ip("link", "add", "mutune-test", "type", "veth", "peer", "eth0", "netns", name)
    assert _ip("address", "add", f"{subnet}.1/24", "dev", "mutune-test")
    assert _ip("link", "set", "mutune-test", "up")
    assert _ip(*inside, "address", "add", f"{subnet}.2/24", "dev", "eth0")
    assert _ip(*inside, "link", "set", "eth0", "up")
    port = str(free_port())
    encrypted = certificates(tmp_path)
    command = (MUTUNE, "scheduler", "--host", f"{subnet}.1", "--port", port)
    scheduler = Process(tmp_path / "scheduler.log", *command, **encrypted)
    stack.callback(scheduler.end)
    address = f"tls://{subnet}.1:{port}"
    elsewhere = ("ip", "netns", "exec", name, MUTUNE, "worker", "--scheduler", address)
    elsewhere += ("--host", f"{subnet}.2")
    worker = Process(tmp_path / "worker.log", *elsewhere, MUTUNE_WORKERS="1", **encrypted)
    stack.callback(worker.end)
    service = Service(tmp_path, MUTUNE_SCHEDULER=address, **encrypted)
    stack.callback(service.end)
    until(service.is_ready, "the worker")
    request = tuning(SLOW, starts=5)
    job = service.client.post("/v1/tunings", json=request, headers={"Prefer": "wait=60"}).json()
    assert job["result"]["tau_p"] == SLOW


def _ip(*arguments: str) -> bool:
    """Configure the network; return whether that was permitted."""
    command = ("ip", *arguments)
    return subprocess.run(command, capture_output=True, check=False).returncode == 0  # noqa: S603


def test_second_service_takes_over_when_the_first_is_killed(
    stack: ExitStack, tmp_path: Path
) -> None:
    """Of two services on one database one dispatches; jobs go on when it is killed."""
    url = stack.enter_context(postgres.cluster())
    services = []
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        service = Service(folder, MUTUNE_DATABASE_URL=url, MUTUNE_WORKERS="1")
        stack.callback(service.end)
        until(service.is_up, f"service {name}")
        services.append(service)
    first, second = services
    # The first one came first, so it leads; the second one accepts and shows all the same.
    until(first.is_ready, "its worker")
    tunings = [tuning(SLOW, starts=20 + number) for number in range(12)]
    batch = second.client.post("/v1/batches", json={"tunings": tunings}).json()
    until(lambda: _succeeded(second, batch["links"]["self"]) >= 3, "results")
    first.kill()
    lines = second.client.get(batch["links"]["results"]).text.splitlines()
    assert [json.loads(line)["index"] for line in lines] == list(range(12))
    assert all("result" in json.loads(line) for line in lines)


def _succeeded(service: Service, path: str) -> int:
    count: int = service.client.get(path).json()["states"]["succeeded"]
    return count


@pytest.mark.usefixtures("_fake_tuner")
def test_worker_of_another_version_gets_no_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker with another version of mutune is refused, and readiness names it."""
    monkeypatch.setattr(engine, "VERSION", "0.0.0")
    with served(create_app(Configuration(data_dir=tmp_path, workers=1))) as client:
        until(lambda: _readiness(client)["refused_workers"], "the refusal")
        assert client.get("/readyz").status_code == 503
        assert _readiness(client)["workers"] == 0
        job = client.post("/v1/tunings", json=tuning(), headers={"Prefer": "wait=1"}).json()
        assert job["status"] == "queued"


def _readiness(client: httpx.Client) -> dict[str, object]:
    document: dict[str, object] = client.get("/readyz").json()
    return document
