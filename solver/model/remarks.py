"""What was made of a plant's coefficients, in words: rounding taken for the zero that it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.model.plants import Plant

__all__ = ["plant_remarks"]


def plant_remarks(plant: Plant) -> tuple[str, ...]:
    """Return the remarks on all elements, each with the place of its element."""
    return tuple(
        f"The plant's {place.words}: {remark}."
        for place in plant.places
        for remark in place.element.remarks
    )
