"""Where settings are sought: the box of the parameters, the part of it that starts are drawn from.

Both follow the loop and not the units: times are measured by the crossover that uncertainty, dead
time or the plant's own phase permits and by the slowest corner, gains by what the plant's response
is there. Optima lie in the region of the starts as a rule; the box is far wider, so that what ends
on it has no optimum at any finite setting, and is told as such (`solver.tuning.limits`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import reduce
from solver.model.controllers import DERIVATIVE_FILTER, Controller
from solver.model.frequencies import corners, finite_reach
from solver.model.transfer_function import LARGEST
from solver.tuning.minimax import Box

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.tuning.groupings import Groups
    from solver.tuning.specification import Specification

__all__ = ["Region", "gain_signs", "search_region"]

BEYOND = 1e3  # how much wider the box is than the region of the starts, at either end
PER_DECADE = 40  # frequencies at which a crossover is sought
LEAD = math.pi / 2  # phase that a derivative can add


@dataclass(frozen=True)
class Region:
    """Where settings of one grouping are sought, in the logarithms of their magnitudes.

    Attributes
    ----------
    box : Box
        What no settings leave.
    starts : Box
        What starts are drawn from.
    crossover : float
        The highest that is permitted, rad per time unit.
    given : (m, 2) bool
        Which of the box's lower and upper bounds the user gave.
    fastest : float
        Where the search must see the loops end: the highest crossover that the box permits where
        neither uncertainty nor dead time nor phase limits it, rad per time unit; else 0.

    """

    box: Box
    starts: Box
    crossover: float
    given: NDArray[np.bool_]
    fastest: float


def gain_signs(plant: Plant, groups: Groups) -> tuple[float, ...]:
    """Sign of each group's gain: that of its first unit's own steady-state gain, (groups,)."""
    gains = [plant.entry(group[0], group[0]).static_gain for group in groups]
    return tuple(-1.0 if gain < 0 else 1.0 for gain in gains)


def search_region(specification: Specification, groups: Groups) -> Region:
    """Return the box of the parameters and where starts are drawn, controller by controller.

    The crossover is the lowest frequency where |w_I| of the loop reaches 1, a dead time turns the
    phase by a radian, or the process's own phase lag leaves nothing that a controller could make up
    for. Gains start from a tenth of what crosses over with the plant's strongest direction
    anywhere, up to thirty times what makes a single loop cross over there; times from a hundredth
    of that period to ten times the slowest one.
    """
    plant, kind = specification.plant, specification.kind
    bends = corners(plant, specification.uncertainty)
    omega = np.geomspace(
        1e-2 * bends[0], 1e2 * bends[-1],
        math.ceil(PER_DECADE * math.log10(1e4 * bends[-1] / bends[0])),
    )  # fmt: skip
    weight_of = specification.uncertainty.weight_of
    own_permitted = {
        group[0]: max(
            _permitted_crossover(plant, weight, omega) for weight in set(map(weight_of, group))
        )
        for group in groups
    }
    permitted = max(own_permitted.values())
    slowest = min(float(bends[0]), permitted)
    within = omega[(omega >= slowest) & (omega <= permitted)]
    strongest = max(
        float(np.linalg.norm(G, 2, axis=(1, 2)).max())
        for G in reduce(plant, groups).response(within if within.size else permitted)
    )
    low, high, start_low, start_high, given = [], [], [], [], []
    fastest = 0.0
    for group in groups:
        own_crossover, own_gain = _own_crossover(
            specification, group[0], omega, own_permitted[group[0]]
        )
        shortest, longest = 0.01 / own_crossover, 10 / min(slowest, own_crossover)
        for name in kind.parameters:
            usual = (shortest, longest)
            if name == "gain":
                usual = (0.1 / max(strongest, own_gain), 30 / own_gain)
            elif name == "filter_time":
                usual = (0.1 * shortest, longest)
            bounds = getattr(specification.bounds, name)
            # A filter or derivative that short is none: what it changes is lost in rounding.
            below = BEYOND**2 if name in ("derivative_time", "filter_time") else BEYOND
            outer = bounds or (usual[0] / below, min(usual[1] * BEYOND, LARGEST))
            inner = (max(usual[0], outer[0]), min(usual[1], outer[1]))
            if not inner[0] < inner[1]:  # the user wants it elsewhere
                inner = outer
            low.append(outer[0])
            high.append(outer[1])
            start_low.append(inner[0])
            start_high.append(inner[1])
            given.append((bounds is not None, bounds is not None))
        if own_crossover >= omega[-1] / 10:  # nothing limits it
            lead = 1 / DERIVATIVE_FILTER if "derivative_time" in kind.parameters else 1.0
            loop = Controller(lead * high[-len(kind.parameters)], None)
            fastest = max(fastest, *finite_reach(plant, [loop]), 0.0)
    return Region(
        Box(_log_inside(np.array(low), 1), _log_inside(np.array(high), -1)),
        Box(_log_inside(np.array(start_low), 1), _log_inside(np.array(start_high), -1)),
        permitted,
        np.array(given),
        fastest,
    )


def _permitted_crossover(
    plant: Plant, weight: TransferFunction, omega: NDArray[np.float64]
) -> float:
    """Return the lowest frequency where a weight |w_I| reaches 1 or a dead time turns a radian."""
    too_uncertain = np.abs(weight.response(omega)) >= 1
    permitted = float(omega[too_uncertain][0]) if too_uncertain.any() else float(omega[-1]) / 10
    # What comes late from other units keeps no loop from being fast.
    delay = max(plant.entry(units[0], units[0]).dead_time for units in plant.kinds)
    return min(permitted, 1 / delay) if delay > 0 else permitted


def _own_crossover(
    specification: Specification, unit: int, omega: NDArray[np.float64], permitted: float
) -> tuple[float, float]:
    """Return where a unit's own loop can cross over at most, and its process's gain there."""
    process = specification.plant.entry(unit, unit)
    response = process.response(omega)
    size = np.abs(response)
    if not (np.isfinite(size).all() and size.max() > 0):
        return permitted, 1.0
    phase = np.unwrap(np.angle(response * (-1 if process.static_gain < 0 else 1)))
    room = math.pi + (LEAD if "derivative_time" in specification.kind.parameters else 0.0)
    turned = omega[phase < -room]
    crossover = min(permitted, float(turned[0])) if turned.size else permitted
    gain = float(np.abs(process.response(crossover))[0])
    # A zero on the axis at that very place would stand for any gain at all.
    return crossover, max(gain, 1e-6 * float(size[omega <= crossover].max(initial=size[0])))


def _log_inside(bound: NDArray[np.float64], inward: int) -> NDArray[np.float64]:
    """Logarithms whose exponentials do not pass the bound by rounding."""
    log = np.log(bound)
    while True:
        outside = inward * (bound - np.exp(log)) > 0
        if not outside.any():
            return log
        log = np.where(outside, np.nextafter(log, inward * np.inf), log)
