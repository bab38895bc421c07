"""Times of a task that hardly are in one unit: minutes are 60 seconds, hours 3600."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.frequencies import corners, corners_of

if TYPE_CHECKING:
    from solver.tuning.specification import Specification

__all__ = ["times_remark"]

FAR = 1000.0  # of the errors' time scale: more than 60 times a usual 10
NEAR = 0.1  # of it: the inputs then are right for longer than the plant lasts


def times_remark(specification: Specification) -> str | None:
    """Return a doubt where the plant and the errors of its inputs have times far apart.

    Of the weights those of first order are looked at, whose time scale theta is twice their
    shortest time (`Uncertainty.from_error`).
    """
    slowest = 1 / float(corners(specification.plant)[0])
    for weight in specification.uncertainty.weights:
        if len(weight.den) != 2:
            continue
        theta = 2 / float(corners_of([weight])[-1])
        if NEAR <= slowest / theta <= FAR:
            continue
        return (
            f"the slowest time of the plant is {slowest:.4g}, the time scale of its inputs' errors "
            f"{theta:.4g}: are both in the same unit?"
        )
    return None
