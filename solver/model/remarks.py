"""What was made of a plant's coefficients, in words: rounding taken for the zero that it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.plants import ParallelPlant

if TYPE_CHECKING:
    from solver.model.plants import Plant

__all__ = ["plant_remarks"]


def plant_remarks(plant: Plant) -> tuple[str, ...]:
    """Return the remarks on all elements, each with the place of its element."""
    if isinstance(plant, ParallelPlant):
        places = [("process", plant.process)]
        if plant.n > 1:
            places.append(("interaction", plant.interaction))
    else:
        places = [
            (f"element {row + 1}, {column + 1}", plant.element(row, column))
            for row in range(plant.n)
            for column in range(plant.n)
        ]
    return tuple(
        f"The plant's {place}: {remark}." for place, element in places for remark in element.remarks
    )
