"""The plant and loops that remain when some loops are in manual."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.plants import MatrixPlant, ParallelPlant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["interchangeable", "subsystem"]


def subsystem(
    plant: Plant, loops: Sequence[Controller], units: Sequence[int]
) -> tuple[Plant, tuple[Controller, ...]]:
    """Return plant and loops of the `units` in service, at least one, all others in manual.

    An input in manual is constant, so the outputs of the units in service depend on their own
    inputs alone: rows and columns of the others drop out. A parallel plant stays parallel.
    """
    remaining = tuple(loops[unit] for unit in units)
    if isinstance(plant, ParallelPlant):
        return ParallelPlant(len(units), plant.process, plant.interaction), remaining
    rows = [[plant.element(row, column) for column in units] for row in units]
    return MatrixPlant(rows), remaining


def interchangeable(
    plant: Plant, loops: Sequence[Controller], output_scale: Sequence[float] | None = None
) -> tuple[tuple[int, ...], ...]:
    """Return the units in groups whose loops may change places without any effect.

    Units of a parallel plant with equal settings and, where given, equal permitted errors; on a
    matrix plant every unit is its own.
    """
    if not isinstance(plant, ParallelPlant):
        return tuple((unit,) for unit in range(plant.n))
    groups: dict[tuple[Controller, float | None], list[int]] = {}
    for unit, loop in enumerate(loops):
        error = None if output_scale is None else output_scale[unit]
        groups.setdefault((loop, error), []).append(unit)
    return tuple(tuple(units) for units in groups.values())
