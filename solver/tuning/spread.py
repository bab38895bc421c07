"""A spread of a plant's parameters: the settings must serve every plant in a box around it.

The corners of the box are cases of the search from the start. What lies between them is searched on
a lattice, and from its worst points by steps along the axes; a plant found there that is worse than
those known becomes a case, and the search goes on. Between the plants looked at nothing is proven.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.model.deviations import (
    change_dead_time,
    change_gain,
    change_time_constant,
    coupled,
    depends_on,
)
from solver.model.errors import InvalidInputError
from solver.model.validation import real, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from solver.model.plants import Plant

__all__ = ["SPREAD", "Deviation", "Spread", "SpreadOutcome", "lattice", "refined"]

SPREAD = "spread"  # name of what is not a scenario of the request
PER_AXIS = {1: 41, 2: 13, 3: 7, 4: 5}  # points of the lattice: a few hundred at most
REFINED = 3  # worst points of the lattice from which steps are taken
FIRST_STEP, LAST_STEP = 0.5, 0.01  # of the lattice's own

Deviation = tuple[float, ...]
_CHANGES = {
    "gain": change_gain,
    "time_constant": change_time_constant,
    "dead_time": change_dead_time,
}


@dataclass(frozen=True)
class Spread:
    """Relative deviations, up and down, of parameters of the plant, all elements together.

    Parameters
    ----------
    gain, time_constant, dead_time : float
        Of all elements of the plant, 0 <= value < 1.
    interaction : float
        Of the effect of each unit on the others, 0 <= value < 1.

    """

    gain: float = 0.0
    time_constant: float = 0.0
    dead_time: float = 0.0
    interaction: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = real(getattr(self, each.name), f"/{each.name}")
            if not 0 <= value < 1:
                message = "a relative deviation lies in 0..1, 1 excluded"
                raise InvalidInputError(message, f"/{each.name}")
            settle(self, **{each.name: value})

    def axes(self, plant: Plant) -> tuple[tuple[str, float], ...]:
        """Return the parameters that spread and that the plant has, with their deviations."""
        found = []
        for each in fields(self):
            width = getattr(self, each.name)
            if each.name == "interaction":
                there = any(
                    not plant.element(row, column).is_zero
                    for row, column in itertools.permutations(range(min(plant.n, 2)), 2)
                ) if plant.interchangeable else plant.n > 1  # fmt: skip
            else:
                there = any(depends_on(each.name, element) for element in plant.elements)
            if width > 0 and there:
                found.append((each.name, width))
        return tuple(found)

    def plant_at(self, plant: Plant, deviation: Deviation) -> Plant:
        """Return the plant whose parameters deviate by the shares -1..1 of their widths."""
        for (name, width), share in zip(self.axes(plant), deviation, strict=True):
            factor = 1 + width * share
            if factor == 1:
                continue
            if name == "interaction":
                plant = coupled(plant, factor)
            else:
                plant = plant.mapped(partial(_CHANGES[name], factor=factor))
        return plant

    def corners(self, plant: Plant) -> Iterator[Deviation]:
        """Yield the corners of the box."""
        axes = self.axes(plant)
        if axes:
            yield from itertools.product((-1.0, 1.0), repeat=len(axes))


@dataclass(frozen=True)
class SpreadOutcome:
    """What the settings make of the spread.

    Attributes
    ----------
    plants : int
        Plants of the box that were looked at last.
    worst : tuple of (str, float)
        Relative deviation of each parameter in the worst of them.
    tau_p : float or None
        Least time constant that the settings permit there; None where it was given.

    """

    plants: int
    worst: tuple[tuple[str, float], ...]
    tau_p: float | None


def lattice(size: int) -> list[Deviation]:
    """Return the points of the lattice of a box with `size` axes, the middle among them."""
    return list(itertools.product(np.linspace(-1, 1, PER_AXIS[size]).tolist(), repeat=size))


def refined(
    value: Callable[[Deviation], float], points: list[Deviation], values: list[float]
) -> tuple[Deviation, float, int]:
    """Return the worst deviation found from the worst points, its value, and how many were tried.

    Steps along the axes, halved where none leads upwards.
    """
    best, greatest, tried = points[0], -np.inf, 0
    order = np.argsort(-np.asarray(values))[:REFINED]
    own = 2 / (PER_AXIS[len(points[0])] - 1)
    for start in order.tolist():
        here, height, step = points[start], values[start], FIRST_STEP * own
        while step >= LAST_STEP * own:
            moved = False
            for axis, sign in itertools.product(range(len(here)), (-1, 1)):
                there = list(here)
                there[axis] = min(max(there[axis] + sign * step, -1.0), 1.0)
                if there[axis] == here[axis]:
                    continue
                tried += 1
                new = value(tuple(there))
                if new > height:
                    here, height, moved = tuple(there), new, True
            if not moved:
                step /= 2
        if height > greatest:
            best, greatest = here, height
    return best, float(greatest), tried
