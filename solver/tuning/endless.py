"""Settings at the end of their box: extended where the user set no bound, and told where endless.

Some optima lie at infinity: with a demand on the outputs alone an integrating process needs no
integral action, so that tau_I goes to infinity; a filter or derivative that only harms goes to
zero. What is said then is where the setting goes and what it means.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model.loop_names import loops_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.tuning.exact import Candidate
    from solver.tuning.search import GroupingSearch

__all__ = ["extended", "remarks"]

NEAR_BOUND = 1e-6  # of the box's width, at which a parameter is on its bound
EXTENSION = 1e3  # factor by which a bound that the user did not give moves outwards
EXTENSIONS = 3
NOTICEABLE = 1e-4  # relative gain for which a bound is moved once more
ENDLESS = 1e-5  # change of s up to the bound from which a setting makes no difference
MEANING = {
    ("gain", "upper"): "nothing in plant and uncertainty limits it",
    ("gain", "lower"): "the slower the better: is there a demand on the loops at all?",
    ("integral_time", "upper"): "the demand needs no integral action; ask for load disturbances",
    ("integral_time", "lower"): "integral action alone does as well",
    ("derivative_time", "upper"): "the loop wants more than one integration",
    ("derivative_time", "lower"): "the demand needs no derivative action",
    ("filter_time", "upper"): "the loop wants more than one integration",
    ("filter_time", "lower"): "the demand needs no filter",
}


def extended(search: GroupingSearch, candidate: Candidate) -> Candidate:
    """Return the candidate, or a better one beyond bounds that only the box had set."""
    for _ in range(EXTENSIONS):
        edges = [
            index for index, edge, given in _edges(search, candidate.theta) if edge and not given
        ]
        if not edges:
            break
        beyond = candidate.theta.copy()
        for index in edges:
            beyond[index] = search.widen(candidate.theta, index, EXTENSION)
        # Out there the value changes so little with the setting that a descent which begins at the
        # old bound may end there.
        for theta in (search.box.clip(beyond), candidate.theta):
            found = search.exact.descend(theta)
            if found is not None and found.value < candidate.value - NOTICEABLE:
                candidate = found
                break
        else:
            break
    return candidate


def remarks(search: GroupingSearch, theta: NDArray[np.float64]) -> list[str]:
    """Say which settings are on a bound that the user gave, and which go to infinity or zero."""
    names, starts = search.objective.kind.parameters, search.region.starts
    found = []
    for index, edge, given in _edges(search, theta):
        group, name = divmod(index, len(names))
        setting = f"{loops_text(search.groups[group])}: the {names[name].replace('_', ' ')}"
        bounds = search.box.low, search.box.high
        if edge and given:
            value = math.exp(bounds[edge == "upper"][index])
            found.append(
                f"{setting} is on its {edge} bound {value:.4g}; a wider bound may do better"
            )
            continue
        direction = edge or _endless(search, theta, index)
        # Where nothing limits the crossover the loops end where the search's frequencies do.
        if names[name] == "gain" and search.region.fastest and theta[index] > starts.high[index]:
            direction = "upper"
        if direction:
            where = "infinity" if direction == "upper" else "0"
            meaning = MEANING[names[name], direction]
            found.append(f"{setting} goes to {where}: {meaning}")
    return found


def _edges(
    search: GroupingSearch, theta: NDArray[np.float64]
) -> list[tuple[int, str | None, bool]]:
    """Index, edge ('lower', 'upper' or None), whether the user gave it, of each parameter."""
    low, high = search.box.low, search.box.high
    found: list[tuple[int, str | None, bool]] = []
    for index, value in enumerate(theta):
        near = NEAR_BOUND * (high[index] - low[index])
        edge = None
        if value - low[index] < near:
            edge = "lower"
        elif high[index] - value < near:
            edge = "upper"
        found.append((index, edge, bool(search.region.given[index, int(edge == "upper")])))
    return found


def _endless(search: GroupingSearch, theta: NDArray[np.float64], index: int) -> str | None:
    """Where a setting outside the region of the starts makes no difference any more."""
    starts = search.region.starts
    if starts.low[index] <= theta[index] <= starts.high[index]:
        return None
    edge = "lower" if theta[index] < starts.low[index] else "upper"
    farthest = theta.copy()
    farthest[index] = (search.box.low if edge == "lower" else search.box.high)[index]
    here = search.exact.measure(theta, search.objective.evaluate(theta).s).value
    there = search.exact.measure(farthest, here).value
    return edge if there <= here + ENDLESS else None
