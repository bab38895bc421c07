"""``scripts/run``: what it prints, and that it leaves nothing behind."""

import re
import socket
from pathlib import Path

import httpx
import pytest
from touring import Tour, touring


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
