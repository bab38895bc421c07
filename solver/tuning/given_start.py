"""Known settings as the start of a local search."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError
from solver.tuning.specification import Arrangement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.tuning.groupings import Groups
    from solver.tuning.specification import Specification

__all__ = ["given_groups", "signs_of"]


def given_groups(specification: Specification, groups: Groups) -> Groups:
    """Return the groups of a search from `specification.start`, those of the arrangement.

    For BEST the loops with equal settings.

    Raises
    ------
    InvalidInputError
        Loops of one group have different settings.

    """
    start = specification.start or ()
    if specification.arrangement is Arrangement.BEST:
        alike: dict[Controller, list[int]] = {}
        for unit, loop in enumerate(start):
            alike.setdefault(loop, []).append(unit)
        return tuple(tuple(units) for units in alike.values())
    for group in groups:
        for unit in group:
            if start[unit] != start[group[0]]:
                message = (
                    f"loops {group[0] + 1} and {unit + 1} share their settings in this arrangement"
                )
                raise InvalidInputError(message, f"/search/start/{unit}")
    return groups


def signs_of(loops: Sequence[Controller]) -> tuple[float, ...]:
    """Return the sign of each gain."""
    return tuple(1.0 if loop.gain > 0 else -1.0 for loop in loops)
