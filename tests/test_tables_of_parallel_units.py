"""Tables 1 to 4 of Skogestad, Lundstrom and Hovd in docs/sources.md."""

import json
import re
from pathlib import Path

import pytest

from solver.model.controllers import Controller
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse

ROOT = Path(__file__).parent.parent
BEST = json.loads((ROOT / "bench" / "zoo" / "best.json").read_text(encoding="utf-8"))
COLUMNS = ("PI identical", "PI independent", "PID identical", "PID independent")
PLANTS = [(tau, a) for tau in (10, 100) for a in (0, 0.827, 0.949, 0.984, 0.995)]


@pytest.mark.parametrize(("tau", "a"), PLANTS)
def test_the_table_has_the_best_known_values(tau: int, a: float) -> None:
    """Every number of the table is that of recorded settings, to the digits printed."""
    text = (ROOT / "docs" / "sources.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| {tau} \| {a} \| (.*) \|$", text, re.MULTILINE)
    assert row is not None
    for column, printed in zip(COLUMNS, row[1].split(" | "), strict=True):
        assert float(printed) == float(f"{BEST[f'SLH tau {tau} a {a}, {column}']['tau_p']:.5g}")


@pytest.mark.parametrize("column", COLUMNS)
@pytest.mark.parametrize(("tau", "a"), [(10, 0.827), (100, 0.949), (100, 0.984)])
def test_recorded_settings_meet_the_demand(tau: int, a: float, column: str) -> None:
    """Computed anew, mu of robust performance is 1 at the recorded tau_P."""
    best = BEST[f"SLH tau {tau} a {a}, {column}"]
    performance = Performance(max_peak=2, offset=0, tau_p=best["tau_p"])
    loops = tuple(Controller(**loop) for loop in best["loops"])
    plant = first_order(2, 1, tau, a)
    peaks = analyse(plant, Uncertainty.from_error(0.2, 1), performance, loops).peaks
    assert peaks is not None
    assert peaks.robust_performance.value == pytest.approx(1, abs=1e-5)
