"""The bound at the peak, recomputed by semidefinite programming.

The same D-scaling bound of the same N_RP (Skogestad, Lundstrom and Hovd 1989, eq. 31), by another
method and other code than the kernel: cvxpy and Clarabel (`solver.mu.sdp`). Both are recomputed
from the scales that they return, so both are bounds; near each other they speak for each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.errors import InvalidInputError
from solver.model.peaks import Peak, local_peaks
from solver.mu.sdp import upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.curves import LoopAnalysis

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty
    from solver.robustness.centralised_curves import CentralisedAnalysis

__all__ = ["MAX_CHANNELS", "CrossCheck", "cross_check", "cross_check_full", "cross_check_peaks"]

MAX_CHANNELS = 20  # of all blocks together: some seconds; the program grows with its sixth power
PEAKS = 8  # highest ones; a second each for four different loops
AGREEMENT = 1e-5  # relative; the kernel's last digits are beyond what a program is solved to


@dataclass(frozen=True)
class CrossCheck:
    """Two upper bounds of mu of robust performance at one frequency.

    Attributes
    ----------
    omega : float
        Where the kernel found the peak, rad per time unit.
    kernel, sdp : float
        The bounds there, by the kernel and by semidefinite programming.
    agree : bool
        Whether they are within 1e-5 of each other.

    """

    omega: float
    kernel: float
    sdp: float
    agree: bool


def cross_check(analysis: LoopAnalysis, peak: Peak) -> CrossCheck:
    """Return the bound at the peak of robust performance by both methods.

    Parameters
    ----------
    analysis : LoopAnalysis
        The loop.
    peak : Peak
        Its peak of robust performance.

    Raises
    ------
    InvalidInputError
        Too many different loops for a semidefinite program.

    """
    return _both(analysis, analysis, peak)


def cross_check_full(
    analysis: CentralisedAnalysis, whole: CentralisedAnalysis, peak: Peak
) -> CrossCheck:
    """Return the bound at the peak under a full controller by both methods.

    Parameters
    ----------
    analysis : CentralisedAnalysis
        Plant and controller as the kernel is given them.
    whole : CentralisedAnalysis
        The same plant and controller as semidefinite programming is given them: where they are
        parallel, as matrices that need not be.
    peak : Peak
        The peak of robust performance.

    """
    return _both(analysis, whole, peak)


def cross_check_peaks(
    plant: Plant, uncertainty: Uncertainty, performance: Performance, loops: Sequence[Controller]
) -> list[CrossCheck]:
    """Return the bounds at the highest peaks of robust performance, by ascending frequency.

    Parameters
    ----------
    plant : Plant
        The plant.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit, nominally stable together.

    Raises
    ------
    InvalidInputError
        As `cross_check`.

    """
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    curve = analysis.robust_performance
    where, heights = local_peaks(curve, analysis.omega, curve(analysis.omega))
    highest = np.sort(np.argsort(heights)[::-1][:PEAKS])
    return [cross_check(analysis, Peak(float(heights[at]), float(where[at]))) for at in highest]


def _both(
    analysis: LoopAnalysis | CentralisedAnalysis,
    programs: LoopAnalysis | CentralisedAnalysis,
    peak: Peak,
) -> CrossCheck:
    """Return the bound of `analysis` by the kernel, that of `programs` by the other method."""
    channels = sum(block.size for block in programs.blocks.blocks)
    if channels > MAX_CHANNELS:
        message = f"the check by semidefinite programming is for up to {MAX_CHANNELS} channels"
        raise InvalidInputError(message, "/method")
    omega = np.array([peak.omega])
    N, structure = _stacked(programs.blocks, [N[0] for N in programs.matrices(omega)])
    sdp = float(upper_bound(N[None], structure).mu[0])
    kernel = float(analysis.robust_performance(omega)[0])
    agree = abs(sdp - kernel) <= AGREEMENT * kernel
    return CrossCheck(peak.omega, kernel, sdp, agree)


def _stacked(
    blocks: LoopBlocks, matrices: list[NDArray[np.complex128]]
) -> tuple[NDArray[np.complex128], BlockStructure]:
    """Return all blocks as one matrix, uncertain channels first; they share their scales."""
    total = sum(block.size for block in blocks.blocks)
    demanded = sum(block.outputs for block in blocks.blocks)
    N = np.zeros((total + demanded, total + demanded), dtype=complex)
    first, last = 0, total
    for block, matrix in zip(blocks.blocks, matrices, strict=True):
        ends = first + block.size, last + block.outputs
        place = np.concatenate([np.arange(first, ends[0]), np.arange(last, ends[1])])
        N[np.ix_(place, place)] = matrix
        first, last = ends
    return N, BlockStructure(tuple(s for block in blocks.blocks for s in block.scales), demanded)
