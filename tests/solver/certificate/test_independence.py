"""The check needs the document alone: another process, and nothing of tuner or mu."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from solver.certificate import Certificate

CHECK = """
import sys
from solver.certificate import verify
outcome = verify(sys.stdin.buffer.read())
used = [name for name in sys.modules if name.startswith(("solver.mu", "solver.tuning", "numba",
        "solver.blocks", "solver.stability", "solver.robustness", "cvxpy", "scipy"))]
print(outcome.verdict, outcome.interval, used)
"""


def test_a_certificate_verifies_in_a_process_that_has_only_its_json(
    certificate: Certificate,
) -> None:
    """The published case is proven again, without the code that tuned it or computed mu."""
    done = subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, "-c", CHECK],
        input=json.dumps(certificate.to_document()).encode(),
        capture_output=True,
        check=True,
        timeout=120,
    )
    assert done.stdout.decode().split("\n")[0] == "proven None []"


def test_the_command_exits_with_0_or_1(certificate: Certificate, tmp_path: Path) -> None:
    """``mutune verify``: 0 and the level for a proof, 1 and the interval for a refusal."""
    sound, altered, missing = (tmp_path / f"{name}.json" for name in ("sound", "altered", "none"))
    sound.write_text(json.dumps(certificate.to_document()))
    document = certificate.to_document()
    document["intervals"][2]["scales"][0] *= 2
    altered.write_text(json.dumps(document))
    proven = _command(sound)
    assert proven.returncode == 0
    assert "mu <= 1.0004" in proven.stdout
    refused = _command(altered)
    assert refused.returncode == 1
    assert "/digest" in refused.stderr
    assert "Traceback" not in refused.stderr
    assert _command(missing).returncode == 2


def _command(path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # noqa: S603 - the same
        [sys.executable, "-c", "from service.cli import main; main()", "verify", str(path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
