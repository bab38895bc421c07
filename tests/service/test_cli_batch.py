"""``mutune batch``: order, resuming, faults of single lines, real processes."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from fake_tune import BROKEN, DEADLY, ENDLESS, HELD, SLOW
from real import PATIENCE
from samples import altered, tuning
from typer.testing import CliRunner, Result

from service.batch.formats import Rows, SettingsForm
from service.batch.request_lines import read_items
from service.batch.table import Table
from service.cli.commands import app
from service.jobs.engine import Engine
from service.jobs.records import JobStatus, Outcome
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


@pytest.mark.parametrize("content", ["someone's notes", "{"])
def test_file_without_a_line_end_is_left_alone(tmp_path: Path, content: str) -> None:
    """Text that an editor left without a last line end is not taken for a torn result."""
    output = tmp_path / "results.ndjson"
    output.write_text(content)
    result = batch(write(tmp_path / "r.ndjson", "{}"), "-o", output)
    assert result.exit_code == 2
    assert "line 1 is no result of these requests" in result.stderr
    assert output.read_text() == content


@pytest.mark.parametrize("link", ["same", "symbolic", "hard", "spelling"])
def test_the_requests_are_never_written_over(tmp_path: Path, link: str) -> None:
    """Whatever path leads to it, the input is refused as output before anything is opened."""
    requests = tmp_path / "r.ndjson"
    requests.write_text(json.dumps(tuning(seed=1)))  # one line, without its end
    output = {
        "same": requests,
        "symbolic": tmp_path / "symbolic.ndjson",
        "hard": tmp_path / "hard.ndjson",
        "spelling": tmp_path / "absent" / ".." / "r.ndjson",
    }[link]
    if link == "symbolic":
        output.symlink_to(requests)
    if link == "hard":
        output.hardlink_to(requests)
    before = requests.read_bytes()
    result = batch(requests, "-o", output)
    assert result.exit_code == 2
    assert "is the file of requests" in result.stderr
    assert requests.read_bytes() == before


def start(requests: Path, output: Path, end: Path | None = None) -> subprocess.Popen[bytes]:
    """Start a batch in a process of its own; what is HELD ends there once the file `end` exists."""
    return subprocess.Popen(  # noqa: S603 - our own program
        [Path(sys.executable).with_name("mutune"), "batch", requests, "-o", output],
        env={
            **os.environ,
            "DASK_DISTRIBUTED__WORKER__PRELOAD": PRELOAD,
            "FAKE_TUNER_HOLDS": str(end or ""),
        },
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def wait_for_lines(path: Path, count: int, process: subprocess.Popen[bytes]) -> None:
    """Return once a file has so many whole lines."""
    deadline = time.monotonic() + PATIENCE
    while not (path.exists() and path.read_bytes().count(b"\n") >= count):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_two_runs_do_not_write_to_one_file(tmp_path: Path) -> None:
    """The second says so and ends; the first goes on undisturbed."""
    requests = write(tmp_path / "r.ndjson", tuning(seed=HELD), tuning(seed=400))
    output, end = tmp_path / "results.ndjson", tmp_path / "end"
    process = start(requests, output, end)
    wait_for_lines(output.with_name("results.ndjson.journal"), 1, process)
    second = batch(requests, "-o", output)
    assert second.exit_code == 2
    assert "another batch writes to" in second.stderr
    end.touch()
    _, message = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, message.decode()
    assert [entry["index"] for entry in read(output)] == [0, 1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["end", "r.ndjson", "results.ndjson"]


def test_a_slow_first_line_holds_up_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is done behind it is kept when the run is stopped, and not computed again."""
    monkeypatch.setenv("MUTUNE_WORKERS", "2")
    later = [tuning(seed=seed) for seed in range(500, 540)]
    requests = write(tmp_path / "r.ndjson", tuning(seed=ENDLESS), *later)
    output = tmp_path / "results.ndjson"
    journal = output.with_name("results.ndjson.journal")
    process = start(requests, output)
    wait_for_lines(journal, 41, process)
    process.send_signal(signal.SIGTERM)
    _, message = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "Interrupted: 40 of 41 done. The same command does the rest." in message.decode()
    marked = journal.read_text().replace('"tau_p":500.0', '"tau_p":9.125')
    journal.write_text(marked)
    other = write(tmp_path / "other.ndjson", tuning(seed=1))
    refused = batch(other, "-o", output)
    assert refused.exit_code == 2
    assert "is of another batch" in refused.stderr
    assert journal.read_text() == marked
    process = start(requests, output)  # does the rest: the slow one only
    try:
        wait_for_lines(output, 0, process)  # it has begun
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)
    assert '"tau_p":9.125' in journal.read_text()


def test_equal_requests_far_apart_are_computed_once(tmp_path: Path) -> None:
    """Over the whole batch, not only while the first of them is being computed."""
    slow, quick = tuning(seed=SLOW, starts=50), tuning(seed=600)
    requests = write(tmp_path / "r.ndjson", *([slow, quick] * 12))
    output = tmp_path / "results.ndjson"
    seen: list[str] = []

    async def run(
        _engine: Engine, _of: str, request: str, _limit: float, _progress: object
    ) -> Outcome:
        seen.append(request)
        return Outcome(JobStatus.SUCCEEDED, result='{"status": "optimal"}')

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Engine, "run", run)
        assert batch(requests, "-o", output).exit_code == 0
    entries = read(output)
    assert [entry["index"] for entry in entries] == list(range(24))
    assert len({entry["digest"] for entry in entries}) == len(seen) == 2


def test_lines_as_people_write_them(tmp_path: Path) -> None:
    """A byte order mark, Windows line ends, blank lines, no last line end: all are let pass."""
    path = tmp_path / "r.ndjson"
    lines = [json.dumps(tuning(seed=seed)) for seed in (700, 701)]
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join([lines[0], "", "  ", lines[1]]).encode())
    result = batch(path, "--check")
    assert result.exit_code == 0
    assert result.stderr == "2 requests, 2 different, 0 with faults\n"


def test_faults_name_the_line_of_the_file(tmp_path: Path) -> None:
    """Lines count as an editor counts them, blank ones too; nothing is computed by --check."""
    path = tmp_path / "r.ndjson"
    wrong = json.dumps(altered(tuning(), "/plant/n", 0))
    path.write_text(f"{json.dumps(tuning())}\n\n# half of them\n{wrong}\n")
    result = batch(path, "--check")
    assert result.exit_code == 2
    first, second, last = result.stderr.splitlines()
    assert first == f"{path}:3: a line holds a request and nothing else; JSON knows no comments"
    assert second.startswith(f"{path}:4: /plant/n: ")
    assert last == "3 requests, 3 different, 2 with faults"


def test_results_as_a_table(tmp_path: Path) -> None:
    """A row a request or a loop: what differs between the requests, and what was found."""
    requests = write(tmp_path / "r.ndjson", tuning(seed=800), "{}", tuning(seed=801))
    output = tmp_path / "results.csv"
    assert batch(requests, "-o", output, "--format", "csv").exit_code == 2
    with output.open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["line"] for row in table] == ["1", "2", "3"]
    assert [row["search.seed"] for row in table] == ["800", "", "801"]
    assert [row["tau_p"] for row in table] == ["800.0", "", "801.0"]
    assert [row["status"] for row in table] == ["optimal", "error", "optimal"]
    assert "/plant" in table[1]["error"]
    assert table[0]["setting_2.gain"] == "2.0"
    loops = batch(requests, "--format", "csv", "--rows", "loop", "--form", "parallel")
    rows = list(csv.DictReader(io.StringIO(loops.stdout)))
    assert [row["loop"] for row in rows] == ["1", "2", "", "1", "2"]
    assert [row["proportional_gain"] for row in rows] == ["1.0", "2.0", "", "1.0", "2.0"]
    again = batch(requests, "-o", output, "--format", "csv")
    assert again.exit_code == 2
    assert "exists" in again.stderr


def test_demands_are_columns() -> None:
    """Each with its limit, its value, whether it is met and whether it binds."""
    items = read_items(json.dumps(tuning()).encode())
    outcome = {"name": "max_load_error", "limit": 5.0, "value": 4.0, "met": True, "active": False}
    entry = {"index": 0, "digest": "", "result": {"status": "optimal", "demands": [outcome]}}
    (row,) = Table(items, each=Rows.REQUEST, form=SettingsForm.CASCADE).rows([entry])
    found = {name: value for name, value in row.items() if name.startswith("demand.")}
    prefix = "demand.max_load_error"
    assert found == {f"{prefix}.{key}": outcome[key] for key in ("limit", "value", "met", "active")}


def test_results_as_parquet(tmp_path: Path) -> None:
    """The same table with the types of its columns."""
    requests = write(tmp_path / "r.ndjson", tuning(seed=810), tuning(seed=811))
    output = tmp_path / "results.parquet"
    assert batch(requests, "-o", output, "--format", "parquet").exit_code == 0
    table = pq.read_table(output)
    assert table.column("tau_p").to_pylist() == [810.0, 811.0]
    assert table.column("search.seed").to_pylist() == [810, 811]


def test_a_scheduler_without_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The batch says whom it waits for, and ends when it has waited long enough."""
    monkeypatch.setenv("MUTUNE_WORKER_WAIT", "3")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    requests = write(tmp_path / "r.ndjson", tuning(seed=820))
    result = batch(requests, "--scheduler", f"tcp://127.0.0.1:{port}")
    assert result.exit_code == 5
    assert f"no worker at tcp://127.0.0.1:{port} for 3 s; 0 of 1 done" in result.stderr


@pytest.mark.parametrize("name", ["SIGINT", "SIGKILL"])
def test_stopped_process_goes_on_where_it_was(tmp_path: Path, name: str) -> None:
    """A real process is stopped amid the batch; the same command does the rest."""
    seeds = [700, 701, HELD, 703, 704, 705]
    requests = write(tmp_path / "r.ndjson", *(tuning(seed=seed) for seed in seeds))
    output = tmp_path / "results.ndjson"
    process = start(requests, output, tmp_path / "never")
    try:
        wait_for_lines(output, 1, process)
    finally:
        os.killpg(process.pid, getattr(signal, name))
        message = process.communicate()[1]
    done = len(read(output))
    assert 1 <= done < 6
    if name == "SIGINT":
        assert process.returncode == 130
        assert message.decode().splitlines()[-1].strip() == (
            f"Interrupted: {done} of 6 done. The same command does the rest."
        )
    assert batch(requests, "-o", output).exit_code == 0
    assert [entry["index"] for entry in read(output)] == list(range(6))
