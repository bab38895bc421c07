"""What a tuning returns, and what it tells on the way. A failure is a status with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.certificate.record import Certificate
    from solver.model.controllers import Controller
    from solver.optimality.record import Optimality
    from solver.robustness.model_tolerance import ModelTolerance
    from solver.robustness.record import Curves, Guarantee, Peaks
    from solver.tuning.beside import AsFound, PriceOfResolution, SettingsTolerance
    from solver.tuning.demands import DemandOutcome
    from solver.tuning.spread import SpreadOutcome

__all__ = [
    "Comparison",
    "LocalOptimum",
    "Progress",
    "ScenarioOutcome",
    "SearchSummary",
    "Status",
    "Tuning",
]


ROUNDING = 1e-7  # of a peak of mu that is 1 at the optimum


class Status(StrEnum):
    """How a tuning ended, and what to try next.

    OPTIMAL: the best settings found meet the specification.
    LOCAL: the best settings beside given ones; the full search may do better.
    INFEASIBLE: none were found that do; `Tuning.reason` names what forbids it. Try (a) less
    uncertainty, (b) a larger permitted sensitivity peak, (c) wider parameter bounds.
    TIME_LIMIT: the search was cut short, by the limit or by the caller; the settings, if any, are
    the best up to then. Try (a) a longer time limit, (b) fewer starts.
    """

    OPTIMAL = "optimal"
    LOCAL = "local"
    INFEASIBLE = "infeasible"
    TIME_LIMIT = "time_limit"


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
    """What the search did.

    `starts` made, `local_optima` found (best first), `seed`, and `elapsed_seconds`, which do not
    count where two outcomes are compared.
    """

    starts: int
    local_optima: tuple[LocalOptimum, ...]
    seed: int
    elapsed_seconds: float = field(compare=False)


@dataclass(frozen=True)
class Comparison:
    """What different settings gain: the best identical settings beside the best ones.

    `identical_value` is the objective of `identical_loop` on every unit, `gain_percent` 100 (1
    - best/identical) of the objective.
    """

    identical_value: float
    identical_loop: Controller
    gain_percent: float


@dataclass(frozen=True)
class Progress:
    """State of a running tuning.

    `fraction` in 0..1, `starts_done` of about `starts`; `best` is the objective so far, None
    before the first feasible settings.
    """

    fraction: float
    best: float | None
    starts_done: int
    starts: int


@dataclass(frozen=True)
class ScenarioOutcome:
    """What the settings make of one scenario.

    Attributes
    ----------
    name : str
        Of the scenario; the plant of the task itself is there too.
    in_service : tuple of int
        Units in service, of the worst set where there are several.
    sets : int
        Different sets of loops in service, those that symmetry makes equal counted once.
    tau_p : float or None
        Least time constant that the settings permit here alone; None where it was given.
    peaks : Peaks
        Of the worst set, at the time constant of the result.
    curves : Curves
        Of the worst set.
    guarantee : Guarantee
        Of all its sets.
    certificates : tuple of Certificate
        One a set, where they were asked for and found.

    """

    name: str
    in_service: tuple[int, ...]
    sets: int
    tau_p: float | None
    peaks: Peaks
    curves: Curves
    guarantee: Guarantee
    certificates: tuple[Certificate, ...] = ()


@dataclass(frozen=True)
class Tuning:
    """Outcome of a tuning.

    `objective` is its name; `nominally_stable` speaks of the model, `curves` of mu over
    frequency (rad per time unit), `search` of what was tried, `comparison` of identical
    settings beside unlike ones, `warnings` of what to look at twice; `certificate` is there
    where it was asked for and found. `tau_p` (time units) and the peaks belong to `loops`, one
    a unit, `groups` lists the units that share settings; `demands` what they make of
    each further demand; `guarantee` tells what is proven of the peak for all frequencies, and in
    all `scenarios`, of which `active` names the one that decides; `spread` how densely a spread
    was searched;
    `model_tolerance` how wrong each parameter of the plant may be, alone, where that was asked for;
    `integrity` says in one line what happens with loops in manual; `optimality` how far tau_p is
    from the least possible one; `resolution` what it costs that the settings are numbers which the
    controllers accept, `settings_tolerance` how far they may be moved, `as_found` what today's
    settings do; `pairing` is the input of each output, from 0, where that was asked for; `advice`
    how the result may be read and used, in sentences.
    Where `status` is INFEASIBLE, `reason` and `omega` (the frequency that forbids it, rad per
    time unit) say why, and the other fields are None or empty.
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
    guarantee: Guarantee | None = None
    demands: tuple[DemandOutcome, ...] = ()
    scenarios: tuple[ScenarioOutcome, ...] = ()
    active: str | None = None
    spread: SpreadOutcome | None = None
    comparison: Comparison | None = None
    certificate: Certificate | None = None
    optimality: Optimality | None = None
    integrity: str | None = None
    pairing: tuple[int, ...] | None = None
    resolution: PriceOfResolution | None = None
    settings_tolerance: SettingsTolerance | None = None
    model_tolerance: tuple[ModelTolerance, ...] = ()
    as_found: AsFound | None = None
    reason: str | None = None
    omega: float | None = None
    advice: tuple[str, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())

    @property
    def demand_met(self) -> bool:
        """Whether the peak of robust performance is at most 1 in each scenario, rounding apart."""
        if self.peaks is None:
            return False
        every = (self.peaks, *(each.peaks for each in self.scenarios))
        return all(each.robust_performance.value <= 1 + ROUNDING for each in every)
