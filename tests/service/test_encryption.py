"""Scheduler and workers run what they are sent: only by those who hold a certificate."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import cloudpickle
import psutil
import pytest
from certificates import certificates
from distributed import Security
from distributed.core import rpc
from real import MUTUNE, PATIENCE, Process, Service, free_port, until


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Ends what a test has started."""
    with ExitStack() as stack:
        yield stack


def ports(pid: int) -> set[int]:
    """Return the ports that a process and its descendants listen on."""
    processes = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    return {
        connection.laddr.port
        for process in processes
        for connection in process.net_connections("tcp")
        if connection.status == psutil.CONN_LISTEN
    }


async def run_at(address: str, security: Security | None, patience: float = 3.0) -> bool:
    """Return whether what listens at `address` runs a function that it is sent, in so many s."""
    arguments = security.get_connection_args("client") if security else {}
    there = rpc(address, timeout=patience, connection_args=arguments)
    try:
        answer = await asyncio.wait_for(there.run(function=cloudpickle.dumps(os.getpid)), patience)
    except (OSError, TimeoutError):
        return False
    finally:
        await there.close_rpc()
    return bool(answer["status"] == "OK")


def test_processes_of_a_service_refuse_whoever_has_no_certificate(
    stack: ExitStack, tmp_path: Path
) -> None:
    """No port of a service on loopback runs code: neither openly nor for a foreign certificate."""
    service = Service(tmp_path, MUTUNE_WORKERS="1")
    stack.callback(service.end)
    until(service.is_ready, "the worker")
    found = ports(service.pid) - {service.port}
    assert len(found) >= 3  # scheduler, nanny, worker
    stranger = Security.temporary()
    for port in found:
        assert not asyncio.run(run_at(f"tcp://127.0.0.1:{port}", None))
        assert not asyncio.run(run_at(f"tls://127.0.0.1:{port}", stranger))


def test_cluster_takes_its_certificates_from_the_settings(stack: ExitStack, tmp_path: Path) -> None:
    """Scheduler and worker open nothing else, and run what the holder of the certificate sends."""
    encrypted = certificates(tmp_path)
    port = free_port()
    address = f"tls://127.0.0.1:{port}"
    scheduler = Process(
        tmp_path / "scheduler.log", MUTUNE, "scheduler", "--port", str(port), **encrypted
    )
    stack.callback(scheduler.end)
    worker = Process(
        tmp_path / "worker.log",
        *(MUTUNE, "worker", "--scheduler", address, "--host", "127.0.0.1"),
        **{**encrypted, "MUTUNE_WORKERS": "1"},
    )
    stack.callback(worker.end)
    until(lambda: len(ports(worker.pid)) >= 2, "nanny and worker")
    assert ports(scheduler.pid) == {port}
    own = Security(
        require_encryption=True,
        tls_ca_file=encrypted["MUTUNE_TLS_CA_FILE"],
        tls_client_cert=encrypted["MUTUNE_TLS_CERT_FILE"],
        tls_client_key=encrypted["MUTUNE_TLS_KEY_FILE"],
    )
    found = ports(worker.pid)
    assert any(asyncio.run(run_at(f"tls://127.0.0.1:{port}", own, PATIENCE)) for port in found)
    assert not any(asyncio.run(run_at(f"tcp://127.0.0.1:{port}", None)) for port in found)


def test_scheduler_open_to_others_needs_certificates(stack: ExitStack, tmp_path: Path) -> None:
    """Without them it ends with exit status 2 and says what to set."""
    log = tmp_path / "scheduler.log"
    scheduler = Process(log, MUTUNE, "scheduler", "--host", "0.0.0.0")  # noqa: S104 - refused
    stack.callback(scheduler.end)
    assert scheduler.wait() == 2
    assert "MUTUNE_TLS_CERT_FILE" in log.read_text()
