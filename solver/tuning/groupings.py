"""Which loops share their settings: the partitions of the units, and how they are related.

The units of a parallel plant may change places, so a partition of them is a list of sizes, and the
first group holds the first units.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from solver.model.blocks import marks
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.tuning.specification import Arrangement, Signs, Specification

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Sequence

__all__ = [
    "Groups",
    "by_errors",
    "coarser",
    "consecutive",
    "groupings",
    "identical_groups",
    "merged",
    "neighbours",
]

Groups = tuple[tuple[int, ...], ...]

MAX_CONTROLLERS = 10
EVERY_SPLIT = 12  # up to so many units every split into two groups is tried
MAX_COARSER = 12  # partitions into two groups whose optima a freer one starts from


def identical_groups(plant: Plant) -> Groups:
    """All units in one group."""
    return (tuple(range(plant.n)),)


def groupings(specification: Specification) -> tuple[Groups, ...]:
    """Partitions to be tuned, the most symmetric first; for BEST those to begin with.

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
        groups, where = specification.groups, "groups"
        if groups is None:
            groups, where = consecutive(specification.group_sizes or ()), "group_sizes"
        if len(groups) > MAX_CONTROLLERS:
            message = f"at most {MAX_CONTROLLERS} groups"
            raise InvalidInputError(message, f"/controller/{where}")
        _require_one_sign(specification, groups)
        return (groups,)
    if arrangement is Arrangement.INDEPENDENT:
        if plant.n > MAX_CONTROLLERS:
            message = (
                f"independent settings for {plant.n} units are too many to search "
                f"(at most {MAX_CONTROLLERS}); use 'identical', 'grouped' or 'best'"
            )
            raise InvalidInputError(message, "/controller/arrangement")
        return (consecutive((1,) * plant.n),)
    found = [identical_groups(plant)]
    if specification.interchangeable:
        found += [consecutive((size, plant.n - size)) for size in _parts(plant.n)]
    else:
        unlike = (by_errors(specification), consecutive((1,) * plant.n))
        found += [groups for groups in unlike if len(groups) <= MAX_CONTROLLERS]
    return tuple(dict.fromkeys(found))


def by_errors(specification: Specification) -> Groups:
    """Units of a parallel plant in groups of equal errors and equal limits of their gains.

    On a matrix plant every unit is its own.
    """
    plant, scales = specification.plant, specification.performance.output_scale
    if not plant.interchangeable:
        return plant.kinds
    mark = marks(specification.uncertainty, scales)
    groups: dict[Hashable, list[int]] = {}
    demands = specification.demands
    for unit in range(plant.n):
        groups.setdefault((mark(unit), demands.gain_ratio((unit,))), []).append(unit)
    return tuple(tuple(units) for units in groups.values())


def merged(groups: Groups, into: Groups) -> tuple[int, ...] | None:
    """Return which group of the partition `into` holds each of the `groups`; None: not all do."""
    owner = {unit: index for index, group in enumerate(into) for unit in group}
    found = [{owner[unit] for unit in group} for group in groups]
    return tuple(each.pop() for each in found) if all(len(each) == 1 for each in found) else None


def _require_one_sign(specification: Specification, groups: Groups) -> None:
    """Refuse groups of unlike units whose own gains have opposite signs: one gain serves not both.

    Unless any signs are permitted: such loops may be stable together, though never alone.
    """
    if specification.signs is Signs.ANY or specification.plant.interchangeable:
        return
    for index, group in enumerate(groups):
        gains = [specification.plant.entry(unit, unit).static_gain for unit in group]
        for unit, gain in zip(group, gains, strict=True):
            if (gain < 0) is not (gains[0] < 0):
                message = (
                    f"loops {group[0] + 1} and {unit + 1} have steady-state gains of opposite "
                    "signs and cannot share one controller gain; split the group, or permit any "
                    "signs"
                )
                raise InvalidInputError(message, f"/controller/groups/{index}")


def neighbours(groups: Groups) -> tuple[Groups, ...]:
    """Partitions of a parallel plant beside this one.

    A group split in two, a unit moved from one group to another, two groups merged.
    """
    sizes = sorted(len(group) for group in groups)
    found = []
    for index, size in enumerate(sizes):
        rest = sizes[:index] + sizes[index + 1 :]
        found += [[*rest, part, size - part] for part in _parts(size)]
    for a, b in itertools.permutations(range(len(sizes)), 2):
        moved = list(sizes)
        moved[a] -= 1
        moved[b] += 1
        found.append([size for size in moved if size])
    for a, b in itertools.combinations(range(len(sizes)), 2):
        rest = [size for index, size in enumerate(sizes) if index not in (a, b)]
        found.append([*rest, sizes[a] + sizes[b]])
    different = dict.fromkeys(tuple(sorted(each)) for each in found)
    return tuple(
        consecutive(each)
        for each in different
        if each != tuple(sizes) and len(each) <= MAX_CONTROLLERS
    )


def coarser(groups: Groups) -> tuple[tuple[Groups, tuple[int, ...]], ...]:
    """Partitions of a parallel plant whose optima are starts of a freer one.

    Returns
    -------
    pairs of Groups and tuple of int
        One group, or two into which the given ones are merged in any way, as sizes; and which of
        them each given group belongs to.

    """
    sizes = [len(group) for group in groups]
    if len(sizes) == 1:
        return ()
    found: dict[tuple[tuple[int, ...], ...], tuple[Groups, tuple[int, ...]]] = {}
    for members in itertools.islice(_subsets(len(sizes)), 4 * MAX_COARSER):
        parts = [[sizes[i] for i in members], [s for i, s in enumerate(sizes) if i not in members]]
        totals = [sum(part) for part in parts]
        order = [0, 1] if totals[0] <= totals[1] else [1, 0]
        owner = tuple(order.index(0 if i in members else 1) for i in range(len(sizes)))
        key = tuple(sorted(tuple(sorted(part)) for part in parts))
        merged = consecutive([totals[part] for part in order])
        found.setdefault(key, (merged, owner))
    pairs = list(found.values())[:MAX_COARSER] if len(sizes) > 2 else []
    return ((consecutive([sum(sizes)]), (0,) * len(sizes)), *pairs)


def named_partition(specification: Specification) -> Groups:
    """Return the groups of a task whose arrangement is not to be sought."""
    n = specification.plant.n
    if specification.arrangement is Arrangement.IDENTICAL:
        return identical_groups(specification.plant)
    if specification.groups is not None:
        return specification.groups
    return consecutive(specification.group_sizes or (1,) * n)


def consecutive(sizes: Sequence[int]) -> Groups:
    """Return groups of these sizes, the first one holding the first units."""
    ends = list(itertools.accumulate(sizes, initial=0))
    return tuple(tuple(range(*pair)) for pair in itertools.pairwise(ends))


def _subsets(count: int) -> Iterator[tuple[int, ...]]:
    """Subsets of the first `count` numbers that hold 0, but not all of them, small ones first."""
    for size in range(count - 1):
        for rest in itertools.combinations(range(1, count), size):
            yield (0, *rest)


def _parts(n: int) -> list[int]:
    """Sizes of the smaller part of n units: all of them, or a few of very many."""
    if n <= EVERY_SPLIT:
        return list(range(1, n // 2 + 1))
    return sorted({1, 2, n // 8, n // 4, n // 2})
