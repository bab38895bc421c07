"""Where the dynamics of a plant lie: its corner frequencies and a grid that spans them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from solver.transfer_function import TransferFunction

__all__ = ["corner_frequencies", "frequency_grid"]


def corner_frequencies(elements: Iterable[TransferFunction]) -> tuple[float, float]:
    """Return the lowest and highest corner frequency (rad per time unit).

    Corners are the magnitudes of poles and zeros and the inverse dead times; roots at the
    origin have none. A plant of pure gains is given corners at 1.
    """
    lowest, highest = math.inf, 0.0
    for element in elements:
        roots = np.abs(np.concatenate([element.poles, element.zeros]))
        corners = [float(value) for value in roots if value > 0]
        if element.dead_time > 0 and not element.is_zero:
            corners.append(1 / element.dead_time)
        if corners:
            lowest, highest = min(lowest, *corners), max(highest, *corners)
    return (lowest, highest) if highest else (1.0, 1.0)


def frequency_grid(
    elements: Iterable[TransferFunction], points: int, below: float, above: float
) -> NDArray[np.float64]:
    """Return `points` frequencies, even in logarithm, rad per time unit, ascending.

    Parameters
    ----------
    elements : iterable of TransferFunction
        The plant's elements.
    points : int
        Number of frequencies, >= 2.
    below, above : float
        Factors by which the grid reaches below the lowest and above the highest corner.

    """
    lowest, highest = corner_frequencies(elements)
    return np.geomspace(lowest / below, highest * above, points)
