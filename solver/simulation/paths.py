"""The plant as the simulation sees it: paths from inputs to outputs, equal units taken together.

Units of a parallel plant that have equal loops and equal disturbances move alike, so one of
them stands for all. With m_a units like a, its output is::

    y_a = g u_a + (m_a - 1) i u_a + sum over the others b of m_b i u_b

This is the group-mean block of the symmetry reduction, and the scalar modes g - i as well: they
are what distinguishes one kind of unit from another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction

__all__ = ["MAX_KINDS", "Paths", "alike"]

MAX_KINDS = 20  # each costs states in every matrix exponential


@dataclass(frozen=True)
class Paths:
    """A plant reduced to one unit of each kind.

    Parameters
    ----------
    plant : Plant
        The plant.
    units : tuple of tuple of int
        The units of each kind; the first stands for the others. For a matrix plant every unit
        is a kind of its own.
    resting : frozenset of int
        Kinds whose inputs never move: nothing is wired to them.

    """

    plant: Plant
    units: tuple[tuple[int, ...], ...]
    resting: frozenset[int] = frozenset()

    @property
    def size(self) -> int:
        """Number of kinds of units."""
        return len(self.units)

    def between(self, row: int, column: int) -> list[tuple[TransferFunction, float]]:
        """Return the transfer functions from kind `column` to kind `row`, with their weights."""
        if column in self.resting:
            return []
        unit, *others = self.units[column]
        if row != column:
            return [(self.plant.element(self.units[row][0], unit), 1.0 + len(others))]
        own = [(self.plant.element(unit, unit), 1.0)]
        if not others:
            return own
        return [*own, (self.plant.element(unit, others[0]), float(len(others)))]


def alike(plant: Plant, characters: Sequence[Hashable]) -> Paths:
    """Return the paths of a plant whose units differ by `characters`, one a unit.

    Raises
    ------
    InvalidInputError
        More than `MAX_KINDS` kinds of units.

    """
    if not plant.interchangeable:
        return Paths(plant, plant.kinds)
    kinds: dict[Hashable, list[int]] = {}
    for unit, character in enumerate(characters):
        kinds.setdefault(character, []).append(unit)
    if len(kinds) > MAX_KINDS:
        message = (
            f"{len(kinds)} units differ in loop, steps, actuator or limits; "
            f"at most {MAX_KINDS} kinds are simulated together"
        )
        raise InvalidInputError(message, "/steps")
    return Paths(plant, tuple(tuple(units) for units in kinds.values()))
