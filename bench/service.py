"""What the service costs beside the solving: one command, a table printed.

``python -m bench.service [--items N]`` starts `mutune serve` with two workers on an empty
folder, and measures on this machine. Latencies are those of a client on the loopback address.
``python -m bench.service --endurance 10000`` measures memory over so many jobs instead.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx

from service.schemas.tunings import BatchTuningRequest, TuningRequest
from solver.tuning import tuner

MUTUNE = Path(sys.executable).with_name("mutune")
PLANT = {"kind": "first_order", "n": 2, "gain": 1, "time_constant": 100, "interaction": 0.949}
UNCERTAINTY = {"epsilon": 0.2, "theta": 1}
LOOPS = [{"gain": 46.3, "integral_time": 101}, {"gain": 22.8, "integral_time": 3.15}]
ROBUSTNESS = {
    "plant": PLANT,
    "uncertainty": UNCERTAINTY,
    "performance": {"tau_p": 19},
    "loops": LOOPS,
}


def tuning(seed: int, arrangement: str = "identical") -> dict[str, object]:
    """Return a tuning request."""
    return {
        "plant": PLANT,
        "uncertainty": UNCERTAINTY,
        "controller": {"arrangement": arrangement},
        "search": {"seed": seed},
    }


def short_tuning(seed: int) -> dict[str, object]:
    """Return a tuning request that takes a tenth of a second."""
    return {
        "plant": {**PLANT, "n": 1},
        "uncertainty": UNCERTAINTY,
        "controller": {"arrangement": "identical"},
        "search": {"seed": seed, "starts": 1},
    }


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    what: str
    value: str
    target: str


class Bench:
    """A running service and what is measured on it."""

    def __init__(self, client: httpx.AsyncClient, pid: int) -> None:
        self._client = client
        self._pid = pid

    async def endurance(self, jobs: int) -> AsyncIterator[Row]:
        """Memory while so many short tunings of one unit are computed."""
        yield self.memory("at the start")
        for done in range(0, jobs, 500):
            requests = [short_tuning(seed) for seed in range(done, done + 500)]
            response = await self._client.post("/v1/batches", json={"tunings": requests})
            results = (await self._client.get(response.json()["links"]["results"])).text
            failed = [line for line in results.splitlines() if "result" not in json.loads(line)]
            if failed:
                raise RuntimeError(failed[0])
            yield self.memory(f"after {done + len(requests)} jobs")

    async def overhead(self) -> Row:
        """Time of a job beyond its solve, one after another."""
        _ending(0, batch=False)
        beyond = []
        for seed in range(20):
            ending = _ending(seed, batch=False)  # beside each job: the machine's load changes
            begun = time.perf_counter()
            job = await self._tune(tuning(seed))
            total = time.perf_counter() - begun
            beyond.append(total - job["result"]["search"]["elapsed_seconds"] - ending)
        value = f"{1000 * statistics.median(beyond):.0f} ms"
        return Row("overhead of a job beyond the solve, median of 20", value, "15 ms")

    async def _tune(self, request: dict[str, object]) -> Any:
        response = await self._client.post(
            "/v1/tunings", json=request, headers={"Prefer": "wait=60"}
        )
        return response.json()

    async def throughput(self, items: int) -> list[Row]:
        """How much of the workers' time a batch spends in the solver, nothing else going on."""
        begun = time.perf_counter()
        links = await self._start_batch(items)
        accepted = time.perf_counter() - begun
        results = (await self._client.get(links["results"])).text.splitlines()
        seconds = time.perf_counter() - begun
        searching = [json.loads(line)["result"]["search"]["elapsed_seconds"] for line in results]
        ending = statistics.median(_ending(seed, batch=True) for seed in range(20))
        solving = sum(searching) + ending * len(searching)
        return [
            Row(f"accepting a batch of {items}", f"{accepted:.2f} s", ""),
            Row(
                f"solve time over wall time and 2 workers, batch of {items}",
                f"{solving / (2 * seconds):.2f}",
                "0.9",
            ),
        ]

    async def beside_a_batch(self) -> list[Row]:
        """Latencies of other requests while a batch runs."""
        links = await self._start_batch(1000)
        job = (await self._client.get("/v1/tunings?limit=1")).json()["items"][0]["links"]["self"]
        looks = await _latencies(lambda: self._client.get(job), 200)
        analyses = await _latencies(
            lambda: self._client.post("/v1/robustness", json=ROBUSTNESS), 100
        )
        waited = [_waited(await self._tune(tuning(seed))) for seed in range(5000, 5005)]
        await self._client.delete(links["self"])
        await self._client.get(links["results"])
        return [
            Row("p99 of GET /v1/tunings/{id}, batch running", _p99(looks), "25 ms"),
            Row("p99 of POST /v1/robustness, batch running", _p99(analyses), "60 ms"),
            Row(
                "a tuning of one's own begins, batch running, worst of 5",
                f"{max(waited):.2f} s",
                "1 s",
            ),
        ]

    async def _start_batch(self, items: int) -> dict[str, str]:
        tunings = [tuning(1000 + number) for number in range(items)]
        response = await self._client.post("/v1/batches", json={"tunings": tunings})
        links: dict[str, str] = response.json()["links"]
        return links

    async def cancel(self) -> Row:
        """Time from a cancellation until the workers stand still."""
        request = {**tuning(7, "independent"), "controller": {"kind": "PID"}}
        job = (await self._client.post("/v1/tunings", json=request)).json()["links"]["self"]
        async with self._client.stream("GET", f"{job}/events") as events:
            async for line in events.aiter_lines():
                if '"running"' in line:
                    break
        await asyncio.sleep(1)
        begun = time.perf_counter()
        await self._client.delete(job)
        while _ticks(self._pid, 0.1) > 3:  # of 10: the service itself needs some
            pass
        seconds = time.perf_counter() - begun
        return Row("cancellation to idle workers", f"{seconds:.2f} s", "0.5 s")

    def memory(self, when: str) -> Row:
        """Memory of all processes, shared pages counted once."""
        total = sum(_pss(pid) for pid in _family(self._pid))
        return Row(f"memory, API and engine, {when}", f"{total / 1000:.0f} MB", "400 MB")


def _ending(seed: int, *, batch: bool) -> float:
    """Return the seconds that the solver needs after its search: margins, proof, curves."""
    model = BatchTuningRequest if batch else TuningRequest
    specification = model.model_validate(tuning(seed)).build()
    begun = time.perf_counter()
    result = tuner.tune(specification)
    return time.perf_counter() - begun - result.search.elapsed_seconds


def _waited(job: dict[str, str]) -> float:
    """Return the seconds that a job was in the queue."""
    begun = datetime.fromisoformat(job["started_at"])
    return (begun - datetime.fromisoformat(job["created_at"])).total_seconds()


async def _latencies(call: Callable[[], Awaitable[object]], count: int) -> list[float]:
    await call()
    result = []
    for _ in range(count):
        begun = time.perf_counter()
        await call()
        result.append(time.perf_counter() - begun)
    return result


def _p99(seconds: list[float]) -> str:
    return f"{1000 * statistics.quantiles(seconds, n=100)[98]:.0f} ms"


def _family(leader: int) -> list[int]:
    """Return the processes of the session of `leader`."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == leader:
            found.append(int(entry.parent.name))
    return found


def _pss(pid: int) -> int:
    """Return the proportional set size of a process in kB."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("Pss:")), 0)


def _ticks(leader: int, seconds: float) -> int:
    """Return the processor time of the session during some seconds, in hundredths of a second."""

    def used() -> int:
        total = 0
        for pid in _family(leader):
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            total += int(fields[11]) + int(fields[12])
        return total

    before = used()
    time.sleep(seconds)
    return used() - before


async def measure(address: str, pid: int, items: int, endurance: int) -> AsyncIterator[Row]:
    """Measure everything, or memory over many jobs alone, a row at a time."""
    transport = httpx.AsyncHTTPTransport(retries=20)  # until it listens
    async with httpx.AsyncClient(base_url=address, timeout=3600, transport=transport) as client:
        bench = Bench(client, pid)
        # The first of each starts processes, and waits for the workers.
        await client.post("/v1/robustness", json=ROBUSTNESS)
        await client.post("/v1/tunings", json=tuning(99), headers={"Prefer": "wait=60"})
        if endurance:
            async for row in bench.endurance(endurance):
                yield row
            return
        yield bench.memory("idle")
        yield await bench.overhead()
        for row in [*await bench.throughput(items), *await bench.beside_a_batch()]:
            yield row
        yield await bench.cancel()
        yield bench.memory("after all this")


async def show(rows: AsyncIterator[Row]) -> None:
    """Print the table as it comes."""
    print("| what | measured | target |")
    print("| --- | --- | --- |", flush=True)
    async for row in rows:
        print(f"| {row.what} | {row.value} | {row.target} |", flush=True)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--items", type=int, default=1000, help="size of the batch whose throughput counts"
    )
    parser.add_argument("--endurance", type=int, default=0, help="jobs; memory over these alone")
    options = parser.parse_args()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "MUTUNE_DATA_DIR": folder, "MUTUNE_WORKERS": "2"}
        service = subprocess.Popen(
            [str(MUTUNE), "serve", "--port", str(port)],
            env=environment,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            asyncio.run(
                show(
                    measure(
                        f"http://127.0.0.1:{port}", service.pid, options.items, options.endurance
                    )
                )
            )
        finally:
            service.send_signal(signal.SIGTERM)
            service.wait(30)


if __name__ == "__main__":
    main()
