"""Compile the numerical kernels ahead of their first use: ``python -m solver.warm``.

The compiled code is kept beside the modules, so that later processes start without compiling.
"""

from __future__ import annotations

import numpy as np

from solver.identification.identify import identify
from solver.identification.record import Record
from solver.model.controllers import Controller
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

__all__ = ["warm"]


def warm() -> None:
    """Tune a small plant, analyse the result, identify one: every compiled function is used."""
    plant = first_order(2, 1.0, 10.0, 0.5)
    uncertainty = Uncertainty.from_error(0.2, 1.0)
    proven_peaks(plant, uncertainty, Performance(tau_p=10.0), [Controller(2.0, 10.0)] * 2)
    tune(
        Specification(
            plant, uncertainty, Performance(),
            arrangement=Arrangement.IDENTICAL, starts=1, optimality_gap=True,
        )
    )  # fmt: skip
    _identify()


def _identify() -> None:
    """Identify a small plant, so that every form of element is tried."""
    time = np.arange(60.0)
    moved = np.where(time % 20 < 10, 1.0, 0.0) * (time > 5)
    output = np.convolve(moved, np.exp(-time / 5) / 5)[:60] + 0.01 * np.sin(7 * time)
    identify([Record(time, {"u": moved}, {"y": output})])


if __name__ == "__main__":
    warm()
