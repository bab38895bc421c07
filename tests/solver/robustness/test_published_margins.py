"""Margins against numbers that other programs' own tests hold: a table of facts with sources."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from solver.model.transfer_function import TransferFunction
from solver.robustness.margins import margins

JULIA = "ControlSystems.jl, lib/ControlSystemsBase/test/test_analysis.jl (0fc9602)"
PYTHON_CONTROL = "python-control 0.7, control/tests/margin_test.py"
OMEGA = np.geomspace(1e-6, 1e6, 480)
# 8.75 (4 s^2 + 0.4 s + 1)/((100 s + 1)(s^2 + 0.22 s + 1)) over s^2/100 + 0.008 s + 1.
LIGHTLY_DAMPED = (
    tuple(8.75 * np.array([4, 0.4, 1])),
    tuple(np.polymul(np.polymul([100, 1], [1, 0.22, 1]), [0.01, 0.008, 1])),
)
DOUBLE_MASS = (
    tuple(100.0 * np.array([1, 2, 100])),
    tuple(np.polymul([1, 4, 203, 200, 0], [0.002, 1])),
)


@dataclass(frozen=True)
class Fact:
    """A loop L = num/den and what is printed of it; None where nothing is."""

    source: str
    num: tuple[float, ...]
    den: tuple[float, ...]
    gain: float | None
    phase: float | None = None
    digits: int = 3
    delay: float | None = None
    crossover: float | None = None


FACTS = (
    Fact(f"{PYTHON_CONTROL}, sys4", *LIGHTLY_DAMPED, gain=2.2716, phase=97.5941),
    Fact(f"{PYTHON_CONTROL}, sys2: gain -0.5 at 1.73205", (1,), (1, 2, 3, 4), gain=2.0),
    # There against its own grid; 6 11 - 6 = 60 = 15 times 4 by Routh.
    Fact(f"{PYTHON_CONTROL}, test_mag_phase_omega", (15,), (1, 6, 11, 6), gain=4.0),
    # There interpolated on a grid of 33 points a decade: right to 1.2e-3.
    Fact(f"{JULIA}, 1/(s^2 + s)", (1,), (1, 1, 0), gain=np.inf, digits=2, crossover=0.787113),
    # Two masses of 1 with a spring of 100 and dampers of 1, from the motor's torque to its place.
    Fact(f"{JULIA}, 100 double masses", *DOUBLE_MASS, gain=None, digits=6, delay=0.03743336),
    Fact(f"{JULIA}, 0.1/(s + 1)", (0.1,), (1, 1), gain=np.inf, delay=np.inf),
)


@pytest.mark.parametrize("fact", FACTS, ids=lambda fact: fact.source)
def test_margins_that_others_print(fact: Fact) -> None:
    """Margins of gain, phase and delay agree to the digits printed."""
    found = margins(TransferFunction(fact.num, fact.den).response, OMEGA)
    if fact.gain is not None:
        assert found.gain_increase == pytest.approx(fact.gain, abs=10.0**-fact.digits)
    if fact.phase is not None:
        assert found.phase_margin == pytest.approx(fact.phase, abs=10.0**-fact.digits)
    if fact.delay is not None:
        assert found.delay_margin == pytest.approx(fact.delay, abs=10.0**-fact.digits)
    if fact.crossover is not None:
        assert found.crossover == pytest.approx(fact.crossover, abs=10.0**-fact.digits)
