"""The dearest requests that the schemas let through: what each route answers, and what it takes.

``python -m bench.dear_requests [NAME...]`` starts `mutune serve` with one worker on an empty folder
and sends them one after another. Time is that of all processes of the service together, and
that on the wall; memory is the largest resident set of any of its processes. With names, only the
requests whose names contain one of them.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

MUTUNE = Path(sys.executable).with_name("mutune")
LARGEST_SECONDS, LARGEST_MEGABYTES = 30.0, 700.0

UNCERTAINTY = {"epsilon": 0.2, "theta": 1.0}
FREQUENCIES = [float(omega) for omega in np.geomspace(1e-4, 1e4, 10_000)]
Json = dict[str, Any]


def element(order: int, dead_time: float, gain: float) -> Json:
    """Return an element with this number of different lags."""
    poles = -(0.5 + 0.1 * np.arange(order))
    return {"num": [gain], "den": [float(c) for c in np.poly(poles)], "dead_time": dead_time}


def matrix(n: int, order: int, dead_time: float = 1.0) -> Json:
    """Return a matrix plant in which every dead time is its own."""
    rows = [
        [
            element(order, dead_time * (1 + 0.1 * i + 0.03 * j), 1.0 if i == j else 0.3 / n)
            for j in range(n)
        ]
        for i in range(n)
    ]
    return {"kind": "matrix", "elements": rows}


def units(n: int) -> Json:
    """Return n units."""
    return {
        "kind": "first_order",
        "n": n,
        "gain": 1,
        "time_constant": 100,
        "interaction": 0.5 / n,
        "dead_time": 1.0,
    }


def loops(n: int, different: int) -> list[Json]:
    """Return the settings of n loops, so many of them different."""
    return [{"gain": 1 + 1e-4 * (i % different), "integral_time": 100} for i in range(n)]


def given(plant: Json, settings: list[Json], tau_p: float = 30.0, **more: object) -> Json:
    """Return a request about given loops."""
    return {
        "plant": plant,
        "uncertainty": UNCERTAINTY,
        "performance": {"tau_p": tau_p},
        "loops": settings,
        **more,
    }


EQUAL = [{"gain": 0.05, "integral_time": 5.0}] * 10
UNEQUAL = [{"gain": 0.05 + 1e-4 * i, "integral_time": 5.0 + 0.01 * i} for i in range(10)]
STEPS = [{"kind": "setpoint", "unit": i % 20, "time": 0.9 * i, "size": 1.0} for i in range(1000)]
DIFFICULT = {"direction": {"kind": "difficult"}, "duration": 1000.0, "samples": 20001}
LOAD = {"num": [1.0], "den": [1.0, 0.1], "dead_time": 0.0}
DRIVES = [{"proportional_gain": 1 + 0.01 * i, "integral_gain": 0.5} for i in range(100)]
FORMS = {"target": {"form": "ideal", "digits": 3}}

# Built when they are sent: some are long.
CASES: dict[str, tuple[str, Callable[[], Json]]] = {
    "robustness, 58 different loops": ("robustness", lambda: given(units(58), loops(58, 58))),
    "robustness, 100 different loops": ("robustness", lambda: given(units(100), loops(100, 100))),
    "robustness, 10,000 different loops": (
        "robustness",
        lambda: given(units(10_000), loops(10_000, 10_000)),
    ),
    "robustness, 10,000 units of 20 kinds": (
        "robustness",
        lambda: given(units(10_000), loops(10_000, 20)),
    ),
    "robustness, 15 different loops, certificate": (
        "robustness",
        lambda: given(units(15), loops(15, 15), certificate="full"),
    ),
    "robustness, 10 x 10 of order 20, 10,000 frequencies": (
        "robustness",
        lambda: given(matrix(10, 20), EQUAL, 300.0, omega=FREQUENCIES),
    ),
    "robustness, 10 x 10 of order 20, certificate": (
        "robustness",
        lambda: given(matrix(10, 20), EQUAL, 300.0, certificate="full"),
    ),
    "robustness, 10 x 10 of order 20, sdp": (
        "robustness",
        lambda: given(matrix(10, 20), EQUAL, 300.0, method="sdp"),
    ),
    "integrity, 10 x 10 of order 20": ("integrity", lambda: given(matrix(10, 20), UNEQUAL, 300.0)),
    "integrity, 62 units of 2 kinds": ("integrity", lambda: given(units(62), loops(62, 2))),
    "interaction, 10 x 10 of order 20": ("interaction", lambda: {"plant": matrix(10, 20)}),
    "decoupling, 10 x 10 of order 20": ("decouplings", lambda: {"plant": matrix(10, 20)}),
    "step response, 10 x 10 of order 20": (
        "step-responses",
        lambda: {"plant": matrix(10, 20), "loops": EQUAL, **DIFFICULT},
    ),
    "step response, 20 kinds, 1,000 steps, 20,001 samples": (
        "step-responses",
        lambda: {
            "plant": units(20),
            "loops": loops(20, 20),
            "steps": STEPS,
            "duration": 1000.0,
            "samples": 20001,
        },
    ),
    "parallel drives, 100 of them, 10,000 points": (
        "parallel-drives",
        lambda: {"load": LOAD, "drives": DRIVES, "scenario": {"points": 10_000}},
    ),
    "controller forms, 10,000 loops": (
        "controller-forms",
        lambda: {"loops": loops(10_000, 10_000)},
    ),
    "controller forms, 58 different loops on a plant": (
        "controller-forms",
        lambda: given(units(58), loops(58, 58), **FORMS),
    ),
}


class Meter:
    """Memory and processor time of a service and of all that it has started."""

    def __init__(self, pid: int) -> None:
        self._root = psutil.Process(pid)
        self._peak = 0
        self._ended = 0.0
        self._seen: dict[int, float] = {}
        self._lock = threading.Lock()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while True:
            with suppress(psutil.NoSuchProcess):
                self._look()
            time.sleep(0.02)

    def _look(self) -> None:
        with self._lock:  # from end to end: what ends between two looks counts once
            living: dict[int, float] = {}
            for process in [self._root, *self._root.children(recursive=True)]:
                with suppress(psutil.NoSuchProcess):
                    times = process.cpu_times()
                    living[process.pid] = times.user + times.system
                    self._peak = max(self._peak, process.memory_info().rss)
            self._ended += sum(used for pid, used in self._seen.items() if pid not in living)
            self._seen = living

    def begin(self) -> float:
        """Forget the peak; return the processor time so far."""
        self._peak = 0
        with self._lock:
            return self._ended + sum(self._seen.values())

    def end(self, before: float) -> tuple[float, float]:
        """Return processor time since and the peak, seconds and megabytes."""
        with suppress(psutil.NoSuchProcess):
            self._look()
        with self._lock:
            return self._ended + sum(self._seen.values()) - before, self._peak / 1e6


@contextmanager
def service() -> Iterator[tuple[str, int]]:
    """Run `mutune serve`; yield its URL and process id."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [MUTUNE, "serve", "--port", str(port)],
            env={**os.environ, "MUTUNE_DATA_DIR": folder, "MUTUNE_WORKERS": "1"},
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        url = f"http://127.0.0.1:{port}"
        try:
            while True:
                with suppress(httpx.TransportError):
                    if httpx.get(f"{url}/readyz").status_code == 200:
                        break
                time.sleep(0.5)
            yield url, process.pid
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(30)


def main() -> None:
    """Send them and print a table."""
    chosen = [
        (name, *case)
        for name, case in CASES.items()
        if not sys.argv[1:] or any(part in name for part in sys.argv[1:])
    ]
    load = os.getloadavg()[0]
    print(f"load average before: {load:.1f}\n")
    print("| request | answer | processor | wall | memory | size |")
    print("| --- | --- | --- | --- | --- | --- |")
    worst = [0.0, 0.0]
    with service() as (url, pid), httpx.Client(base_url=url, timeout=600) as client:
        meter = Meter(pid)
        for name, resource, build in chosen:
            body = json.dumps(build()).encode()
            before, begun = meter.begin(), time.monotonic()
            response = client.post(
                f"/v1/{resource}", content=body, headers={"Content-Type": "application/json"}
            )
            wall = time.monotonic() - begun
            used, peak = meter.end(before)
            answer = str(response.status_code)
            if response.status_code != 200:
                answer += f" {response.json()['type'].rpartition(':')[2]}"
            size = f"{len(response.content) / 1e6:.2f} MB"
            print(
                f"| {name} | {answer} | {used:.1f} s | {wall:.1f} s | {peak:.0f} MB | {size} |",
                flush=True,
            )
            worst = [max(worst[0], used), max(worst[1], peak)]
    print(
        f"\nworst: {worst[0]:.1f} s of {LARGEST_SECONDS:g}, "
        f"{worst[1]:.0f} MB of {LARGEST_MEGABYTES:g}"
    )
    sys.exit(worst[0] > LARGEST_SECONDS or worst[1] > LARGEST_MEGABYTES)


if __name__ == "__main__":
    main()
