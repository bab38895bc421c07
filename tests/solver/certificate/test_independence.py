"""The check needs the document alone: another process, and nothing of tuner or mu."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from typer.testing import CliRunner

from service.cli.commands import app
from solver.certificate.record import Certificate

CHECK = """
import sys
from solver.certificate.verify import verify
outcome = verify(sys.stdin.buffer.read())
ours = {
    "solver", "solver.model", "solver.certificate",
    *(f"solver.model.{name}" for name in (
        "errors", "validation", "precision", "transfer_function", "plants", "controllers",
        "weights", "given", "mixed_plant")),
    *(f"solver.certificate.{name}" for name in (
        "reading", "record", "reduction", "taylor_models", "enclosures", "enclosed_loop", "proof",
        "verify")),
}
ours_or_heavy = ("solver", "service", "mutune", "numba", "cvxpy", "scipy")
used = sorted(
    name for name in sys.modules if name.split(".")[0] in ours_or_heavy and name not in ours
)
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
        timeout=600,
    )
    assert done.stdout.decode().split("\n")[0] == "proven None []"


def test_the_command_exits_with_0_or_1(certificate: Certificate, tmp_path: Path) -> None:
    """``mutune verify``: 0 and the level for a proof, 1 and the place for a refusal."""
    sound, altered = tmp_path / "sound.json", tmp_path / "altered.json"
    sound.write_text(json.dumps(certificate.to_document()))
    document = certificate.to_document()
    document["intervals"][2]["scales"][0] *= 2
    altered.write_text(json.dumps(document))
    proven = CliRunner().invoke(app, ["verify", str(sound)])
    assert proven.exit_code == 0
    assert "mu <= 1.0004" in proven.stdout
    refused = CliRunner().invoke(app, ["verify", str(altered)])
    assert refused.exit_code == 1
    assert "/digest" in refused.stderr


def test_the_command_names_the_interval_that_fails(
    certificate: Certificate, tmp_path: Path
) -> None:
    """A sealed certificate of a level below the peak is refused near 0.0314 rad."""
    path = tmp_path / "too_low.json"
    too_low = replace(certificate, claim=replace(certificate.claim, gamma=1.0003))
    path.write_text(json.dumps(too_low.to_document()))
    refused = CliRunner().invoke(app, ["verify", str(path)])
    assert refused.exit_code == 1
    found = re.search(r"from ([\d.]+) to ([\d.]+) rad", refused.stderr)
    assert found
    assert float(found[1]) < 0.0314362
    assert float(found[2]) > 0.02
