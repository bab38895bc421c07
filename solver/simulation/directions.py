"""The easy and the difficult direction of a plant: set-point changes it follows gladly, or not.

At steady state the inputs must move by G(0)^-1 r, least for the output direction of the largest
singular value and most for that of the smallest. For a parallel plant these are "all units
together" and "one half against the other" (Skogestad, Lundstrom and Hovd 1989, section 5.3,
figs. 9 and 10), in this order where the interaction is positive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.plants import ParallelPlant, Plant
from solver.model.validation import instance

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["difficult_direction", "easy_direction"]


def easy_direction(plant: Plant) -> NDArray[np.float64]:
    """Return the set-point change (n,) that needs the least input, largest entry 1.

    Parameters
    ----------
    plant : Plant
        n units.

    Raises
    ------
    InvalidInputError
        A matrix plant that integrates: its steady state gain is infinite.

    """
    return _directions(plant)[0]


def difficult_direction(plant: Plant) -> NDArray[np.float64]:
    """Return the set-point change (n,) that needs the most input, largest entry 1.

    Parameters
    ----------
    plant : Plant
        n units.

    Raises
    ------
    InvalidInputError
        A matrix plant that integrates.

    """
    return _directions(plant)[1]


def _directions(plant: Plant) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    instance(plant, Plant, "/plant")
    if isinstance(plant, ParallelPlant):
        together = np.ones(plant.n)
        if plant.n == 1:
            return together, together
        half = plant.n // 2
        apart = np.ones(plant.n)
        apart[:half] = -1.0
        # An odd unit: the sums of both sides stay equal.
        apart[half:] = half / (plant.n - half)
        return (together, apart) if _together_is_easy(plant) else (apart, together)
    gain = plant.static_gain()
    if not np.all(np.isfinite(gain)):
        message = "an integrating plant has no steady state gain, hence no such directions"
        raise InvalidInputError(message, "/plant")
    left, _, _ = np.linalg.svd(gain)
    return _scaled(left[:, 0]), _scaled(left[:, -1])


def _together_is_easy(plant: ParallelPlant) -> bool:
    """Compare |g + (n - 1) i| with |g - i| at steady state, integrators included."""
    # Far below every corner frequency; for a tie both are equally easy.
    slow = 1e-9 / max(1.0, *(max(abs(c) for c in e.den) for e in plant.elements))
    process, interaction = complex(plant.process(slow)), complex(plant.interaction(slow))
    return abs(process + (plant.n - 1) * interaction) >= abs(process - interaction)


def _scaled(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale to a largest entry of exactly 1."""
    scaled: NDArray[np.float64] = direction / direction[np.argmax(np.abs(direction))]
    return scaled
