"""What a robustness analysis returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from solver.model.equality import ByValue

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.certificate.record import Certificate
    from solver.model.peaks import Peak
    from solver.robustness.bandwidth import Bandwidths
    from solver.robustness.margins import LoopMargins
    from solver.robustness.model_tolerance import ModelTolerance
    from solver.robustness.worst_case import WorstCase

__all__ = ["Curves", "Guarantee", "GuaranteeStatus", "Peaks", "Robustness"]


@dataclass(frozen=True)
class Peaks:
    """Peaks of the three mu curves, refined between grid points.

    `robust_performance`, `robust_stability` and `nominal_performance`, as in `Curves`.
    """

    robust_performance: Peak
    robust_stability: Peak
    nominal_performance: Peak


@dataclass(frozen=True, eq=False)
class Curves(ByValue):
    """Upper bounds of mu over frequency, all (k,).

    `robust_performance` is mu(N_RP), `robust_stability` mu(w_I C S G), `nominal_performance`
    sigma_max(w_P S): Skogestad, Lundstrom and Hovd (1989), eq. 31. `omega` in rad per time
    unit, ascending, or in the order in which it was given.
    """

    omega: NDArray[np.float64]
    robust_performance: NDArray[np.float64]
    robust_stability: NDArray[np.float64]
    nominal_performance: NDArray[np.float64]


class GuaranteeStatus(StrEnum):
    """Whether a level of mu holds at all frequencies.

    PROVEN: it does, with all rounding, and the loops are nominally stable.
    OPEN: no proof was found; the peak is the highest value that the search met.
    """

    PROVEN = "proven"
    OPEN = "open"


@dataclass(frozen=True)
class Guarantee:
    """What is known of mu over all frequencies: `status`, at or below `level` if PROVEN.

    `reason` says why the question is open; None where it is proven.
    """

    status: GuaranteeStatus
    level: float
    reason: str | None = None


@dataclass(frozen=True)
class MarginsGuarantee:
    """What is known over all frequencies of Ms, Mt and the bandwidths, alone and together.

    `status` is PROVEN: no frequency exceeds a peak, and no curve reaches 0.707 before its
    bandwidth, by more than the relative amount `within`; or OPEN: of some there is no proof, for
    the `reason` given.
    """

    status: GuaranteeStatus
    within: float
    reason: str | None = None


@dataclass(frozen=True)
class Robustness:
    """Robustness of given loops.

    `nominally_stable` speaks of the model; `unstable_poles` are its closed-loop poles with
    Re s >= 0 but for those at s = 0, `poles_at_origin`, where integrators drift.
    `stable_gain_factor` is for unstable loops: all gains times any factor below it are stable;
    None where none was found, or not sought. `certificate` is there where it was asked for and
    found, `warnings` say what to look at twice.
    `peaks` and `curves` are None where the loops are nominally unstable: mu has no meaning then.
    `guarantee` is of the robust performance peak, None for an unstable loop. `lower_bound` is a
    lower bound of that peak, `worst_case` a perturbation that reaches it. `uncertainty_scaling` is
    the factor by which the uncertainty may grow before robust stability is no longer assured.
    `margins`: of each different loop. `bandwidths`: alone and together, of a stable loop.
    `margins_guarantee`: what is proven of both, None without margins.
    `model_tolerance`: how wrong the parameters of the plant may be, of a stable loop.
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
    margins_guarantee: MarginsGuarantee | None = None
    certificate: Certificate | None = None
    guarantee: Guarantee | None = None
    poles_at_origin: int = 0
    stable_gain_factor: float | None = None
    model_tolerance: tuple[ModelTolerance, ...] = ()
    warnings: tuple[str, ...] = field(default=())
