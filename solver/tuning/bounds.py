"""Parameter bounds chosen from the plant, and the sign of each loop's gain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import reduce
from solver.model.frequencies import corners
from solver.model.transfer_function import LARGEST
from solver.tuning.minimax import Box
from solver.tuning.specification import ControllerKind, Specification

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant

__all__ = ["gain_signs", "parameter_box", "parameter_names"]


def gain_signs(plant: Plant, groups: tuple[tuple[int, ...], ...]) -> NDArray[np.float64]:
    """Sign of each group's gain: that of its first unit's own steady-state gain, (groups,)."""
    gains = [plant.element(group[0], group[0]).static_gain for group in groups]
    return np.array([-1.0 if gain < 0 else 1.0 for gain in gains])


def parameter_box(specification: Specification, groups: tuple[tuple[int, ...], ...]) -> Box:
    """Box of the log parameters, controller by controller.

    The scale is the crossover that the uncertainty permits: the lowest frequency where |w_I|
    reaches 1 or a dead time turns the phase by a radian. Gains reach from a thousandth of the one
    that puts the crossover of the plant's strongest direction there to thirty times the one that
    puts a single loop's there; integral times from a hundredth of that period to ten times the
    slowest one of the plant.
    """
    plant, given = specification.plant, specification.bounds
    omega = np.geomspace(*_span(specification), 400)
    too_uncertain = specification.uncertainty.magnitude(omega) >= 1
    crossover = float(omega[too_uncertain][0]) if too_uncertain.any() else float(omega[-1]) / 10
    delay = max(element.dead_time for element in plant.elements)
    if delay > 0:
        crossover = min(crossover, 1 / delay)
    slowest = float(corners(plant, specification.uncertainty)[0])
    blocks = reduce(plant, groups).response(crossover)
    strongest = max(float(np.linalg.norm(block[0], 2)) for block in blocks)
    low, high = [], []
    for group in groups:
        own = max(float(np.abs(plant.element(group[0], group[0]).response(crossover))[0]), 1e-12)
        rows = [
            given.gain or (1e-3 / max(own, strongest), 30 / own),
            given.integral_time or (0.01 / crossover, 10 / min(slowest, crossover)),
        ]
        if specification.kind is ControllerKind.PID:
            rows.append(given.derivative_time or (1e-3 / crossover, 10 / crossover))
        low += [row[0] for row in rows]
        high += [row[1] for row in rows]
    return Box(_log_inside(np.array(low), 1), _log_inside(np.minimum(high, LARGEST), -1))


def _log_inside(bound: NDArray[np.float64], inward: int) -> NDArray[np.float64]:
    """Logarithms whose exponentials do not pass the bound by rounding."""
    log = np.log(bound)
    while True:
        outside = inward * (bound - np.exp(log)) > 0
        if not outside.any():
            return log
        log = np.where(outside, np.nextafter(log, inward * np.inf), log)


def _span(specification: Specification) -> tuple[float, float]:
    bends = corners(specification.plant, specification.uncertainty)
    return 1e-3 * float(bends[0]), 1e3 * float(bends[-1])


def parameter_names(kind: ControllerKind) -> tuple[str, ...]:
    """Names of one controller's parameters, in their order in the box."""
    names = ("gain", "integral_time", "derivative_time")
    return names if kind is ControllerKind.PID else names[:2]
