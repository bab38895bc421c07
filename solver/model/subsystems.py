"""The plant and loops that remain when some loops are in manual."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.blocks import by_settings, marks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Uncertainty

__all__ = ["interchangeable", "subsystem"]


def subsystem(
    plant: Plant, loops: Sequence[Controller], units: Sequence[int]
) -> tuple[Plant, tuple[Controller, ...]]:
    """Return plant and loops of the `units` in service, at least one, all others in manual.

    An input in manual is constant, so the outputs of the units in service depend on their own
    inputs alone: rows and columns of the others drop out. A parallel plant stays parallel.
    """
    return plant.part(units), tuple(loops[unit] for unit in units)


def interchangeable(
    plant: Plant,
    loops: Sequence[Controller],
    uncertainty: Uncertainty | None = None,
    output_scale: Sequence[float] | None = None,
) -> tuple[tuple[int, ...], ...]:
    """Return the units in groups whose loops may change places without any effect.

    Units of a parallel plant with equal settings and, where given, equal uncertainty and permitted
    errors; on a matrix plant every unit is its own.
    """
    if not plant.interchangeable:
        return plant.kinds
    groups = by_settings(loops, marks(uncertainty, output_scale))
    return tuple(tuple(units) for units in groups.values())
