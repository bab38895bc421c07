"""The server of all processes, forked from one that had a life before."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

LOGGING = """
import logging, multiprocessing, sys
from service.jobs import forking

logging.basicConfig(filename=sys.argv[1])  # and the forked server takes that along

def child():
    for number in range(40):
        logging.getLogger().error("logged by a child %d", number)
    sys.exit(7)

if __name__ == "__main__":
    sys.modules["service.jobs.fork_server"] = sys  # nothing to compute: it starts at once
    with forking._forked():
        forking.start()
    context = multiprocessing.get_context("forkserver")
    for _ in range(2):
        process = context.Process(target=child)
        process.start()
        process.join()
        print(process.exitcode)
"""

APART = """
import sys
from pathlib import Path
from service.jobs import forking

kept = Path(sys.argv[1])

def work():
    kept.write_text("done elsewhere")
    raise ValueError("and it failed")

forking.apart(work)
print(kept.read_text())
"""


def run(folder: Path, program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program in a folder."""
    (folder / "program.py").write_text(program)
    return subprocess.run(  # noqa: S603 - our own
        [sys.executable, str(folder / "program.py"), *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


def test_log_file_that_was_open_is_not_written_into_what_was_opened_later(tmp_path: Path) -> None:
    """Whoever forked the server had a log; nothing of its children goes into a pipe of ours."""
    done = run(tmp_path, LOGGING, str(tmp_path / "log"))
    assert done.stdout.split() == ["7", "7"], done.stderr
    assert "resource_tracker" not in done.stderr
    assert "logged by a child" not in done.stderr


def test_work_done_apart_leaves_its_files_and_no_more(tmp_path: Path) -> None:
    """Its fault is not that of who asked for it."""
    done = run(tmp_path, APART, str(tmp_path / "kept"))
    assert done.returncode == 0
    assert done.stdout.split("\n")[0] == "done elsewhere"
