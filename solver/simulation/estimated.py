"""The overshoot of a single loop, estimated from its frequency response: no simulation."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners, grid, resonances

if TYPE_CHECKING:
    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["estimated_overshoot"]

PER_DECADE = 44  # frequencies
TIMES = 240
BEYOND = 300.0  # over the shortest time shown: T has died away there, or nearly
BELOW = 0.003  # over the longest one
RESOLVED = 0.02  # of 1, by which steps twice as long may differ


def estimated_overshoot(plant: Plant, loop: Controller, longest: float) -> float | None:
    """Return by how much y exceeds a set-point step of 1 by the time `longest`, about.

    Parameters
    ----------
    plant : Plant
        Of one unit, stable under the loop.
    loop : Controller
        Its controller.
    longest : float
        Time unit of the plant.

    Returns
    -------
    float or None
        Within some hundredths; None where steps of `longest` / `TIMES` do not resolve the loop.

    """
    time = np.linspace(longest / TIMES, longest, TIMES)
    bends = corners(plant, None, [loop])
    low, high = BELOW / longest, BEYOND * TIMES / longest
    omega = grid(low, high, PER_DECADE, [resonances(plant), bends[(bends > low) & (bends < high)]])
    L = plant.response(omega)[:, 0, 0] * loop.response(omega)
    real = (L / (1 + L)).real
    # h(t) = (2/pi) int Re T cos(omega t) d omega of the broken line through the samples, level to
    # omega = 0, by parts; then y by the trapezoidal rule.
    slope = np.diff(real) / np.diff(omega)
    cosines = np.cos(omega * time[:, None])
    turns = np.diff(cosines, axis=1) @ slope / time**2
    ends = real[-1] * np.sin(omega[-1] * time) / time
    h = (2 / math.pi) * (turns + ends)
    start = (2 / math.pi) * float(np.sum((real[1:] + real[:-1]) * np.diff(omega)) / 2)
    h = np.append(start, h)
    y = np.cumsum((h[1:] + h[:-1]) / 2) * time[0]
    coarse = np.cumsum((h[2::2] + h[:-2:2]) / 2) * 2 * time[0]
    if not np.abs(y[1::2] - coarse).max() < RESOLVED:
        return None
    return float(y.max() - 1)
