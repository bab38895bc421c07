"""The last word on settings: their peak over the whole axis, and the search that goes on from it.

What the search saw is a grid with refined peaks. Where the proven peak is above the level, its
frequency joins the grid and the search goes on; settings whose peak is above the level are never
returned as meeting it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST
from solver.robustness.axis import AxisPeaks, proven_peaks
from solver.robustness.record import GuaranteeStatus
from solver.tuning.endless import extended
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.robustness.record import Peaks
    from solver.tuning.clock import Clock
    from solver.tuning.exact import Candidate
    from solver.tuning.search import GroupingSearch
    from solver.tuning.specification import Specification
    from solver.tuning.spread import SpreadOutcome

__all__ = ["Settled", "settled"]

ROUNDING = 1e-9  # relative addition to tau_P that keeps mu <= 1 under rounding
ABOVE = 2e-8  # relative excess of the proven peak that is rounding of the kernel
ROUNDS = 6  # of the search with the peaks that the proof found
SPREAD_ROUNDS = 12  # and with the worst plants of a spread
NEARLY = 0.02  # relative distance below the peak of maxima that are as good as active
MOST_PLACES = 50  # of them that join the grid in one round
WORSE = 1e-6  # of s: a plant of the spread that is worse by more joins the cases
FOOLED = 1e-3  # relative excess of the proven peak over what the search saw
BACK = np.geomspace(1e-7, 0.3, 28)  # shares by which gains are lowered: the edge may be as near
LOOKS = 25  # at a peak, for each parameter and one more, of a descent beside the edge of stability
DESCENTS = 2  # of those, the second from where the first one ended
BESIDE = 0.03  # of the log parameters: their first steps
ENOUGH = 1e-4  # relative change of the peak, and of the parameters, at which they end
RAISED = 30  # times that tau_P of the same settings is raised to what a new peak demands
PROOF_COSTS = 3e-4  # of s, at most, that a longer filter may cost
FILTER_STEP = math.sqrt(10)  # by which a filter is made longer until a proof is found,
FILTER_STEPS = 12  # so often


@dataclass(frozen=True)
class Settled:
    """Settings, what they reach, and the peaks over the whole axis, case by case."""

    candidate: Candidate
    performance: Performance
    loops: tuple[Controller, ...]
    axes: tuple[AxisPeaks, ...]
    spread: SpreadOutcome | None = None

    @property
    def peaks(self) -> Peaks:
        """Of the plant of the task itself."""
        return self.axes[0].peaks

    @property
    def deciding(self) -> int:
        """Which case has the highest peak; of those that differ by rounding the first one."""
        enough = self.highest * (1 - WORSE)
        tops = (axis.peaks.robust_performance.value for axis in self.axes)
        return next(i for i, top in enumerate(tops) if top >= enough)

    @property
    def highest(self) -> float:
        """The highest peak of all cases."""
        return max(axis.peaks.robust_performance.value for axis in self.axes)


def settled(
    specification: Specification, search: GroupingSearch, candidate: Candidate, clock: Clock | None
) -> Settled | None:
    """Return the settings near a candidate that keep the level on the whole here.

    Parameters
    ----------
    specification, search : Specification, GroupingSearch
        The task, and where the candidate comes from.
    candidate : Candidate
        Settings with their value as the search sees it.
    clock : Clock or None
        None: there is no time to search on.

    Returns
    -------
    Settled or None
        None where no tau_P serves these settings after all.

    Raises
    ------
    InvalidInputError
        tau_P is too large a number.
    OutOfTimeError
        The time limit has passed.

    """
    # Once: what a case is to one of two loops that change places, another case is to the other.
    candidate = replace(candidate, theta=search.canonical(candidate.theta))
    if clock is not None:
        found, candidate = _searched_on(specification, search, extended(search, candidate), clock)
        if found is not None:
            moved = _beside_the_edge(specification, search, found.candidate, clock)
            if moved is found.candidate:
                return found
            candidate = moved
    candidate = _stepped_back(specification, search, candidate)
    if clock is not None:
        candidate = _beside_the_edge(specification, search, candidate, clock)
    for _ in range(RAISED):
        here, worse = _judged(specification, search, candidate)
        if worse is None and _above(search, candidate, here) <= ABOVE:
            return here
        if worse is not None:
            value = worse
        else:
            worst = int(np.argmax([_excess(search, candidate, axis) for axis in here.axes]))
            top = np.array([here.axes[worst].peaks.robust_performance.omega])
            number = search.activate(worst)
            value = float(search.exact.attained(candidate.theta, top, number)[0])
        value = max(value, candidate.value)
        if not math.isfinite(value):
            return None
        candidate = replace(candidate, value=value)
    return None


def _searched_on(
    specification: Specification, search: GroupingSearch, candidate: Candidate, clock: Clock
) -> tuple[Settled | None, Candidate]:
    """Search on from each peak that the proof finds higher; None where that leads nowhere."""
    for _ in range(ROUNDS if specification.spread is None else SPREAD_ROUNDS):
        clock.tick()
        here, worse = _judged(specification, search, candidate)
        if worse is None and _above(search, candidate, here) <= ABOVE:
            return _filtered(specification, search, here) or here, candidate
        for index, axis in enumerate(here.axes):
            if _excess(search, candidate, axis) > ABOVE or index in search.active:
                search.look_at(_high_places(axis), search.activate(index))
        found = search.exact.descend(candidate.theta)
        if found is None or not search.accepts(found.theta):
            break
        candidate = found
    return None, candidate


def _stepped_back(
    specification: Specification, search: GroupingSearch, candidate: Candidate
) -> Candidate:
    """Return the candidate, for the objective mu with gains as much lower as serves it best.

    Of nearly singular plants the least mu lies beside the edge of stability, where the peak is
    narrower than any grid: the search may end on the edge itself. The peak there falls with the
    inverse distance to the edge, the one of the weak direction hardly rises.
    """
    if specification.objective is not Objective.MU:
        return candidate
    gains = np.zeros(candidate.theta.size)
    gains[:: search.objective.per_controller] = 1.0
    here = _looked_at(specification, search, candidate)
    if _above(search, candidate, here) <= FOOLED:
        return candidate
    least, start = here.highest, candidate.theta
    for share in BACK:
        theta = search.box.clip(start + math.log1p(-share) * gains)
        if not search.accepts(theta):
            continue
        top = _looked_at(specification, search, replace(candidate, theta=theta)).highest
        if top < least:
            least, candidate = top, replace(candidate, theta=theta, value=2 * math.log(top))
        elif candidate.theta is not start:
            break  # further from the edge than serves
    return candidate


def _beside_the_edge(
    specification: Specification, search: GroupingSearch, candidate: Candidate, clock: Clock
) -> Candidate:
    """Return the candidate, for the objective mu of a nearly singular plant moved to a lower peak.

    There the least mu lies in a valley whose one side is the edge of stability, with a peak too
    narrow for a search to follow: where its descents end depends on where they began. The proven
    peak itself is made less, without derivatives (Nelder and Mead 1965).
    """
    if specification.objective is not Objective.MU or not search.nearly_singular:
        return candidate
    from scipy.optimize import minimize  # noqa: PLC0415 - most tunings need not wait for it

    def highest(theta: NDArray[np.float64]) -> float:
        clock.tick()
        theta = search.box.clip(theta)
        if not search.accepts(theta):
            return math.inf
        return _looked_at(specification, search, replace(candidate, theta=theta)).highest

    theta = search.box.clip(candidate.theta)
    value = highest(theta)
    steps = BESIDE * np.diag((-1.0) ** (1 + np.arange(theta.size)))
    for _ in range(DESCENTS):
        found = minimize(
            highest, theta, method="Nelder-Mead",
            options={
                "maxfev": LOOKS * (theta.size + 1), "fatol": ENOUGH * value, "xatol": ENOUGH,
                "initial_simplex": theta + np.vstack([np.zeros(theta.size), steps]),
            },
        )  # fmt: skip
        before = value
        if found.fun < value:
            theta, value = search.box.clip(found.x), float(found.fun)
        if not value < (1 - FOOLED / 2) * before:
            break
    if not value < (1 - ENOUGH) * math.exp(candidate.value / 2):
        return candidate
    return replace(candidate, theta=theta, value=2 * math.log(value))


def _filtered(
    specification: Specification, search: GroupingSearch, here: Settled
) -> Settled | None:
    """Return the same settings with filters that end sooner, where these are proven and those not.

    A dead time turns the phase up to a filter's end, more often than a proof can follow where that
    goes to infinity. None where there is nothing to mend, or not for as little as `PROOF_COSTS`.
    """
    names = search.objective.kind.parameters
    if _proven(here) or "filter_time" not in names:
        return None
    candidate, place = here.candidate, names.index("filter_time")
    if search.region.given[place :: len(names)].any():
        return None
    high = search.region.starts.low[place :: len(names)].max()
    for _ in range(FILTER_STEPS):
        theta = candidate.theta.copy()
        theta[place :: len(names)] = np.maximum(theta[place :: len(names)], high)
        longer = search.exact.measure(theta, candidate.value)
        if longer.value > candidate.value + PROOF_COSTS:
            # What limits the loop far above its bandwidth: the other settings make up for that.
            low = search.box.low.copy()
            low[place :: len(names)] = np.maximum(low[place :: len(names)], high)
            longer = search.within(low).descend(theta) or longer
        if longer.value <= candidate.value + PROOF_COSTS and search.accepts(longer.theta):
            there, worse = _judged(specification, search, longer)
            sound = worse is None and _above(search, longer, there) <= ABOVE
            return there if sound and _proven(there) else None
        high -= math.log(FILTER_STEP)
    return None


def _proven(here: Settled) -> bool:
    return all(axis.guarantee.status is GuaranteeStatus.PROVEN for axis in here.axes)


def _judged(
    specification: Specification, search: GroupingSearch, candidate: Candidate
) -> tuple[Settled, float | None]:
    """Return the peaks of all cases, and the s of a worse plant of the spread, now one of them."""
    here = _looked_at(specification, search, candidate)
    if _above(search, candidate, here) > ABOVE:
        return here, None
    worst = search.worst_of_spread(here.candidate)
    if worst is None:
        return here, None
    case, outcome, s = worst
    if s <= candidate.value + WORSE:
        return replace(here, spread=outcome), None
    search.include(case)
    return here, s


def _looked_at(
    specification: Specification, search: GroupingSearch, candidate: Candidate
) -> Settled:
    """Return the candidate with its peaks over the whole here."""
    loops = search.loops(candidate.theta)
    performance = specification.performance
    if specification.objective is Objective.TAU_P:
        value = math.exp(candidate.value) * (1 + ROUNDING)
        if value > LARGEST:
            message = f"tau_P would be {value:.3g}: take a longer unit of time"
            raise InvalidInputError(message, "/plant")
        performance = performance.with_tau_p(value)
    axes = tuple(
        proven_peaks(
            case.plant, case.uncertainty, replace(case.performance, tau_p=performance.tau_p),
            case.loops(loops),
        )
        for case in search.cases
    )  # fmt: skip
    return Settled(candidate, performance, loops, axes)


def _above(search: GroupingSearch, candidate: Candidate, here: Settled) -> float:
    """Relative excess of the highest peak over what the candidate claims."""
    return max(_excess(search, candidate, axis) for axis in here.axes)


def _excess(search: GroupingSearch, candidate: Candidate, axis: AxisPeaks) -> float:
    goal = search.objective.goal
    claimed = goal.target if goal.skewed else math.exp(candidate.value / 2)
    return float(axis.peaks.robust_performance.value / claimed - 1)


def _high_places(here: AxisPeaks) -> NDArray[np.float64]:
    """Frequencies of the peak and of maxima nearly as high, rad per time unit."""
    mu, omega = here.curves.robust_performance, here.curves.omega
    padded = np.concatenate([[0.0], mu, [0.0]])
    top = here.peaks.robust_performance
    high = (mu >= padded[:-2]) & (mu >= padded[2:]) & (mu >= (1 - NEARLY) * top.value)
    places = np.flatnonzero(high)
    highest = places[np.argsort(-mu[places])[:MOST_PLACES]]
    return np.append(omega[highest], top.omega)
