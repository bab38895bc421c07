"""Plants beside a given one: a parameter of its elements times a factor."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.neighbours import NeighbourPlant
from solver.model.plants import MatrixPlant, ParallelPlant, Plant
from solver.model.transfer_function import LARGEST, TransferFunction

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = [
    "Parameter",
    "change_dead_time",
    "change_gain",
    "change_time_constant",
    "coupled",
    "depends_on",
    "of_unit",
    "varied",
]


class Parameter(NamedTuple):
    """A parameter that spreads: its name, relative deviation, and unit; None: of all units."""

    name: str
    width: float
    unit: int | None

    @property
    def title(self) -> str:
        """What it is called in a result."""
        return self.name if self.unit is None else f"{self.name} of unit {self.unit + 1}"


def coupled(plant: Plant, factor: float) -> Plant:
    """Return the plant with the effect of each unit on the others times `factor`."""
    if isinstance(plant, ParallelPlant):
        return ParallelPlant(plant.n, plant.process, change_gain(plant.interaction, factor))
    if isinstance(plant, NeighbourPlant):
        other = plant.mapped(partial(change_gain, factor=factor))
        return replace(other, process=plant.process)
    rows = [
        [element if r == c else change_gain(element, factor) for c, element in enumerate(row)]
        for r, row in enumerate(plant.rows)
    ]
    return MatrixPlant(rows)


def depends_on(name: str, element: TransferFunction) -> bool:
    """Whether an element has the parameter `name`: gain, time_constant or dead_time."""
    if element.is_zero:
        return False
    if name == "time_constant":
        return len(element.den) > 1
    return name == "gain" or element.dead_time > 0


def change_gain(element: TransferFunction, factor: float) -> TransferFunction:
    """Return the element with its gain times `factor`."""
    if factor == 0 or element.is_zero:
        return TransferFunction((0.0,), (1.0,))
    return _within([c * factor for c in element.num], list(element.den), element.dead_time)


def change_time_constant(element: TransferFunction, factor: float) -> TransferFunction:
    """Return the element with factor s for s in its rational part."""
    num = [c * factor**power for power, c in enumerate(reversed(element.num))][::-1]
    den = [c * factor**power for power, c in enumerate(reversed(element.den))][::-1]
    return _within(num, den, element.dead_time)


def change_dead_time(
    element: TransferFunction, factor: float, known: float = 0.0
) -> TransferFunction:
    """Return the element with its dead time, but for the `known` part of it, times `factor`."""
    if not element.dead_time > known:
        return element
    late = known + (element.dead_time - known) * factor
    return TransferFunction(element.num, element.den, min(late, LARGEST))


def varied(
    name: str, element: TransferFunction, factor: float, s: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the values at `s` (k,), all on the imaginary axis, of an element so changed.

    Of the parameter `name`: gain, time_constant or dead_time. No plant is made for it, so this
    costs a tenth of what the values of a changed element do.
    """
    if name == "gain":
        return np.asarray(factor * element(s))
    if name == "time_constant":  # s times factor in the rational part alone
        return np.asarray(element(factor * s) * np.exp((factor - 1) * element.dead_time * s))
    return np.asarray(element(s) * np.exp((1 - factor) * element.dead_time * s))


def of_unit(
    plant: Plant, unit: int, change: Callable[[TransferFunction], TransferFunction], *, own: bool
) -> Plant:
    """Return the plant with what the input of one unit acts on changed, its `own` output or not."""
    return MatrixPlant(
        [
            [
                change(element) if column == unit and (own or row != unit) else element
                for column, element in enumerate(elements)
            ]
            for row, elements in enumerate(plant.rows)
        ]
    )


def _within(num: list[float], den: list[float], dead_time: float) -> TransferFunction:
    """Return num/den, both divided where a coefficient would be too large."""
    largest = max(abs(c) for c in num + den)
    # A power of two divides without rounding: nothing is above the limit by its last digit.
    size = 2.0 ** max(0, math.ceil(math.log2(largest / LARGEST)))
    return TransferFunction([c / size for c in num], [c / size for c in den], dead_time)
