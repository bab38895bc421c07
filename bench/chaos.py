"""Jobs under kills of everything: none may be lost, and none may change.

``python -m bench.chaos [--jobs 100] [--kills 12] [--seed 0]`` starts a PostgreSQL cluster of its
own, a scheduler, two workers and two services, puts jobs in through both, tunings, limits and
identifications, and kills -9 one of them after another, the database too, each of which is started
again. What comes out is compared, digit by digit, with what is found in this process. Ends with 1
where a job is lost or differs.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from service import registry
from service.schemas import TuningRequest
from service.valves import finished
from solver.tuning import tuner

MUTUNE = str(Path(sys.executable).with_name("mutune"))
PATIENCE = 600.0  # seconds without an end of any job after which they count as lost
Json = dict[str, Any]


def plant(number: int) -> Json:
    """Return a plant unlike those of other jobs."""
    return {
        "kind": "first_order",
        "n": 2,
        "gain": 1,
        "time_constant": 100,
        "interaction": 0.5 + 0.001 * number,
    }


def tuning(number: int) -> Json:
    """Return a tuning request that takes about a second."""
    return {
        "plant": plant(number),
        "uncertainty": {"epsilon": 0.2, "theta": 1},
        "controller": {"arrangement": "independent"},
        "search": {"seed": number, "starts": 4},
    }


def limit(number: int) -> Json:
    """Return a request for the limit of one unit, which takes some seconds."""
    return {
        "plant": {**plant(0), "n": 1, "interaction": 0, "time_constant": 10 + number},
        "uncertainty": {"epsilon": 0.2, "theta": 1},
        "search": {"time_limit": 600},
    }


def identification(number: int) -> Json:
    """Return a request for a model of a step response."""
    moved = [float(10 <= second % 40 < 30) for second in range(80)]
    felt = 0.0
    outputs = []
    for input_now in moved:
        outputs.append(20 + felt + 0.01 * ((7 * len(outputs)) % 5))
        felt += (1 + 0.01 * number) * 0.2 * (input_now - felt)
    record = {
        "inputs": {"valve": moved},
        "outputs": {"temperature": outputs},
        "time": list(range(80)),
    }
    return {"records": [record], "order": "first"}


def job(number: int) -> tuple[str, Json]:
    """Return path and request of a job: of a hundred 80 tunings, 15 identifications, 5 limits."""
    if number % 20 == 7:
        return "/v1/limits", limit(number)
    if number % 5 == 2:
        return "/v1/identifications", identification(number)
    return "/v1/tunings", tuning(number)


def expected(number: int) -> Json:
    """Return the result of a job as this process finds it."""
    path, request = job(number)
    text = json.dumps(request)
    if path == "/v1/tunings":
        asked = TuningRequest.model_validate_json(text)
        document = finished(asked, tuner.tune(asked.build())) | asked.identity()
    else:
        analysis = next(one for one in registry.every() if one.path == path)
        body = analysis.request.model_validate_json(text)
        document = analysis.compute(body) | body.identity()
    result: Json = json.loads(json.dumps(document))
    return result


def without_times(result: Json) -> Json:
    """Return what a result says but how long it took."""
    search = result.get("search", {})
    kept = {key: value for key, value in search.items() if "seconds" not in key}
    return {**result, "search": kept}


def free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Part:
    """A process of the installation, which can be killed and started again."""

    def __init__(self, name: str, log: Path, *command: str, **environment: str) -> None:
        self.name = name
        self._log = log
        self._command = command
        self._environment = environment
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it."""
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                self._command,
                stdout=log,
                stderr=log,
                env={**os.environ, **self._environment},
                start_new_session=True,
            )

    def kill(self) -> None:
        """Kill -9 of it and of whatever it has started."""
        if self._process is not None:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


class Database(Part):
    """A PostgreSQL cluster, run by a user other than root."""

    def __init__(self, folder: Path) -> None:
        self.name = "database"
        self._folder = folder
        self._port = free_port()
        self.url = f"postgresql+psycopg://mutune@127.0.0.1:{self._port}/postgres"
        if os.geteuid() == 0:
            shutil.chown(folder, "postgres")
        self._run("initdb", "-U", "mutune", "-A", "trust", "--no-sync", "-E", "UTF8")

    def _run(self, program: str, *options: str) -> None:
        found = shutil.which(program) or next(
            str(path) for path in Path("/usr/lib/postgresql").glob(f"*/bin/{program}")
        )
        other = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
        data = str(self._folder / "data")
        subprocess.run([*other, found, "-D", data, *options], check=True, stdout=subprocess.DEVNULL)

    def start(self) -> None:
        """Start it; after a kill it recovers from its log."""
        options = f"-p {self._port} -k {self._folder} -c listen_addresses=127.0.0.1"
        log = str(self._folder / "log")
        self._run("pg_ctl", "-o", options, "-l", log, "-w", "start")

    def kill(self) -> None:
        """Kill -9 of the server; its children see to themselves."""
        pid = int((self._folder / "data" / "postmaster.pid").read_text().split()[0])
        os.kill(pid, signal.SIGKILL)
        while Path(f"/proc/{pid}").exists():
            time.sleep(0.05)
        time.sleep(1.0)  # its children let go of the shared memory


def until_up(url: str) -> None:
    """Wait until a service takes work."""
    while True:
        with suppress(httpx.TransportError):
            if httpx.get(f"{url}/readyz", timeout=5).status_code == 200:
                return
        time.sleep(0.2)


def put_in(urls: list[str], jobs: int) -> dict[int, str]:
    """Accept the jobs; a service that is down is asked again, under the same key."""
    paths = {}
    for number in range(jobs):
        path, request = job(number)
        attempt = 0
        while number not in paths:
            url = urls[(number + attempt) % len(urls)]
            attempt += 1
            with suppress(httpx.TransportError):
                response = httpx.post(
                    f"{url}{path}",
                    json=request,
                    headers={"Idempotency-Key": f"chaos-{number}"},
                    timeout=20,
                )
                if response.status_code in {200, 202}:
                    paths[number] = response.headers["location"]
                    continue
            time.sleep(0.2)
    return paths


def ended(urls: list[str], path: str) -> Json | None:
    """Return a job that has ended, from whichever service answers."""
    for url in urls:
        with suppress(httpx.TransportError):
            response = httpx.get(f"{url}{path}", timeout=20)
            if response.status_code == 200:
                job: Json = response.json()
                return job if job["finished_at"] is not None else None
    return None


def install(folder: Path, stack: ExitStack) -> tuple[list[Part], list[str]]:
    """Start all parts; return them and the URLs of the services."""
    folder.chmod(0o755)
    (folder / "postgres").mkdir()
    database = Database(folder / "postgres")
    port, log = free_port(), folder / "log"
    settings = {
        "MUTUNE_DATABASE_URL": database.url,
        "MUTUNE_SCHEDULER": f"tcp://127.0.0.1:{port}",
    }
    ports = [free_port(), free_port()]
    parts = [
        database,
        Part("scheduler", log, MUTUNE, "scheduler", "--port", str(port)),
        *(
            Part(f"worker {n}", log, MUTUNE, "worker", MUTUNE_WORKERS="1", **settings)
            for n in (1, 2)
        ),
        *(
            Part(f"service {n}", log, MUTUNE, "serve", "--port", str(each), **settings)
            for n, each in enumerate(ports, 1)
        ),
    ]
    for part in parts:
        stack.callback(part.kill)
        part.start()
    urls = [f"http://127.0.0.1:{each}" for each in ports]
    for url in urls:
        until_up(url)
    return parts, urls


def kill_each(parts: list[Part], kills: int, seed: int, done: threading.Event) -> None:
    """Kill one part after another, and start each again, until all kills are used or it is done."""
    rng = np.random.default_rng(seed)
    for number in rng.permutation(kills):
        if done.wait(float(rng.uniform(3.0, 10.0))):
            return
        part = parts[number % len(parts)]
        sys.stdout.write(f"{part.name} is killed\n")
        sys.stdout.flush()
        part.kill()
        done.wait(float(rng.uniform(0.0, 2.0)))
        part.start()


def gather(urls: list[str], paths: dict[int, str]) -> dict[int, Json]:
    """Return the jobs that have ended, waiting for the others as long as any end."""
    results: dict[int, Json] = {}
    last = time.monotonic()
    while len(results) < len(paths) and time.monotonic() - last < PATIENCE:
        for number, path in paths.items():
            if number not in results and (found := ended(urls, path)) is not None:
                results[number] = found
                last = time.monotonic()
        time.sleep(0.2)
    return results


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="mutune-chaos-"))
        parts, urls = install(Path(folder), stack)
        done = threading.Event()
        killing = threading.Thread(
            target=kill_each, args=(parts, options.kills, options.seed, done)
        )
        killing.start()
        paths = put_in(urls, options.jobs)
        results = gather(urls, paths)
        done.set()
        killing.join()
    wrong = []
    for number, each in sorted(results.items()):
        found = each.get("result")
        if found is None or without_times(found) != without_times(expected(number)):
            wrong.append(number)
            print(f"{number}: {each['status']} {each.get('error')}")
    lost = len(paths) - len(results)
    print(f"{len(paths)} jobs: {lost} lost, {len(wrong)} changed or without result")
    sys.exit(bool(lost or wrong))


if __name__ == "__main__":
    main()
