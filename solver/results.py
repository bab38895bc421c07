"""Records that the solver returns. All are frozen; a failure is a status with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.certificate import Certificate
    from solver.controllers import Controller
    from solver.margins import LoopMargins
    from solver.mu.worst_case import WorstCase
    from solver.optimality.record import Optimality

__all__ = [
    "Comparison",
    "Curves",
    "LocalOptimum",
    "Peak",
    "Peaks",
    "Progress",
    "Robustness",
    "SearchSummary",
    "Status",
    "Tuning",
]


class Status(StrEnum):
    """How a tuning ended, and what to try next.

    OPTIMAL: the best settings found meet the specification.
    INFEASIBLE: none were found that do; `Tuning.reason` names what forbids it. Try (a) less
    uncertainty, (b) a larger permitted sensitivity peak, (c) wider parameter bounds.
    TIME_LIMIT: the search was cut short; the settings, if any, are the best up to then. Try (a)
    a longer time limit, (b) fewer starts.
    """

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    TIME_LIMIT = "time_limit"


@dataclass(frozen=True)
class Peak:
    """Greatest value of a curve and the frequency (rad per time unit) where it is reached."""

    value: float
    omega: float


@dataclass(frozen=True)
class Peaks:
    """Peaks of the three mu curves, refined between grid points."""

    robust_performance: Peak
    robust_stability: Peak
    nominal_performance: Peak


@dataclass(frozen=True)
class Curves:
    """Upper bounds of mu over frequency, all (k,).

    `omega` in rad per time unit, ascending.
    """

    omega: NDArray[np.float64]
    robust_performance: NDArray[np.float64]
    robust_stability: NDArray[np.float64]
    nominal_performance: NDArray[np.float64]


@dataclass(frozen=True)
class LocalOptimum:
    """A distinct local optimum: its value, how many starts ended there, its loops.

    Permuted copies count as one. The value of one that cannot win is of the search's grid.
    """

    value: float
    count: int
    loops: tuple[Controller, ...]


@dataclass(frozen=True)
class SearchSummary:
    """What the search did: starts made, best optima found (best first), seed, duration."""

    starts: int
    local_optima: tuple[LocalOptimum, ...]
    seed: int
    elapsed_seconds: float


@dataclass(frozen=True)
class Comparison:
    """What asymmetry buys: the best identical settings beside the best ones.

    `gain_percent` is 100 (1 - best/identical) of the objective.
    """

    identical_value: float
    identical_loop: Controller
    gain_percent: float


@dataclass(frozen=True)
class Progress:
    """State of a running tuning.

    `fraction` in 0..1; `best` is the objective so far, None before the first feasible settings.
    """

    fraction: float
    best: float | None
    starts_done: int
    starts: int


@dataclass(frozen=True)
class Tuning:
    """Outcome of a tuning.

    `tau_p` (time units) and the peaks belong to `loops`, one a unit, `groups` lists the units
    that share settings; `integrity` says in one line what happens with loops in manual;
    `optimality` how far tau_p is from the least possible one. Where
    `status` is INFEASIBLE, `reason` and `omega` (the frequency that forbids it, rad per time
    unit) say why, and the other fields are None or empty.
    """

    status: Status
    objective: str
    tau_p: float | None
    peaks: Peaks | None
    loops: tuple[Controller, ...]
    groups: tuple[tuple[int, ...], ...]
    nominally_stable: bool
    search: SearchSummary
    curves: Curves | None
    comparison: Comparison | None = None
    certificate: Certificate | None = None
    optimality: Optimality | None = None
    integrity: str | None = None
    reason: str | None = None
    omega: float | None = None
    warnings: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class Robustness:
    """Robustness of given loops.

    `peaks` and `curves` are None where the loops are nominally unstable: mu has no meaning then.
    `lower_bound` is a lower bound of the robust performance peak, `worst_case` a perturbation
    that reaches it. `uncertainty_scaling` is the factor by which the uncertainty may grow before
    robust stability is no longer assured. `margins`: of each different loop.
    """

    nominally_stable: bool
    unstable_poles: int
    peaks: Peaks | None
    curves: Curves | None
    lower_bound: Peak | None = None
    worst_case: WorstCase | None = None
    uncertainty_scaling: float | None = None
    margins: tuple[LoopMargins, ...] = ()
    certificate: Certificate | None = None
    warnings: tuple[str, ...] = field(default=())
