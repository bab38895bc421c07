"""A long batch on this machine: do workers wait, what survives a kill, what does the rest cost.

``python -m bench.batch [--requests 10000] [--kills 5] [--stub 1]`` runs a mixed batch, one request
in a hundred being slow, once without a break and once killed and taken up again, and compares the
results. With ``--stub`` the tuner only waits, so many times as long as the real one takes: what is
measured then is the batch itself.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
from rich.console import Console
from rich.table import Table

MUTUNE = Path(sys.executable).with_name("mutune")
STUB = Path(__file__).with_name("stub_tuner.py")
WORKERS = 2
SLOW: dict[str, Any] = {"n": 3, "kind": "PID", "arrangement": "independent", "seconds": 3.0}
QUICK: tuple[dict[str, Any], ...] = (
    {"n": 1, "kind": "PI", "arrangement": "identical", "seconds": 0.03},
    {"n": 2, "kind": "PI", "arrangement": "identical", "seconds": 0.05},
    {"n": 2, "kind": "PI", "arrangement": "independent", "seconds": 0.15},
)


def requests(count: int, stub: float | None) -> Iterator[dict[str, Any]]:
    """Yield different requests, the first one and every hundredth of them slow."""
    for number in range(count):
        form = SLOW if number % 100 == 0 else QUICK[number % 3]
        time_limit = 600.0 if stub is None else max(1000 * stub * form["seconds"], 1.0)
        yield {
            "id": f"R-{number}",
            "plant": {
                "kind": "first_order",
                "n": form["n"],
                "gain": 1,
                "time_constant": 100,
                "interaction": 0 if form["n"] == 1 else 0.2 + 0.7 * number / count,
                "dead_time": number / count,
            },
            "uncertainty": {"epsilon": 0.2, "theta": 1},
            "controller": {"kind": form["kind"], "arrangement": form["arrangement"]},
            "search": {"seed": number, "time_limit": time_limit},
        }


class Run:
    """A run of the batch in a process of its own, with the greatest memory seen."""

    def __init__(self, path: Path, output: Path, *, stub: bool) -> None:
        env = os.environ | {"MUTUNE_WORKERS": str(WORKERS), "MUTUNE_MAX_TIME_LIMIT": "3600"}
        if stub:
            env["DASK_DISTRIBUTED__WORKER__PRELOAD"] = str(STUB)
        self.memory = 0
        self.began = time.monotonic()
        self._process = subprocess.Popen(
            [MUTUNE, "batch", path, "-o", output, "--no-curves"], env=env, start_new_session=True
        )

    def wait(self, seconds: float = float("inf")) -> bool:
        """Return whether it has ended within so many seconds."""
        watched = psutil.Process(self._process.pid)
        end = time.monotonic() + seconds
        while self._process.poll() is None and time.monotonic() < end:
            with_memory = watched.memory_info().rss if watched.is_running() else 0
            self.memory = max(self.memory, with_memory)
            time.sleep(0.2)
        return self._process.returncode is not None

    def kill(self) -> None:
        """Kill it and its workers."""
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


def without_times(path: Path) -> list[Any]:
    """Return the results without the seconds that they took."""
    entries = [json.loads(line) for line in path.read_text().splitlines()]
    for entry in entries:
        if "result" in entry:
            entry["result"]["search"].pop("elapsed_seconds")
    return entries


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--stub", type=float)
    arguments = parser.parse_args()
    table = Table("what", "value")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "requests.ndjson"
        with path.open("w") as file:
            for request in requests(arguments.requests, arguments.stub):
                file.write(json.dumps(request) + "\n")
        whole, broken = Path(folder) / "whole.ndjson", Path(folder) / "broken.ndjson"
        run = Run(path, whole, stub=arguments.stub is not None)
        run.wait()
        wall = time.monotonic() - run.began
        entries = [json.loads(line) for line in whole.read_text().splitlines()]
        solving = sum(
            entry["result"]["search"]["elapsed_seconds"] for entry in entries if "result" in entry
        )
        table.add_row("results", f"{len(entries)} of {arguments.requests}")
        table.add_row("wall", f"{wall:.0f} s, {len(entries) / wall:.0f} a second")
        table.add_row("solving / (wall x workers)", f"{solving / wall / WORKERS:.2f}")
        table.add_row("memory of the command", f"{run.memory / 1e6:.0f} MB")
        table.add_row("size of the results", f"{whole.stat().st_size / 1e6:.1f} MB")
        dice = random.Random(0)  # noqa: S311 - no secret
        for _ in range(arguments.kills):
            run = Run(path, broken, stub=arguments.stub is not None)
            if not run.wait(dice.uniform(0.3, 1.0) * wall / (arguments.kills + 1) + 5):
                run.kill()
        if arguments.kills:
            Run(path, broken, stub=arguments.stub is not None).wait()
            same = without_times(whole) == without_times(broken)
            table.add_row(f"after {arguments.kills} kills", "equal" if same else "DIFFERENT")
    Console().print(table)


if __name__ == "__main__":
    main()
