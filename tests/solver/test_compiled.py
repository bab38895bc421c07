"""Where compiled code is kept, and how long: processes that may write nowhere use what is there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import solver.compiled

KERNEL = """
import logging
import sys

from compiled import compiled
from halving import half

logging.basicConfig(format="LOG %(message)s", stream=sys.stdout)


@compiled()
def twice(x):
    return half(4 * x)


if __name__ == "__main__":
    import kernel

    print(kernel.twice(3.0), sum(kernel.twice.stats.cache_hits.values()))
"""

HALVING = """
from compiled import compiled


@compiled(error_model="numpy")
def half(x):
    return x / 2
"""

CONSTANTS = """
from compiled import compiled


@compiled()
def moved(x, up):
    return x + 1 if up else x - 1


@compiled()
def both_ways(x):
    return moved(x, True) * moved(x, up=False)


print(both_ways(3.0), len(moved.signatures))
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    """Return a folder with a compiled function, readable by everybody."""
    found = Path(tempfile.mkdtemp(prefix="mutune-compiled-"))
    shutil.copy(solver.compiled.__file__, found / "compiled.py")
    (found / "kernel.py").write_text(KERNEL)
    (found / "halving.py").write_text(HALVING)
    found.chmod(0o755)
    yield found
    for place in (found, found / "__pycache__"):
        if place.exists():
            place.chmod(0o755)
    shutil.rmtree(found)


# Root may write where nobody may, unless it gives that up.
AS_OTHERS = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []
NO_HOME = {"HOME": "/proc/none"}

needs_setpriv = pytest.mark.skipif(
    bool(AS_OTHERS) and shutil.which("setpriv") is None, reason="setpriv is not installed"
)


def run(
    folder: Path, *, may_write: bool, program: str = "kernel.py", **environment: str
) -> list[str]:
    """Return what the program prints."""
    if not may_write:
        for place in (folder, folder / "__pycache__"):
            if place.exists():
                place.chmod(0o555)
    done = subprocess.run(  # noqa: S603 - our own
        [*([] if may_write else AS_OTHERS), sys.executable, str(folder / program)],
        capture_output=True,
        text=True,
        env={"PATH": os.environ["PATH"], "PYTHONDONTWRITEBYTECODE": "1", **environment},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@needs_setpriv
@pytest.mark.parametrize("cache_dir", [None, "/proc/none", "/proc"])
def test_code_compiled_before_is_used_where_nothing_can_be_written(
    folder: Path, cache_dir: str | None
) -> None:
    """Whatever NUMBA_CACHE_DIR says, and without a home."""
    assert run(folder, may_write=True) == ["6.0 0"]
    environment = {} if cache_dir is None else {"NUMBA_CACHE_DIR": cache_dir}
    assert run(folder, may_write=False, **NO_HOME, **environment) == ["6.0 1"]


@needs_setpriv
def test_without_any_place_it_is_compiled_and_said_once(folder: Path) -> None:
    """Two functions are compiled, one line says so."""
    lines = run(folder, may_write=False, **NO_HOME)
    assert lines[-1] == "6.0 0"
    assert [line[:40] for line in lines[:-1]] == ["LOG compiled code can be kept nowhere: e"[:40]]


@needs_setpriv
def test_what_cannot_be_kept_beside_the_modules_is_kept_elsewhere(
    folder: Path,
) -> None:
    """The folder that NUMBA_CACHE_DIR names comes first where it can be written."""
    kept = Path(tempfile.mkdtemp(prefix="mutune-kept-"))
    kept.chmod(0o777)
    try:
        environment = {**NO_HOME, "NUMBA_CACHE_DIR": str(kept)}
        assert run(folder, may_write=False, **environment) == ["6.0 0"]
        assert run(folder, may_write=False, **environment) == ["6.0 1"]
    finally:
        shutil.rmtree(kept)


def test_code_into_which_another_module_is_compiled_changes_with_it(folder: Path) -> None:
    """Its own file is the same; what was kept would give the old result."""
    assert [run(folder, may_write=True) for _ in range(2)] == [["6.0 0"], ["6.0 1"]]
    (folder / "halving.py").write_text(HALVING.replace("x / 2", "x / 3"))
    assert [run(folder, may_write=True) for _ in range(2)] == [["4.0 0"], ["4.0 1"]]


def test_a_function_is_compiled_once_whatever_constants_its_callers_pass(folder: Path) -> None:
    """By position and by name."""
    (folder / "constants.py").write_text(CONSTANTS)
    assert run(folder, may_write=True, program="constants.py") == ["8.0 1"]
