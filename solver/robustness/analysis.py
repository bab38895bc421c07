"""Robustness of given loops: nominal stability, mu over frequency, its peaks, what attains them.

N_RP = [[w_I C S G, w_I C S], [w_P S G, w_P S]], S = (I + G C)^-1: Skogestad, Lundstrom and Hovd
(1989), eq. 31. Robust stability is mu of its first block, nominal performance the norm of its last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.certificate.search import PROVEN_ABOVE, prove
from solver.model.blocks import group_loops
from solver.model.given import require_loops, require_weights
from solver.model.measured import MeasuredPlant
from solver.model.neighbours import NeighbourPlant
from solver.model.peaks import Peak
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.remarks import plant_remarks
from solver.model.validation import MAX_FREQUENCIES, flag, frequencies
from solver.robustness.axis import proven_count, proven_peaks
from solver.robustness.bandwidth import bandwidths
from solver.robustness.curves import LoopAnalysis
from solver.robustness.gain_factor import stable_gain_factor
from solver.robustness.margins import loop_frequencies, loop_margins
from solver.robustness.model_tolerance import model_tolerances, tolerance_remark
from solver.robustness.on_data import analyse_on_data
from solver.robustness.proven_margins import proven_margins
from solver.robustness.record import Robustness
from solver.robustness.worst_case import worst_case
from solver.stability.closed_loop import ClosedLoopPoles, closed_loop_poles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.certificate.record import Certificate
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty
    from solver.robustness.axis import AxisPeaks

__all__ = ["MANY", "analyse"]

MANY = (
    f"of a ring or a row of more than {MAX_MATRIX_SIZE} units the bounds of mu are computed; lower "
    "bound, margins and certificate are not"
)


def analyse(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    omega: ArrayLike | None = None,
    *,
    certificate: bool = False,
    model_tolerance: bool = True,
) -> Robustness:
    """Analyse given loops.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit.
    omega : (k,) or None
        Frequencies of the curves, rad per time unit, > 0, at most `MAX_FREQUENCIES`, in any
        order, which the curves keep; None: a grid chosen from the loop. The peaks are those of all
        frequencies in any case.
    certificate : bool
        Whether to prove a level just above the robust performance peak for all frequencies.
    model_tolerance : bool
        Whether to tell how wrong each parameter of the plant may be, most of the work for large
        matrices.

    Raises
    ------
    InvalidInputError
        Not one loop a unit, no `tau_p`, frequencies that are not finite and positive.
    UnsupportedPlantError
        The plant is open-loop unstable.

    """
    loops = require_loops(plant, loops)
    require_weights(plant, uncertainty, performance)
    certificate = flag(certificate, "/certificate")
    model_tolerance = flag(model_tolerance, "/model_tolerance")
    wanted = None if omega is None else frequencies(omega, most=MAX_FREQUENCIES)
    if isinstance(plant, MeasuredPlant):
        return analyse_on_data(plant, uncertainty, performance, loops, wanted)
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    poles = closed_loop_poles(plant, loops)
    if not poles.at_origin:
        # The count on a grid ends at so many points; the proof misses nothing between them.
        proven = proven_count(plant, loops, analysis)
        poles = poles if proven is None else ClosedLoopPoles(proven, 0)
    if not poles.stable:
        return Robustness(
            nominally_stable=False,
            unstable_poles=poles.right_half_plane,
            poles_at_origin=poles.at_origin,
            peaks=None,
            curves=None,
            stable_gain_factor=None if poles.at_origin else stable_gain_factor(plant, loops),
            margins=()
            if isinstance(plant, NeighbourPlant)
            else loop_margins(plant, loops, stable=False),
            warnings=(_unstable(poles), *plant_remarks(plant)),
        )
    axis = proven_peaks(plant, uncertainty, performance, loops)
    peaks = axis.peaks
    top = np.array([peaks.robust_performance.omega])
    if isinstance(plant, NeighbourPlant):
        return _of_many(plant, axis, analysis, wanted, loops)
    worst = worst_case(
        blocks, controllers, uncertainty, performance, omega=top, scales=analysis.scales(top)
    )
    proof: Certificate | None = None
    warnings = [*plant_remarks(plant), *_sign_unknown(uncertainty)]
    warnings += filter(None, [worst.warning, tolerance_remark(plant) if model_tolerance else None])
    if certificate:
        level = PROVEN_ABOVE * peaks.robust_performance.value
        proof, reasons = prove(plant, uncertainty, performance, loops, level, ends=axis.ends(level))
        warnings += reasons
    margins = loop_margins(plant, loops, stable=True)
    alone = [row.alone.bandwidth if row.alone else None for row in margins]
    speeds = bandwidths(plant, loops, alone, loop_frequencies(plant, loops))
    margins, speeds, margins_guarantee = proven_margins(plant, loops, margins, speeds)
    return Robustness(
        nominally_stable=True,
        unstable_poles=0,
        peaks=peaks,
        curves=axis.curves if wanted is None else analysis.curves(wanted),
        lower_bound=Peak(worst.mu, worst.omega),
        worst_case=worst,
        uncertainty_scaling=1 / peaks.robust_stability.value,
        margins=margins,
        bandwidths=speeds,
        margins_guarantee=margins_guarantee,
        certificate=proof,
        guarantee=axis.guarantee,
        model_tolerance=model_tolerances(plant, performance, loops, axis.curves.omega)
        if model_tolerance
        else (),
        warnings=tuple(warnings),
    )


def _of_many(
    plant: NeighbourPlant,
    axis: AxisPeaks,
    analysis: LoopAnalysis,
    wanted: NDArray[np.float64] | None,
    loops: Sequence[Controller],
) -> Robustness:
    """Return what is computed of a ring or a row of many units: the bounds and how fast it is."""
    return Robustness(
        nominally_stable=True,
        unstable_poles=0,
        peaks=axis.peaks,
        curves=axis.curves if wanted is None else analysis.curves(wanted),
        uncertainty_scaling=1 / axis.peaks.robust_stability.value,
        bandwidths=bandwidths(plant, loops, [None], loop_frequencies(plant, loops)),
        guarantee=axis.guarantee,
        warnings=(MANY, *plant_remarks(plant), *_sign_unknown(analysis.uncertainty)),
    )


def _sign_unknown(uncertainty: Uncertainty) -> list[str]:
    """Say where inputs, or outputs, may err by all that they are: 20 typed for 20 %, it may be."""
    found = []
    for each, which in ((uncertainty, "an input"), (uncertainty.outputs, "an output")):
        error = 0.0 if each is None else max(abs(weight.static_gain) for weight in each.weights)
        if error >= 1:
            found.append(
                f"the uncertainty is {100 * error:.4g} % at steady state: {which} may act with the "
                "other sign or not at all, and no loop with integral action stands that; 20 % is "
                "0.2"
            )
    return found


def _unstable(poles: ClosedLoopPoles) -> str:
    """Say what is wrong with loops that are not stable."""
    if poles.right_half_plane:
        return "the closed loop is unstable: mu has no meaning for it"
    count = "a closed-loop pole" if poles.at_origin == 1 else f"{poles.at_origin} closed-loop poles"
    return (
        f"{count} at s = 0: the static gain of the plant is singular, so the controllers' "
        "integrators cannot act independently and drift apart, while the outputs settle only "
        "where the plant can hold them; let one of them integrate and share its output (see the "
        "analysis of parallel drives). mu has no meaning for such loops"
    )
