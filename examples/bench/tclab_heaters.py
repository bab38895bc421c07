"""The loops of a tuning on the two-heater kit itself, or on its simulator, by the package tclab.

    pip install tclab
    mutune tune heaters.json --json > settings.json
    python examples/bench/tclab_heaters.py settings.json         # the simulator, 60 times as fast
    python examples/bench/tclab_heaters.py settings.json --kit   # the kit at a serial port
    python examples/bench/tclab_heaters.py --record record.csv   # steps for mutune identify

The same loops run on the bench of `two_heaters.py` in plain Python without the package. Sampled
once a second; heaters are switched off at the end, also after Ctrl-C.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

bench = importlib.import_module("two_heaters")  # beside this file

FASTER = 60
HEADS = ("Time (s)", "Heater 1 (%)", "Heater 2 (%)", "Temperature 1 (degC)", "Temperature 2 (degC)")
# Each heater alone, then both: what `identify` needs to tell them apart.
STEPS = ((0, 0.0, 0.0), (30, 60.0, 0.0), (430, 0.0, 60.0), (830, 40.0, 30.0), (1230, 0.0, 0.0))


@contextmanager
def lab(*, kit: bool) -> Iterator[tuple[Any, Callable[[int], Iterator[float]]]]:
    """Give the kit or its simulator, and its clock; heaters are off afterwards."""
    tclab = importlib.import_module("tclab")  # optional

    with tclab.setup(connected=kit, speedup=1 if kit else FASTER)() as heaters:
        try:
            yield heaters, lambda duration: tclab.clock(duration, step=1, tol=float("inf"))
        finally:
            heaters.Q1(0)
            heaters.Q2(0)


def control(loops: list[Any], *, kit: bool, duration: int) -> list[tuple[float, ...]]:
    """Close the loops; return time, inputs and readings once a second."""
    trace: list[tuple[float, ...]] = []
    with lab(kit=kit) as (heaters, clock):
        before = 0.0
        for time in clock(duration):
            readings = heaters.T1, heaters.T2
            errors = [w - y for w, y in zip(bench.set_points(time), readings, strict=True)]
            length = max(time - before, 1e-3)
            inputs = [loop.output(e, length) for loop, e in zip(loops, errors, strict=True)]
            heaters.Q1(inputs[0])
            heaters.Q2(inputs[1])
            trace.append((time, *inputs, *readings))
            before = time
    return trace


def excite(*, kit: bool, duration: int) -> list[tuple[float, ...]]:
    """Step the heaters; return time, inputs and readings once a second."""
    trace: list[tuple[float, ...]] = []
    with lab(kit=kit) as (heaters, clock):
        for time in clock(duration):
            _, first, second = [step for step in STEPS if step[0] <= time][-1]
            readings = heaters.T1, heaters.T2
            heaters.Q1(first)
            heaters.Q2(second)
            trace.append((time, first, second, *readings))
    return trace


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("settings", nargs="?", type=Path, help="result of mutune tune --json")
    parser.add_argument("--record", type=Path, help="step the heaters and write this file")
    parser.add_argument("--kit", action="store_true", help="the kit, not its simulator")
    parser.add_argument("--duration", type=int, default=1600, help="seconds")
    asked = parser.parse_args()
    if asked.record:
        with asked.record.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(HEADS)
            writer.writerows(excite(kit=asked.kit, duration=asked.duration))
    elif asked.settings:
        loops = json.loads(asked.settings.read_text())["loops"]
        found = [bench.Pi(loop["gain"], loop["integral_time"]) for loop in loops]
        trace = control(found, kit=asked.kit, duration=asked.duration)
        print("   time  heater 1  heater 2  temperature 1  temperature 2")
        for time, first, second, one, two in trace[::60]:
            print(f"{time:7.0f}  {first:8.1f}  {second:8.1f}  {one:13.2f}  {two:13.2f}")
    else:
        parser.error("name the settings, or --record a file")


if __name__ == "__main__":
    main()
