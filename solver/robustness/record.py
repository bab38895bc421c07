"""What a robustness analysis returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.certificate import Certificate
    from solver.model.peaks import Peak
    from solver.robustness.bandwidth import Bandwidths
    from solver.robustness.margins import LoopMargins
    from solver.robustness.worst_case import WorstCase

__all__ = ["Curves", "Peaks", "Robustness"]


@dataclass(frozen=True)
class Peaks:
    """Peaks of the three mu curves, refined between grid points."""

    robust_performance: Peak
    robust_stability: Peak
    nominal_performance: Peak


@dataclass(frozen=True)
class Curves:
    """Upper bounds of mu over frequency, all (k,).

    `omega` in rad per time unit, ascending, or in the order in which it was given.
    """

    omega: NDArray[np.float64]
    robust_performance: NDArray[np.float64]
    robust_stability: NDArray[np.float64]
    nominal_performance: NDArray[np.float64]


@dataclass(frozen=True)
class Robustness:
    """Robustness of given loops.

    `peaks` and `curves` are None where the loops are nominally unstable: mu has no meaning then.
    `lower_bound` is a lower bound of the robust performance peak, `worst_case` a perturbation
    that reaches it. `uncertainty_scaling` is the factor by which the uncertainty may grow before
    robust stability is no longer assured. `margins`: of each different loop. `bandwidths`:
    alone and together, of a stable loop.
    """

    nominally_stable: bool
    unstable_poles: int
    peaks: Peaks | None
    curves: Curves | None
    lower_bound: Peak | None = None
    worst_case: WorstCase | None = None
    uncertainty_scaling: float | None = None
    margins: tuple[LoopMargins, ...] = ()
    bandwidths: Bandwidths | None = None
    certificate: Certificate | None = None
    warnings: tuple[str, ...] = field(default=())
