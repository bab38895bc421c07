"""How wrong the parameters of a model may be, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from service.printing import Line
from service.schemas.model_tolerance import ModelTolerance

__all__ = ["tolerance_lines"]

CLOSE = 0.05  # an error of the model that is soon made: said first
LEAST = {"time_constant": "beyond -99 %", "dead_time": "-100 %"}  # tried; of no dead time
SHOWN = 4  # parameters in the line; the result has all


def tolerance_lines(tolerances: Sequence[ModelTolerance]) -> list[Line]:
    """Say in one line how wrong the model may be, loudly where it may hardly be; or nothing."""
    shown = sorted(tolerances, key=lambda each: _least([each]))[:SHOWN]
    found = []
    for each in shown:
        name = each.parameter.replace("_", " ")
        if each.element is not None:
            name += f" of element {each.element[0] + 1},{each.element[1] + 1}"
        stability = f"stability {_range(each.parameter, each.stability)}"
        if each.demand is None:
            found.append(f"{name}: {stability}")
        else:
            found.append(f"{name}: demand {_range(each.parameter, each.demand)}, {stability}")
    if not found:
        return []
    text = f"The model may be wrong, one parameter alone, by: {'; '.join(found)}."
    return [Line(text, "warning") if _least(tolerances) < CLOSE else Line(text)]


def _least(tolerances: Sequence[ModelTolerance]) -> float:
    """Return the smallest error at which anything is lost."""
    sides = [each.demand or () for each in tolerances] + [each.stability for each in tolerances]
    return min((abs(side) for pair in sides for side in pair if side is not None), default=math.inf)


def _range(parameter: str, sides: Sequence[float | None]) -> str:
    """Say from where to where a parameter may be; where nothing is lost, how far it was tried."""
    low, high = (None if side is None else 100 * side for side in sides)
    below = LEAST.get(parameter, "beyond -400 %") if low is None else f"{low:.3g} %"
    above = "beyond +400 %" if high is None else f"+{high:.3g} %"
    return f"{below} to {above}"
