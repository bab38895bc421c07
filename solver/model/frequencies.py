"""Where the curves of a loop bend: corner frequencies, and grids that resolve them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Uncertainty

__all__ = [
    "corners",
    "corners_of",
    "finite_reach",
    "grid",
    "low_end",
    "reach",
    "resonances",
    "resonances_of",
]

# Times go up to 1e12; what bends further out than this is a coefficient that might be zero.
EXTREMES = (1e-18, 1e18)
FLAT = 1e-8  # relative rise over two decades below which a curve is at its limit for omega -> 0


def corners(
    plant: Plant, uncertainty: Uncertainty | None = None, loops: Iterable[Controller] = ()
) -> NDArray[np.float64]:
    """Corner frequencies (rad per time unit) of everything in the loop, ascending, at least one.

    Magnitudes of poles and zeros, 1/dead time, 1/tau_I, 1/tau_D and 1/tau_F.
    """
    functions: list[TransferFunction] = list(plant.elements)
    if uncertainty is not None:
        functions += uncertainty.all_weights
    found = _corners_of_functions(functions)
    for loop in set(loops):
        times = (loop.integral_time, loop.derivative_time, loop.lag_time)
        found.update(1 / time for time in times if time)
    return _ascending(found)


def corners_of(functions: Iterable[TransferFunction]) -> NDArray[np.float64]:
    """Corner frequencies (rad per time unit) of transfer functions, ascending, at least one."""
    return _ascending(_corners_of_functions(functions))


def reach(plant: Plant, loops: Iterable[Controller]) -> tuple[float, float]:
    """Frequencies (rad per time unit) where the gain of a loop first and last can be one.

    By the asymptotes of each element of the plant times each controller; where an asymptote is
    level it says nothing. (inf, 0) if none says anything.
    """
    slow, fast = math.inf, 0.0
    for element in plant.elements:
        if element.is_zero:
            continue
        lowest = [next(c for c in reversed(part) if c != 0) for part in (element.num, element.den)]
        powers = [
            next(k for k, c in enumerate(reversed(part)) if c != 0)
            for part in (element.num, element.den)
        ]
        static = abs(lowest[0]) / abs(lowest[1])
        steep = abs(element.num[0] / element.den[0])
        for loop in loops:
            gain, fall, degree = abs(loop.gain), powers[1] - powers[0], element.relative_degree
            rate, high = gain, gain
            if loop.integral_time is not None:
                rate, fall = gain / loop.integral_time, fall + 1
            if loop.lag_time:
                high /= loop.lag_time
                if loop.derivative_time is None:
                    degree += 1
                else:
                    high *= loop.derivative_time
            if fall > 0:
                slow = min(slow, (rate * static) ** (1 / fall))
            if degree > 0:
                fast = max(fast, (high * steep) ** (1 / degree))
    return slow, fast


def finite_reach(plant: Plant, loops: Iterable[Controller]) -> list[float]:
    """Return what `reach` knows: none, one or two frequencies, rad per time unit."""
    lowest, highest = EXTREMES
    known = [omega for omega in reach(plant, loops) if 0 < omega < math.inf]
    return [min(max(omega, lowest), highest) for omega in known]


def resonances(plant: Plant) -> NDArray[np.float64]:
    """Frequencies that resolve lightly damped poles and zeros of the plant, ascending.

    A root at -d +- j w bends the curves within a few d of w, which no fixed grid can know.
    """
    return resonances_of(plant.elements)


def resonances_of(functions: Iterable[TransferFunction]) -> NDArray[np.float64]:
    """Frequencies that resolve lightly damped poles and zeros of transfer functions, ascending."""
    roots = np.array([root for f in functions for root in (*f.poles, *f.zeros)], dtype=complex)
    light = roots[(roots.imag > 0) & (np.abs(roots.real) < 0.5 * roots.imag)]
    if not light.size:
        return np.array([])
    offsets = np.array([-30, -10, -5, -3, -2, -1, -0.5, 0, 0.5, 1, 2, 3, 5, 10, 30])
    points = light.imag[:, None] + np.abs(light.real)[:, None] * offsets
    return np.unique(points[points > 0])


def grid(
    low: float, high: float, per_decade: float, extra: Sequence[NDArray[np.float64]] = ()
) -> NDArray[np.float64]:
    """Logarithmic grid from `low` to `high` with the `extra` points inside it, ascending."""
    count = max(2, int(np.ceil(per_decade * np.log10(high / low))) + 1)
    points = np.concatenate([np.geomspace(low, high, count), *extra])
    return np.unique(points[(points >= low) & (points <= high)])


def low_end(
    curve: Callable[[NDArray[np.float64]], NDArray[np.float64]], start: float, lowest: float
) -> float:
    """Return a frequency, `start` or below, from which a curve rises no more towards omega = 0.

    A weak direction of a plant, whose gain is far below that of the others, is slower than any
    corner.

    Parameters
    ----------
    curve : callable
        Positive values (k,) at frequencies (k,).
    start, lowest : float
        Where to begin, and below which not to go on, rad per time unit.

    """
    low = start
    here, below = curve(np.array([low, 0.01 * low]))
    while below > here * (1 + FLAT) and low > lowest:
        low *= 0.01
        here, below = below, curve(np.array([0.01 * low]))[0]
    return low


def _corners_of_functions(functions: Iterable[TransferFunction]) -> set[float]:
    found: set[float] = set()
    for function in functions:
        found.update(np.abs(function.poles).tolist())
        found.update(np.abs(function.zeros).tolist())
        if function.dead_time > 0:
            found.add(1 / function.dead_time)
    return found


def _ascending(found: set[float]) -> NDArray[np.float64]:
    positive = sorted(value for value in found if value > 0)
    return np.clip(positive, *EXTREMES) if positive else np.array([1.0])
