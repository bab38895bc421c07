"""Ctrl-C on the command line: the exit code, at any time, and the best so far."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import service.cli  # noqa: F401 - one test is about the import
from service.schemas import TuningRequest
from solver.tuning.compiling import Compiling
from solver.tuning.record import Progress, Status
from solver.tuning.specification import Specification
from solver.tuning.tuner import tune

# Sends itself the signal when the tuning has a best value, or before anything else.
PROGRAM = """
import os, signal, sys
import service.cli.interruption
from service.cli import main

when = sys.argv.pop(1)
if when == "imports":
    real = service.cli.interruption.end_at_once
    def early():
        real()
        os.kill(os.getpid(), signal.SIGINT)
    service.cli.end_at_once = early
else:
    import solver.tuning.tuner
    real = solver.tuning.tuner.tune
    def tune(specification, progress):
        def watched(now):
            progress(now)
            if now.starts_done > 2:
                for _ in range(2 if when == "twice" else 1):
                    os.kill(os.getpid(), signal.SIGINT)
            return progress(now)
        return real(specification, watched)
    solver.tuning.tuner.tune = tune
main()
"""
REQUEST = {
    "plant": {
        "kind": "first_order", "n": 2, "gain": 1.0, "time_constant": 100.0, "interaction": 0.949,
    },
    "uncertainty": {"epsilon": 0.2, "theta": 1.0},
    "performance": {"max_peak": 2.0, "offset": 0.0},
    "search": {"starts": 1000, "time_limit": 600.0},
}  # fmt: skip


def interrupted(tmp_path: Path, when: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a long tuning that is interrupted."""
    path = tmp_path / "request.json"
    path.write_text(json.dumps(REQUEST))
    return subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, "-c", PROGRAM, when, "tune", str(path), *options],
        capture_output=True,
        check=False,
        text=True,
        timeout=300,
    )


def test_a_command_ends_when_all_is_said() -> None:
    """A prompt is not kept waiting for what was imported to be taken apart."""
    program = (
        "import atexit; atexit.register(print, 'taken apart'); import service.cli as c; c.main()"
    )
    done = subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, "-c", program, "examples"], capture_output=True, check=False, text=True
    )
    assert done.returncode == 0
    assert "parallel_reactors" in done.stdout
    assert "taken apart" not in done.stdout


@pytest.mark.parametrize("options", [(), ("--json",)])
def test_the_best_so_far_is_printed(tmp_path: Path, options: tuple[str, ...]) -> None:
    """The search stops, what it has is printed and checked as ever, and the code is 130."""
    done = interrupted(tmp_path, "found", *options)
    assert done.returncode == 130, done.stderr
    assert "fault" not in done.stderr
    assert "Stopping; the best so far is checked." in done.stderr
    if options:
        document = json.loads(done.stdout)
        assert document["status"] == "time_limit"
        assert document["loops"]
        assert "Interrupted" in done.stderr
    else:
        assert done.stdout.startswith("Interrupted; the best so far: closed-loop time constant")


@pytest.mark.parametrize(
    ("when", "told"), [("imports", ""), ("twice", "Stopping; the best so far is checked.\n")]
)
def test_ends_at_once(tmp_path: Path, when: str, told: str) -> None:
    """In the first moments, and at the second Ctrl-C, there is one line and nothing else."""
    done = interrupted(tmp_path, when)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"{told}Interrupted.\n")


def test_a_progress_function_may_end_a_tuning() -> None:
    """What returns True ends the tuning with the best so far."""
    specification: Specification = TuningRequest.model_validate_json(json.dumps(REQUEST)).build()
    seen: list[Progress] = []

    def progress(now: Progress) -> bool:
        seen.append(now)
        return now.starts_done > 2

    found = tune(specification, progress)
    assert found.status is Status.TIME_LIMIT
    assert found.loops
    assert all(each.starts_done <= 2 for each in seen[:-1])


def test_compiling_is_timed_and_told_once() -> None:
    """Time goes on while numba compiles, not otherwise; the caller hears of it once."""
    told: list[str] = []
    compiling = Compiling(lambda: told.append("compiling"))
    assert compiling.seconds == 0.0

    @numba.njit
    def double(value: float) -> float:
        return 2 * value

    double(1.0)
    once = compiling.seconds
    assert once > 0
    double(2.0)
    assert compiling.seconds == once
    double(1)
    assert compiling.seconds > once
    assert told == ["compiling"]


def test_the_default_of_python_is_left_alone() -> None:
    """Importing the command line does not take the signal from a program that embeds it."""
    assert "service.cli" in sys.modules
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
