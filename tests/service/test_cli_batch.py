"""``mutune batch``: order, resuming, faults of single lines, real processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from fake_tune import BROKEN, DEADLY, SLOW
from samples import altered, tuning
from typer.testing import CliRunner, Result

from service.cli import app
from service.schemas import TuningResult

PRELOAD = str(Path(__file__).with_name("fake_tune.py"))

pytestmark = pytest.mark.usefixtures("_fake_tuner")


@pytest.fixture(autouse=True)
def _one_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUTUNE_WORKERS", "1")


def write(path: Path, *requests: object) -> Path:
    """Write requests a line each; text is taken as it is."""
    lines = (each if isinstance(each, str) else json.dumps(each) for each in requests)
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def batch(*arguments: str | Path) -> Result:
    """Run a batch in this process."""
    return CliRunner().invoke(app, ["batch", *map(str, arguments)], catch_exceptions=False)


def read(path: Path) -> list[dict[str, Any]]:
    """Return the entries of a results file."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_results_come_in_order_whatever_happens_to_a_line(tmp_path: Path) -> None:
    """A line a request: results, and errors in their place; the exit code tells of the errors."""
    requests = write(
        tmp_path / "requests.ndjson",
        tuning(seed=SLOW, starts=30),
        tuning(seed=100),
        "not json",
        altered(tuning(), "/plant/n", 0),
        tuning(seed=DEADLY),
        tuning(seed=BROKEN),
        tuning(seed=101),
    )
    output = tmp_path / "results.ndjson"
    result = batch(requests, "-o", output)
    entries = read(output)
    assert [entry["index"] for entry in entries] == list(range(7))
    assert [entry.get("result", {}).get("tau_p") for entry in entries] == [
        SLOW,
        100,
        None,
        None,
        None,
        None,
        101,
    ]
    slugs = [entry["error"]["type"].split(":")[-1] for entry in entries[2:6]]
    assert slugs == ["not-json", "invalid-request", "unavailable", "internal"]
    assert entries[3]["error"]["errors"][0]["pointer"] == "/plant/n"
    assert result.exit_code == 2
    assert result.stderr.endswith("7 requests: 3 optimal, 4 error\n")
    TuningResult.model_validate(entries[6]["result"])


def test_equal_requests_are_computed_once(tmp_path: Path) -> None:
    """Requests that differ in their spelling alone share a digest and a result."""
    explicit = altered(tuning(seed=SLOW, starts=1), "/objective", "tau_p")
    requests = write(tmp_path / "r.ndjson", tuning(seed=SLOW, starts=1), explicit)
    result = batch(requests)
    first, second = (json.loads(line) for line in result.stdout.splitlines())
    assert first.pop("index") == 0
    assert second.pop("index") == 1
    assert first == second


def test_repeated_run_finishes_the_rest(tmp_path: Path) -> None:
    """Lines that are there stay as they are, byte for byte; a torn last line is computed anew."""
    requests = write(tmp_path / "r.ndjson", *(tuning(seed=seed) for seed in (200, 201, 202)))
    output = tmp_path / "results.ndjson"
    assert batch(requests, "-o", output).exit_code == 0
    whole = output.read_bytes()
    first = whole.splitlines(keepends=True)[0].replace(b'"tau_p":200', b'"tau_p": 9')
    output.write_bytes(first + whole.splitlines()[1][:40])
    assert batch(requests, "-o", output).exit_code == 0
    assert output.read_bytes() == first + b"".join(whole.splitlines(keepends=True)[1:])


def test_finished_run_repeated_changes_nothing(tmp_path: Path) -> None:
    """There is nothing left to do; errors found before still count."""
    requests = write(tmp_path / "r.ndjson", "{}")
    output = tmp_path / "results.ndjson"
    assert batch(requests, "-o", output).exit_code == 2
    whole = output.read_bytes()
    assert batch(requests, "-o", output).exit_code == 2
    assert output.read_bytes() == whole


@pytest.mark.parametrize("content", ["someone's notes\n", "[]\n", '{"index": 0, "result": {}}\n'])
def test_file_with_other_content_is_left_alone(tmp_path: Path, content: str) -> None:
    """A file that is no result of these requests is neither continued nor overwritten."""
    output = tmp_path / "results.ndjson"
    output.write_text(content)
    result = batch(write(tmp_path / "r.ndjson", tuning(seed=1)), "-o", output)
    assert result.exit_code == 2
    assert "line 1 is no result of these requests" in result.stderr
    assert output.read_text() == content


def test_results_of_changed_requests_are_refused(tmp_path: Path) -> None:
    """Stale results are never taken for those of an edited file."""
    output = tmp_path / "results.ndjson"
    batch(write(tmp_path / "r.ndjson", tuning(seed=300)), "-o", output)
    before = output.read_bytes()
    result = batch(write(tmp_path / "r.ndjson", tuning(seed=301)), "-o", output)
    assert result.exit_code == 2
    assert output.read_bytes() == before


def test_results_that_cannot_be_written_exit_with_1(tmp_path: Path) -> None:
    """A folder that is not there is no fault of the requests."""
    result = batch(write(tmp_path / "r.ndjson", "{}"), "-o", tmp_path / "absent" / "results.ndjson")
    assert result.exit_code == 1
    assert "absent" in result.stderr


@pytest.mark.parametrize("name", ["SIGINT", "SIGKILL"])
def test_stopped_process_goes_on_where_it_was(tmp_path: Path, name: str) -> None:
    """A real process is stopped amid the batch; the same command does the rest."""
    slow = [tuning(seed=SLOW, starts=20 + index) for index in range(6)]
    requests = write(tmp_path / "r.ndjson", *slow)
    output = tmp_path / "results.ndjson"
    command = [Path(sys.executable).with_name("mutune"), "batch", requests, "-o", output]
    process = subprocess.Popen(  # noqa: S603 - our own program
        command,
        env={**os.environ, "DASK_DISTRIBUTED__WORKER__PRELOAD": PRELOAD},
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        wait_for_line(output, process)
    finally:
        os.killpg(process.pid, getattr(signal, name))
        message = process.communicate()[1]
    done = len(read(output))
    assert 1 <= done < 6
    if name == "SIGINT":
        assert process.returncode == 130
        assert message.decode().strip() == (
            f"Interrupted: {done} of 6 done. The same command does the rest."
        )
    assert batch(requests, "-o", output).exit_code == 0
    assert [entry["index"] for entry in read(output)] == list(range(6))


def wait_for_line(path: Path, process: subprocess.Popen[bytes]) -> None:
    """Return once a whole line is in the file."""
    deadline = time.monotonic() + 120
    while not (path.exists() and b"\n" in path.read_bytes()):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
