"""A spread of a plant's parameters: the settings must serve every plant in a box around it.

The corners of the box are cases of the search from the start. What lies between them is searched on
a lattice, and from its worst points by steps along the axes; a plant found there that is worse than
those known becomes a case, and the search goes on. Between the plants looked at the box is proven
in the end (`solver.tuning.spread_proof`), where it can be.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.model.deviations import (
    Parameter,
    change_dead_time,
    change_gain,
    change_time_constant,
    coupled,
    depends_on,
    of_unit,
)
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.model.mixed_plant import MixedPlant
from solver.model.validation import flag, real, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction

__all__ = [
    "MOST_AXES",
    "SPREAD",
    "Deviation",
    "Spread",
    "SpreadOutcome",
    "SpreadProof",
    "lattice",
    "refined",
]

SPREAD = "spread"  # name of what is not a scenario of the request
PER_AXIS = {1: 41, 2: 13, 3: 7, 4: 5, 5: 3, 6: 3}  # points of the lattice: some hundreds at most
MOST_AXES = max(PER_AXIS)
REFINED = 3  # worst points of the lattice from which steps are taken
FIRST_STEP, LAST_STEP = 0.5, 0.01  # of the lattice's own

Deviation = tuple[float, ...]
INTERACTION = "interaction"
PARAMETERS = ("gain", "time_constant", "dead_time", INTERACTION)
TRIFLE = 1e-12  # relative: a dead time no longer than the known one by more than rounding
_CHANGES = {
    "gain": change_gain,
    "time_constant": change_time_constant,
    "dead_time": change_dead_time,
    INTERACTION: change_gain,
}


def _all_of(name: str, plant: Plant) -> Sequence[TransferFunction]:
    """Return the elements that a deviation of all units together changes."""
    if name != INTERACTION:
        return plant.elements
    size = range(min(plant.n, 2) if plant.interchangeable else plant.n)
    return [plant.element(row, column) for row, column in itertools.permutations(size, 2)]


@dataclass(frozen=True)
class Spread:
    """Relative deviations, up and down, of parameters of the plant.

    Parameters
    ----------
    gain, time_constant, dead_time : float
        Of all elements of the plant, 0 <= value < 1.
    interaction : float
        Of the effect of each unit on the others, 0 <= value < 1.
    each_unit : bool
        Whether each unit deviates by itself, all that its input acts on; else all together.
    known_delay : float
        Part of every dead time that does not spread: that of the controllers' scan, time units.

    """

    gain: float = 0.0
    time_constant: float = 0.0
    dead_time: float = 0.0
    interaction: float = 0.0
    each_unit: bool = False
    known_delay: float = 0.0

    def __post_init__(self) -> None:
        for name in PARAMETERS:
            value = real(getattr(self, name), f"/{name}")
            if not 0 <= value < 1:
                message = "a relative deviation lies in 0..1, 1 excluded"
                raise InvalidInputError(message, f"/{name}")
            settle(self, **{name: value})
        settle(self, each_unit=flag(self.each_unit, "/each_unit"))

    def axes(self, plant: Plant) -> tuple[Parameter, ...]:
        """Return the parameters that spread and that the plant has, with their deviations."""
        if isinstance(plant, MixedPlant):
            return self.axes(plant.plant)
        if isinstance(plant, MeasuredPlant):
            return self._axes_of_data(plant)
        found: list[Parameter] = []
        for name in PARAMETERS:
            width = getattr(self, name)
            if not width > 0:
                continue
            if not self.each_unit or plant.n == 1:
                if self._there(name, _all_of(name, plant)):
                    found.append(Parameter(name, width, None))
                continue
            rows = plant.rows
            found += [
                Parameter(name, width, unit)
                for unit in range(plant.n)
                if self._there(
                    name,
                    [row[unit] for r, row in enumerate(rows) if name != INTERACTION or r != unit],
                )
            ]
        return tuple(found)

    def _axes_of_data(self, plant: MeasuredPlant) -> tuple[Parameter, ...]:
        """Return what spreads of measured responses: their sizes.

        Raises
        ------
        UnsupportedPlantError
            Times spread, which the data do not hold.

        """
        for name in ("time_constant", "dead_time"):
            if getattr(self, name) > 0:
                message = (
                    "of a plant given as frequency response gain and interaction spread: its "
                    f"{name.replace('_', ' ')}s are not known apart"
                )
                raise UnsupportedPlantError(message, f"/spread/{name}")
        units: Sequence[int | None] = [None]
        if self.each_unit and plant.n > 1:
            units = range(plant.n)
        return tuple(
            Parameter(name, width, unit)
            for name, width in (("gain", self.gain), (INTERACTION, self.interaction))
            for unit in units
            if width > 0 and plant.values[:, self._elements(plant.n, name, unit)].any()
        )

    @staticmethod
    def _elements(n: int, name: str, unit: int | None) -> NDArray[np.bool_]:
        """Return which elements (n, n) a parameter of a unit, or of all, changes."""
        those = np.ones((n, n), dtype=bool)
        if unit is not None:
            those[:, np.arange(n) != unit] = False
        if name == INTERACTION:
            those &= ~np.eye(n, dtype=bool)
        return those

    def absent(self, plants: Sequence[Plant]) -> tuple[str, ...]:
        """Return the parameters that were to spread, but that none of the plants has."""
        there = {axis.name for plant in plants for axis in self.axes(plant)}
        return tuple(n for n in PARAMETERS if getattr(self, n) > 0 and n not in there)

    def _there(self, name: str, elements: Sequence[TransferFunction]) -> bool:
        """Whether any of these elements has the parameter."""
        if name == INTERACTION:
            return any(not element.is_zero for element in elements)
        late = self.known_delay * (1 + TRIFLE)
        return any(
            depends_on(name, element) and (name != "dead_time" or element.dead_time > late)
            for element in elements
        )

    def plant_at(self, plant: Plant, deviation: Deviation) -> Plant:
        """Return the plant whose parameters deviate by the shares -1..1 of their widths."""
        if isinstance(plant, MixedPlant):
            return replace(plant, plant=self.plant_at(plant.plant, deviation))
        for (name, width, unit), share in zip(self.axes(plant), deviation, strict=True):
            factor = 1 + width * share
            if factor == 1:
                continue
            if isinstance(plant, MeasuredPlant):
                plant = plant.scaled(np.where(self._elements(plant.n, name, unit), factor, 1.0))
                continue
            if name == INTERACTION and unit is None:
                plant = coupled(plant, factor)
                continue
            change = partial(_CHANGES[name], factor=factor)
            if name == "dead_time":
                change = partial(change_dead_time, factor=factor, known=self.known_delay)
            if unit is None:
                plant = plant.mapped(change)
            else:
                plant = of_unit(plant, unit, change, own=name != INTERACTION)
        return plant

    def corners(self, plant: Plant) -> Iterator[Deviation]:
        """Yield the corners of the box."""
        axes = self.axes(plant)
        if axes:
            yield from itertools.product((-1.0, 1.0), repeat=len(axes))


@dataclass(frozen=True)
class SpreadProof:
    """What is proven of all plants of the spread, at all frequencies.

    Attributes
    ----------
    level : float
        Of mu of robust performance, which none exceeds where nothing is open.
    boxes : int
        Boxes of plants and frequencies that were looked at.
    open : int
        Boxes that were left without a proof; they lie within `omega` and `deviations`.
    omega : tuple of float, or None
        Frequencies, rad per time unit; the upper one None: infinite.
    deviations : tuple of (str, (float, float))
        Relative deviations of each parameter there.
    reason : str or None
        Why not all is proven.

    """

    level: float
    boxes: int
    open: int
    omega: tuple[float, float | None] | None
    deviations: tuple[tuple[str, tuple[float, float]], ...]
    reason: str | None

    @property
    def proven(self) -> bool:
        """Whether the level holds for every plant."""
        return self.reason is None


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
    proof : SpreadProof or None
        What is proven of the plants between those.

    """

    plants: int
    worst: tuple[tuple[str, float], ...]
    tau_p: float | None
    proof: SpreadProof | None = None


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
