"""A type checker sees the public interface as it is: ten slips of a user, ten errors."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent

GOOD = """
import mutune

plant = mutune.first_order(2, gain=1, time_constant=100, interaction=0.949)
uncertainty = mutune.Uncertainty.from_error(0.2, 1, "full")
result = mutune.tune(plant, uncertainty, max_peak=2, controller="PI", arrangement="identical")
task = mutune.Specification(plant, uncertainty, mutune.Performance(), seed=1)
again: mutune.Tuned = mutune.tune(task)
best: float = min(each.tau_p for each in (result, again))
phase = [m.alone.phase_margin for m in result.margins if m.alone is not None]
response = result.simulate(setpoint={0: 1}, duration=100)
last: float = float(response.y[0, -1])
bode = plant.process.response([0.1, 1.0])
with mutune.Client() as client:
    print(client)
"""

SLIPS = [
    'mutune.tune(plant, uncertainty, controller="PIX")',
    'mutune.tune(plant, uncertainty, arrangment="identical")',
    "mutune.tune(uncertainty, plant)",
    'mutune.first_order(2, "1", 100, 0.9)',
    "mutune.first_order(2.5, 1, 100, 0.9)",
    'mutune.Uncertainty.from_error(0.2, 1, "ful")',
    "mutune.Specification(plant, uncertainty, mutune.Performance(), mutune.ControllerKind.PI)",
    "print(result.taup)",
    "result.simulate(setpoint=[1, 0], duration=100)",
    "mutune.analyze(plant)",
]


def checked(text: str, path: Path) -> list[int]:
    """Return the lines in which mypy finds errors, strict as in a user's project.

    With our own settings, since what a check of all modules leaves is then at hand.
    """
    path.write_text(text)
    done = subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, "-m", "mypy", "--no-error-summary", path],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode in {0, 1}, done.stderr
    place = (
        r"script\.py:(\d+): error"  # the folder may be that of an earlier check of the same text
    )
    return sorted({int(line) for line in re.findall(place, done.stdout, re.MULTILINE)})


def test_ten_slips_are_ten_errors(tmp_path: Path) -> None:
    """And what is right is right."""
    start = len(GOOD.splitlines())
    text = GOOD + "\n".join(SLIPS) + "\n"
    assert checked(text, tmp_path / "script.py") == list(range(start + 1, start + 11))
