"""``scripts/run``: what it prints and what the README says of it; it leaves nothing behind."""

import re
import shutil
import socket
import subprocess
from pathlib import Path

import httpx
import pytest
from readme import blocks, rows
from touring import ROOT, Tour, touring


def test_run_shows_where_to_go_on(tour: Tour) -> None:
    """Page and API documentation answer where the output says."""
    assert httpx.get(f"{tour.url}/").is_success
    documentation = tour.wait_for(r"API documentation: (\S+)\n")[1]
    (script,) = re.findall(r'src="(\S+swagger\S+)"', httpx.get(documentation).text)
    assert httpx.get(tour.url + script).is_success


def test_run_once_ends_with_the_result_and_avoids_a_taken_port(tmp_path: Path) -> None:
    """A taken port is no obstacle, and nothing runs on afterwards."""
    with socket.socket() as taken:
        try:
            taken.bind(("127.0.0.1", 8000))
            taken.listen()
        except OSError:
            pass  # somebody else has it: as good
        with touring(tmp_path, "--once") as run:
            port = run.wait_for(r"Port 8000 is taken; the service uses (\d+)\.")[1]
            run.wait_for("independent")
            assert run.process.wait(300) == 0
    assert f":{port}/docs" in run.output
    assert run.left_behind() == []


@pytest.mark.parametrize("moment", ["Starting the service", "Ctrl-C stops it"])
def test_interrupted_run_stops_everything(tmp_path: Path, moment: str) -> None:
    """Ctrl-C ends it with exit code 0, at the start as well as later, and no process is left."""
    with touring(tmp_path) as run:
        run.wait_for(moment)
        assert run.interrupt() == 0
    assert run.left_behind() == []
    assert "Traceback" not in run.output
    assert "Stopped." in run.output


def test_table_is_what_the_run_prints(tour: Tour) -> None:
    """Each row of the README's table is printed, with its numbers."""
    said, printed = rows(blocks("")[0]), rows(tour.output)
    assert len(said) == 8
    assert said.keys() == printed.keys()
    for label, values in said.items():
        # The objective is sharp. Settings at its flat bottom move with the last bits of a sum.
        tolerance = 1e-4 if "time constant" in label else 2e-3
        assert values == pytest.approx(printed[label], rel=tolerance), label


def test_python_calls_work(tour: Tour, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both Python examples run as they stand, with and without the service."""
    monkeypatch.chdir(ROOT)
    with_service, without = blocks("python")
    for code in (with_service.replace("http://127.0.0.1:8000", tour.url), without):
        names: dict[str, object] = {}
        exec(code, names)  # noqa: S102 - the README's own code
        assert getattr(names["result"], "tau_p", None) == pytest.approx(18.446, rel=1e-4)


@pytest.mark.skipif(shutil.which("curl") is None, reason="SKIPPED: curl is not installed")
def test_curl_call_works(tour: Tour) -> None:
    """The curl example returns a finished job."""
    (command,) = (block for block in blocks("sh") if block.startswith("curl"))
    command = command.replace("http://127.0.0.1:8000", tour.url)
    done = subprocess.run(  # noqa: S602 - the README's own command
        command, shell=True, cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert '"status":"succeeded"' in done.stdout
