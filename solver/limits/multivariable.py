"""The limit of a plant: least tau_P or mu over all controllers, bounded below, and built."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.limits.building import Building
from solver.limits.lower_bound import lower_bound, unlimited
from solver.limits.natural_units import in_natural_units
from solver.limits.record import Limit, LimitStatus
from solver.limits.search import LimitSearch
from solver.model.errors import InvalidInputError
from solver.model.given import require_alike, require_fit
from solver.model.one_scale import of_one_scale
from solver.model.open_loop import require_supported
from solver.model.plants import Plant
from solver.model.validation import instance

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.limits.record import Realised
    from solver.model.weights import Performance, Uncertainty

__all__ = ["MAX_LIMIT_SIZE", "multivariable_limit", "require_covered"]

FOUND_FOR = "the limit is found for"
NEAR = 1.03  # of the limit: what is built so near to it is good enough
MAX_LIMIT_SIZE = 6  # of a matrix plant: the convex program grows with its fourth power


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
    units = in_natural_units(plant, uncertainty, performance)
    search = LimitSearch(units.plant, units.uncertainty, units.performance, tick)
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
    building = Building(plant, uncertainty, performance, units, search)
    first = search.first()
    early = None if first is None else building.first_of([first])
    found = search.run(first)
    if found is None and search.ended:
        reason = "the search was ended before it found a controller"
        return Limit(LimitStatus.TIME_LIMIT, objective, None, bound, reason=reason)
    if found is None:
        reason = "no controller was found that keeps mu at 1 or below, however slow"
        return Limit(LimitStatus.INFEASIBLE, objective, None, bound, reason=reason)
    settled = not search.ended
    value = found.tau_p * units.time if search.sought else found.mu
    realised, reached = early, _reached(early, objective)
    for density in search.built_densities:
        built = building.first_of(search.buildable(found, density))
        if _reached(built, objective) < reached:
            realised, reached = built, _reached(built, objective)
        if reached <= NEAR * value or search.ended:
            break
    value = min(value, reached)  # its basis is another one, and both are local searches
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


def _reached(realised: Realised | None, objective: str) -> float:
    """Return the tau_P, or the mu, of what was built; infinite where nothing was."""
    if realised is None or realised.robustness.peaks is None:
        return math.inf
    peak = realised.robustness.peaks.robust_performance.value
    return realised.tau_p if objective == "tau_p" else peak


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
