"""How far the gains of unstable loops must be reduced."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from solver.stability.closed_loop import is_stable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["stable_gain_factor"]

STEP = 0.25  # between the factors that are tried, down to
LEAST = 2.0**-20  # this one for all loops together, or
LEAST_OF_ONE = 2.0**-10  # this one for some of them: the others' fault lies elsewhere then
REFINED = 1e-3  # relative


def stable_gain_factor(
    plant: Plant, loops: Sequence[Controller], units: Sequence[int] | None = None
) -> float | None:
    """Return a factor on gains of unstable loops below which they become stable.

    Of all loops, or of those of the `units` alone, the others as they are.

    It is the greatest in the sense of a search by halves: the loops are stable at it and at the
    factors half, a quarter, ... of it, and unstable just above. None: no factor down to `LEAST`
    makes them stable, as where a sign is wrong.
    """
    turned = set(range(plant.n) if units is None else units)
    least = LEAST if len(turned) == plant.n else LEAST_OF_ONE

    def stable(factor: float) -> bool:
        return is_stable(
            plant,
            [
                replace(loop, gain=factor * loop.gain) if unit in turned else loop
                for unit, loop in enumerate(loops)
            ],
        )

    factor = STEP
    while not stable(factor):
        factor *= STEP
        if factor < least:
            return None
    # Below it stability is checked on a few factors more: a conditionally stable loop loses it.
    if not all(stable(factor * STEP**power) for power in (1, 2, 4)):
        return None
    low, high = factor, factor / STEP
    while high > low * (1 + REFINED):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
