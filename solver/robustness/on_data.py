"""Robustness of given loops around a plant that is known at some frequencies only.

The same upper bounds of mu as for transfer functions, at those frequencies. There is nothing
between them that a peak could be refined on, and nothing is proven there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.errors import UnsupportedPlantError
from solver.model.peaks import Peak
from solver.robustness.curves import LoopAnalysis
from solver.robustness.record import Curves, Guarantee, GuaranteeStatus, Peaks, Robustness
from solver.robustness.worst_case import worst_case
from solver.stability.on_data import Undecided, at_rest, unstable_poles_on_data

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.measured import MeasuredPlant
    from solver.model.weights import Performance, Uncertainty

__all__ = ["analyse_on_data", "data_analysis", "demand_unseen", "on_data", "peaks_of"]


def analyse_on_data(
    plant: MeasuredPlant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    omega: NDArray[np.float64] | None = None,
) -> Robustness:
    """Analyse given loops at the frequencies of the data.

    Parameters
    ----------
    plant : MeasuredPlant
        Its `unstable_poles` are stated as 0.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit.
    omega : (k,) or None
        Frequencies of the curves, some of those of the data; None: all.

    Raises
    ------
    UnsupportedPlantError
        The data do not decide on stability, or have no such frequency.

    """
    unstable = unstable_poles_on_data(plant, at_rest(plant), loops)
    if isinstance(unstable, Undecided):
        message = f"stability cannot be decided on these data: {unstable}"
        raise UnsupportedPlantError(message, "/plant/omega")
    if unstable:
        return Robustness(
            nominally_stable=False,
            unstable_poles=unstable,
            peaks=None,
            curves=None,
            warnings=("the closed loop is unstable: mu has no meaning for it",),
        )
    analysis = data_analysis(plant, uncertainty, performance, loops)
    every = analysis.curves(plant.omega)
    peaks = peaks_of(every)
    top = np.array([peaks.robust_performance.omega])
    worst = worst_case(
        analysis.blocks, analysis.controllers, uncertainty, performance, omega=top,
        scales=analysis.scales(top),
    )  # fmt: skip
    return Robustness(
        nominally_stable=True,
        unstable_poles=0,
        peaks=peaks,
        curves=every if omega is None else analysis.curves(omega),
        lower_bound=Peak(worst.mu, worst.omega),
        worst_case=worst,
        uncertainty_scaling=1 / peaks.robust_stability.value,
        guarantee=on_data(plant, peaks),
        warnings=tuple(filter(None, [demand_unseen(plant, performance), worst.warning])),
    )


def data_analysis(
    plant: MeasuredPlant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
) -> LoopAnalysis:
    """Return what computes the curves of mu at the frequencies of the data."""
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    return LoopAnalysis(blocks, controllers, uncertainty, performance)


def peaks_of(curves: Curves) -> Peaks:
    """Return the highest values of curves at their own points."""

    def top(curve: NDArray[np.float64]) -> Peak:
        place = int(curve.argmax())
        return Peak(float(curve[place]), float(curves.omega[place]))

    return Peaks(
        top(curves.robust_performance),
        top(curves.robust_stability),
        top(curves.nominal_performance),
    )


def on_data(plant: MeasuredPlant, peaks: Peaks) -> Guarantee:
    """Return what is known of mu: its bound at the frequencies of the data, and no more."""
    return Guarantee(
        GuaranteeStatus.OPEN,
        peaks.robust_performance.value,
        f"the plant is known at {plant.omega.size} frequencies from {plant.omega[0]:.4g} to "
        f"{plant.omega[-1]:.4g} rad per time unit: mu is bounded there, and nothing is proven "
        "between them or beyond",
    )


def demand_unseen(plant: MeasuredPlant, performance: Performance) -> str | None:
    """Say that the demand bends below the data, where it does."""
    if performance.tau_p is None or performance.tau_p * plant.omega[0] <= 1:
        return None
    return (
        f"the demand bends at 1/tau_P = {1 / performance.tau_p:.4g} rad per time unit, below the "
        f"first frequency of the data, {plant.omega[0]:.4g}: what it asks further down is not seen"
    )
