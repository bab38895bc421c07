"""The limit of a plant: least tau_P or mu over all controllers, bounded below, and built."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.lower_bound import lower_bound, unlimited
from solver.limits.realisation import reducible
from solver.limits.record import Limit, LimitStatus, Realised
from solver.limits.search import (
    BETWEEN,
    SLOWEST_TRIED,
    LimitSearch,
    checking_grid,
    least_tau_p,
)
from solver.model.errors import InvalidInputError
from solver.model.given import require_alike, require_fit
from solver.model.mode_controller import ModeController
from solver.model.one_scale import of_one_scale
from solver.model.open_loop import require_supported
from solver.model.peaks import Peak
from solver.model.plants import Plant
from solver.model.validation import instance
from solver.robustness.centralised import analyse_centralised, centralised_poles
from solver.robustness.centralised_curves import CentralisedAnalysis

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.limits.realisation import Reducible
    from solver.limits.search import Found
    from solver.model.state_space import StateSpace
    from solver.model.weights import Performance, Uncertainty

__all__ = ["MAX_LIMIT_SIZE", "multivariable_limit", "require_covered"]

FOUND_FOR = "the limit is found for"
MAX_LIMIT_SIZE = 6  # of a matrix plant: the convex program grows with its fourth power
BUILT_MU = (1.01, 1.05)  # of the least mu of its basis: what a reduction of the order may cost
ROOM = 1e-6  # relative addition to tau_P for peaks between the points of the dense grid
ATTEMPTS = 4
FEW_STATES = 4  # to begin with,
GROWTH = 1.4  # and so many times more until they are enough; then bisected


def multivariable_limit(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    *,
    tick: Callable[[], None] = lambda: None,
) -> Limit:
    """Return what any controller could do on this plant under these weights.

    Parameters
    ----------
    plant : Plant
        Stable or integrating; a matrix plant has at most `MAX_LIMIT_SIZE` units. A parallel plant
        is taken with a parallel controller, for any number of units.
    uncertainty, performance : Uncertainty, Performance
        The weights; without a `tau_p` the least one is sought, with one the least mu.
    tick : callable
        Called before and within each convex step. `EnoughError` ends the search with the best so
        far; what else it raises passes through.

    Raises
    ------
    InvalidInputError
        A singular static gain, a matrix plant that is too large; parallel units whose
        permitted errors differ are one.
    UnsupportedPlantError
        An unstable plant, or integrators that do not belong to inputs.

    """
    require_covered(plant, uncertainty, performance)
    scaled = of_one_scale(plant, performance, MAX_LIMIT_SIZE, FOUND_FOR)
    plant, performance = scaled.plant, scaled.performance
    objective = "tau_p" if performance.tau_p is None else "mu"
    search = LimitSearch(plant, uncertainty, performance, tick)
    bound = lower_bound(plant, uncertainty, performance)
    if math.isinf(bound.value):
        reason = "no controller keeps mu at 1 or below: |w_I| exceeds 1 at zero frequency"
        return Limit(LimitStatus.INFEASIBLE, objective, None, bound, reason=reason)
    if unlimited(plant, uncertainty):
        reason = (
            "nothing in the model ends the bandwidth: |w_I| stays below 1, and there is neither "
            "dead time nor a zero in the right half plane"
        )
        return Limit(LimitStatus.UNLIMITED, objective, None, bound, reason=reason)
    found = search.run()
    if found is None and search.ended:
        reason = "the search was ended before it found a controller"
        return Limit(LimitStatus.TIME_LIMIT, objective, None, bound, reason=reason)
    if found is None:
        reason = "no controller was found that keeps mu at 1 or below, however slow"
        return Limit(LimitStatus.INFEASIBLE, objective, None, bound, reason=reason)
    settled = not search.ended
    realised = _realised(search, found)
    value = found.tau_p if search.sought else found.mu
    if realised is not None and realised.robustness.peaks is not None:
        # Its basis is another one, and both are local searches.
        peak = realised.robustness.peaks.robust_performance.value
        value = min(value, realised.tau_p if search.sought else peak)
    if realised is not None:
        realised = replace(realised, controller=scaled.given_back(realised.controller))
    return Limit(
        LimitStatus.TIME_LIMIT if search.ended else LimitStatus.FOUND,
        objective,
        value,
        bound,
        realised,
        warnings=_warnings(realised, settled=settled, ended=search.ended),
    )


def _warnings(realised: Realised | None, *, settled: bool, ended: bool) -> tuple[str, ...]:
    """Return what to look at twice; `settled`: whether the limit was found before the end."""
    found = []
    if not settled:
        found.append("the search for the limit was ended early: it may be lower")
    elif ended:
        found.append(
            "the search was ended before a controller was built"
            if realised is None
            else "the search for the controller built was ended early: another may reach more"
        )
    elif realised is None:
        found.append("no controller of limited order was found near the limit")
    if realised is not None and realised.unstable_poles:
        found.append(
            "the controller built is unstable by itself (poles in the right half plane: "
            f"{realised.unstable_poles}): it runs away in manual, or where a valve is at its limit"
        )
    return tuple(found)


def require_covered(plant: Plant, uncertainty: Uncertainty, performance: Performance) -> None:
    """Raise what `multivariable_limit` would raise, but for a singular plant."""
    instance(plant, Plant, "/plant")
    require_fit(plant, uncertainty, performance)
    require_supported(plant)
    if not plant.interchangeable and plant.n > MAX_LIMIT_SIZE:
        message = f"the limit is found for matrix plants up to {MAX_LIMIT_SIZE} units"
        raise InvalidInputError(message, "/plant")
    require_alike(uncertainty, FOUND_FOR)
    of_one_scale(plant, performance, MAX_LIMIT_SIZE, FOUND_FOR)


def _realised(search: LimitSearch, best: Found) -> Realised | None:
    """Return the controller of least order that keeps what the search found."""
    for found in search.buildable(best):
        parts = reducible(search, found)
        for cost in (None,) if search.sought else BUILT_MU:
            realised = _built(search, found, parts, None if cost is None else cost * found.mu)
            if realised is not None:
                return realised
    return None


def _built(
    search: LimitSearch, found: Found, parts: list[Reducible], most: float | None
) -> Realised | None:
    """Return a controller with mu at most `most`, or, where tau_P is sought, with its tau_P."""
    omega = checking_grid(found.omega)
    for _ in range(ATTEMPTS):
        chosen = _reduced(search, found, parts, most or 1.0, omega)
        outcome = None if chosen is None else _analysed(search, found, chosen)
        if outcome is None:
            return None
        if isinstance(outcome, Peak):
            peak = outcome
        else:
            assert outcome.robustness.peaks is not None  # noqa: S101 - it is stable
            peak = outcome.robustness.peaks.robust_performance
            if most is None or peak.value <= most * (1 + BETWEEN):
                return outcome
        # A controller of few states may have a peak where that of all states has none.
        omega = np.union1d(omega, [peak.omega])
    return None


def _reduced(
    search: LimitSearch,
    found: Found,
    parts: list[Reducible],
    allowed: float,
    omega: NDArray[np.float64],
) -> tuple[StateSpace, ...] | None:
    """Return the controllers of least order with mu at most `allowed` at `omega` (k,).

    More states are better but for details, so the order is bisected, and what is returned checked.
    """
    performance = search.performance.with_tau_p(found.tau_p)
    thresholds = np.sort(np.concatenate([part.weights for part in parts]))[::-1]

    def kept(number: int) -> tuple[StateSpace, ...] | None:
        controllers = tuple(part.truncated(thresholds[number]) for part in parts)
        analysis = CentralisedAnalysis(search.blocks, controllers, search.uncertainty, performance)
        if (
            analysis.robust_performance(omega).max() <= allowed
            and centralised_poles(search.blocks, controllers) == 0
        ):
            return controllers
        return None

    few, many, last = -1, FEW_STATES - 1, len(thresholds) - 1
    best = kept(min(many, last))
    while best is None and many < last and not search.enough():
        few, many = many, min(math.ceil(GROWTH * many), last)
        best = kept(many)
    while best is not None and many - few > 1 and not search.enough():
        middle = (few + many) // 2
        trial = kept(middle)
        if trial is None:
            few = middle
        else:
            many, best = middle, trial
    return best


def _analysed(
    search: LimitSearch, found: Found, controllers: tuple[StateSpace, ...]
) -> Realised | Peak | None:
    """Return the controller and the tau_P it reaches.

    A peak above 1 that no larger tau_P lowers is returned in its place. None: it is unstable.
    """
    controller: StateSpace | ModeController = controllers[0]
    if search.plant.interchangeable:
        controller = ModeController(controllers[0], controllers[-1])
    tau_p = found.tau_p
    if search.sought:
        least = _least_tau_p(search, controllers, tau_p)
        if isinstance(least, Peak):
            return least
        tau_p = least
    before, proof = math.inf, not search.sought
    for _ in range(2 * ATTEMPTS):
        performance = search.performance.with_tau_p(tau_p)
        robustness = analyse_centralised(
            search.plant, search.uncertainty, performance, controller, proof=proof
        )
        if robustness.peaks is None:
            return None
        peak = robustness.peaks.robust_performance
        excess = peak.value - 1
        if not search.sought or excess <= 0:
            if proof:
                states = sum(each.states for each in controllers)
                return Realised(controller, states, tau_p, robustness)
            proof = True  # which may show a higher peak: only what else is right is worth it
            continue
        if excess > before / 2:
            break
        before = excess
        tau_p *= 1 + ROOM + 4 * excess  # |w_P| falls no faster than 1/tau_P
    return peak


def _least_tau_p(
    search: LimitSearch, controllers: tuple[StateSpace, ...], start: float
) -> float | Peak:
    """Least tau_P that the controllers reach on a dense grid; a peak that none lowers to 1."""

    def curve(tau_p: float, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        performance = search.performance.with_tau_p(tau_p)
        here = CentralisedAnalysis(search.blocks, controllers, search.uncertainty, performance)
        return here.robust_performance(omega)

    performance = search.performance.with_tau_p(start)
    dense = CentralisedAnalysis(search.blocks, controllers, search.uncertainty, performance).omega
    left = dense

    def peak(tau_p: float) -> float:
        nonlocal left
        values = curve(tau_p, left)
        if (values > 1).any():
            # mu falls with tau_P at every frequency: what is met here is met from here on.
            left = left[values > 1]
        return float(values.max())

    tau_p = least_tau_p(peak, start)
    if math.isfinite(tau_p):
        return tau_p
    values = curve(SLOWEST_TRIED / search.bandwidth, dense)
    return Peak(float(values.max()), float(dense[values.argmax()]))
