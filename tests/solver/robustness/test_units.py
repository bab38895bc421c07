"""Robustness, bandwidths and interaction are the same in all units of time, inputs and outputs."""

from __future__ import annotations

import numpy as np
import pytest

from solver.interaction.analysis import analyse_interaction
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.record import Robustness

WOOD_BERRY = (
    ((12.8, 16.7, 1), (-18.9, 21, 3)),
    ((6.6, 10.9, 7), (-19.4, 14.4, 3)),
)


def plant(time: float, outputs: tuple[float, float], inputs: tuple[float, float]) -> MatrixPlant:
    """Return the column in other units."""
    return MatrixPlant(
        [
            [
                TransferFunction([k * outputs[r] / inputs[c]], [T * time, 1], L * time)
                for c, (k, T, L) in enumerate(row)
            ]
            for r, row in enumerate(WOOD_BERRY)
        ]
    )


def robustness(time: float, output: float, inputs: tuple[float, float]) -> Robustness:
    """Analyse settings of the column; both outputs in one unit, since the demand compares them."""
    loops = [
        Controller(0.2 * inputs[0] / output, 8 * time),
        Controller(-0.04 * inputs[1] / output, 6 * time),
    ]
    return analyse(
        plant(time, (output, output), inputs),
        Uncertainty.from_error(0.1, time),
        Performance(tau_p=30 * time),
        loops,
    )


@pytest.mark.parametrize(
    ("time", "output", "inputs"),
    [
        (1e-6, 1.0, (1.0, 1.0)),
        (1e6, 1.0, (1.0, 1.0)),
        (1.0, 1e-6, (1.0, 1.0)),
        (1.0, 1e6, (1.0, 1.0)),
        (1.0, 1.0, (1e-6, 1e6)),
    ],
)
def test_robustness_follows_the_units(
    time: float, output: float, inputs: tuple[float, float]
) -> None:
    """Peaks of mu, margins and bandwidths are those of the first units to 1e-8."""
    reference, got = robustness(1, 1, (1, 1)), robustness(time, output, inputs)
    assert reference.peaks is not None
    assert got.peaks is not None
    assert got.peaks.robust_performance.value == pytest.approx(
        reference.peaks.robust_performance.value, rel=1e-8
    )
    assert reference.bandwidths is not None
    assert got.bandwidths is not None
    for name in ("worst_direction", "best_direction"):
        expected = getattr(reference.bandwidths, name)
        assert getattr(got.bandwidths, name) * time == pytest.approx(expected, rel=1e-8)
    for mine, theirs in zip(got.margins, reference.margins, strict=True):
        assert mine.together is not None
        assert theirs.together is not None
        assert mine.together.phase_margin == pytest.approx(theirs.together.phase_margin, rel=1e-8)
        assert mine.together.gain_increase == pytest.approx(theirs.together.gain_increase, rel=1e-8)


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e3, 1e6])
def test_interaction_follows_the_units(unit: float) -> None:
    """Relative gains, pairing and verdict do not change, the zeros go with the unit of time."""
    reference = analyse_interaction(plant(1, (1, 1), (1, 1)))
    for time, outputs, inputs in (
        (unit, (1.0, 1.0), (1.0, 1.0)),
        (1.0, (unit, 1.0), (1.0, 1.0)),
        (1.0, (1.0, 1.0), (1.0, unit)),
    ):
        got = analyse_interaction(plant(time, outputs, inputs))
        assert got.relative_gains is not None
        assert reference.relative_gains is not None
        np.testing.assert_allclose(got.relative_gains, reference.relative_gains, rtol=1e-9)
        assert got.recommended is not None
        assert reference.recommended is not None
        assert got.recommended.inputs == reference.recommended.inputs
        assert got.integral_controllability is not None
        assert reference.integral_controllability is not None
        assert got.integral_controllability.verdict is reference.integral_controllability.verdict
        values = [zero.value * time for zero in got.zeros.zeros]
        np.testing.assert_allclose(
            values, [zero.value for zero in reference.zeros.zeros], rtol=1e-6, atol=1e-12
        )
