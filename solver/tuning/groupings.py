"""Which loops share their settings: the partitions of the units that a tuning tries."""

from __future__ import annotations

from solver.model.errors import InvalidInputError
from solver.model.plants import ParallelPlant, Plant
from solver.tuning.specification import Arrangement, Specification

__all__ = ["Groups", "groupings", "identical_groups"]

Groups = tuple[tuple[int, ...], ...]

MAX_CONTROLLERS = 10
EVERY_SPLIT = 12  # up to so many units every split into two groups is tried
MANY_GROUPS = 4  # up to so many units fully independent settings are tried as well


def identical_groups(plant: Plant) -> Groups:
    """All units in one group."""
    return (tuple(range(plant.n)),)


def groupings(specification: Specification) -> tuple[Groups, ...]:
    """Partitions to be tuned, the most symmetric first.

    Raises
    ------
    InvalidInputError
        More different controllers than `MAX_CONTROLLERS`.

    """
    plant = specification.plant
    arrangement = specification.arrangement
    if arrangement is Arrangement.IDENTICAL:
        return (identical_groups(plant),)
    if arrangement is Arrangement.GROUPED:
        sizes = specification.group_sizes or ()
        if len(sizes) > MAX_CONTROLLERS:
            message = f"at most {MAX_CONTROLLERS} groups"
            raise InvalidInputError(message, "/controller/group_sizes")
        return (_consecutive(sizes),)
    if arrangement is Arrangement.INDEPENDENT:
        if plant.n > MAX_CONTROLLERS:
            message = (
                f"independent settings for {plant.n} units are too many to search "
                f"(at most {MAX_CONTROLLERS}); use 'grouped' or 'best'"
            )
            raise InvalidInputError(message, "/controller/arrangement")
        return (_consecutive((1,) * plant.n),)
    return _candidates(plant)


def _candidates(plant: Plant) -> tuple[Groups, ...]:
    """Identical, splits in two groups, and for few units all independent."""
    n = plant.n
    found = [identical_groups(plant)]
    if isinstance(plant, ParallelPlant):
        if n <= EVERY_SPLIT:
            splits = list(range(1, n // 2 + 1))
        else:
            splits = sorted({1, 2, n // 8, n // 4, n // 2})
        found += [_consecutive((size, n - size)) for size in splits]
    if n <= (MANY_GROUPS if isinstance(plant, ParallelPlant) else MAX_CONTROLLERS):
        found.append(_consecutive((1,) * n))
    return tuple(dict.fromkeys(found))


def _consecutive(sizes: tuple[int, ...]) -> Groups:
    groups, first = [], 0
    for size in sizes:
        groups.append(tuple(range(first, first + size)))
        first += size
    return tuple(groups)
