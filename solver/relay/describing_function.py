"""Ultimate gain and frequency: from a limit cycle, from a frequency response, from theory.

A relay of amplitude d and hysteresis eps at a sinusoid of amplitude a acts like the gain N(a),
|N| = 4 d/(pi a), -1/N(a) = -(pi/4d) sqrt(a^2 - eps^2) - i pi eps/(4 d) (Astrom and Hagglund 1984;
Johansson 1993, section 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from solver.simulation.chebyshev import evaluation_matrix

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.simulation.trajectory import Trajectory

__all__ = ["Harmonic", "Ultimate", "half_range", "harmonics", "ultimate_gain", "ultimate_point"]

_GRID = 2000  # frequencies looked at for a crossing
_MOST_REFINED = 10
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_PLACES = (1 + _POINTS) / 2
_GAUSS = evaluation_matrix(_PLACES)


@dataclass(frozen=True)
class Ultimate:
    """Ultimate gain K_u and ultimate frequency omega_u (rad per time unit)."""

    gain: float
    omega: float

    @property
    def period(self) -> float:
        """T_u = 2 pi/omega_u."""
        return 2 * np.pi / self.omega


@dataclass(frozen=True)
class Harmonic:
    """First harmonic of an output over that of the relay: the frequency response, measured.

    Attributes
    ----------
    gain : float
        Its magnitude.
    phase : float
        rad, in -2 pi..0.

    """

    gain: float
    phase: float


def ultimate_gain(amplitude: float, relay_amplitude: float) -> float:
    """Return K_u = 4 d/(pi a) for an output of amplitude a."""
    return 4 * abs(relay_amplitude) / (np.pi * amplitude)


def half_range(trajectory: Trajectory, signal: int, start: float, end: float) -> float:
    """Return half the difference between the extremes of a signal from `start` to `end`."""
    return float(np.ptp(trajectory.turning_points(signal).within(start, end).value)) / 2


def harmonics(
    trajectory: Trajectory, outputs: Sequence[int], relay: int, start: float, end: float
) -> tuple[Harmonic, ...]:
    """Return the first harmonics of `outputs` over one period, relative to the signal `relay`.

    Parameters
    ----------
    trajectory : Trajectory
        The signals.
    outputs : sequence of int
        The outputs.
    relay : int
        The plant input that the relay drives.
    start, end : float
        One period; both ends are switchings.

    """
    values = [_coefficient(trajectory, signal, start, end) for signal in (relay, *outputs)]
    ratios = [value / values[0] for value in values[1:]]
    return tuple(
        Harmonic(abs(ratio), float(-np.mod(-np.angle(ratio), 2 * np.pi))) for ratio in ratios
    )


def _coefficient(trajectory: Trajectory, signal: int, start: float, end: float) -> complex:
    # Switchings are boundaries of steps; half a step's slack takes care of rounding.
    middle = trajectory.starts + trajectory.lengths / 2
    inside = (middle > start) & (middle < end)
    omega = 2 * np.pi / (end - start)
    lengths = trajectory.lengths[inside]
    times = trajectory.starts[inside, None] + lengths[:, None] * _PLACES
    values = trajectory.nodes(signal)[inside] @ _GAUSS.T
    integrals = (values * np.exp(-1j * omega * times)) @ (_WEIGHTS / 2)
    return complex(lengths @ integrals)


def ultimate_point(
    response: Callable[[NDArray[np.float64]], NDArray[np.complex128]],
    lowest: float,
    highest: float,
    offset: float = 0.0,
) -> Ultimate | None:
    """Return where a Nyquist curve crosses the line Im = -offset, left of the imaginary axis.

    Parameters
    ----------
    response : callable
        Frequency response at (k,) frequencies, (k,) complex.
    lowest, highest : float
        Range of frequencies looked at, rad per time unit.
    offset : float
        0: the negative real axis, the ultimate point proper. pi eps/(4 d): the describing
        function of a relay with hysteresis.

    Returns
    -------
    Ultimate or None
        Of all crossings that one with the least gain 1/|G|; None where there is none.

    """

    def height(omega: float) -> float:
        return float(response(np.array([omega]))[0].imag) + offset

    grid = np.geomspace(lowest, highest, _GRID)
    values = response(grid)
    heights = values.imag + offset
    found = []
    crossings = np.flatnonzero(heights[:-1] * heights[1:] < 0)
    # Only the least gain is wanted; a dead time crosses the line at ever higher gains.
    strongest = crossings[np.argsort(-np.abs(values[crossings]))][:_MOST_REFINED]
    for index in strongest:
        omega = float(brentq(height, grid[index], grid[index + 1], xtol=1e-14 * grid[index]))
        value = complex(response(np.array([omega]))[0])
        if value.real < 0:
            found.append(Ultimate(1 / abs(value), omega))
    return min(found, key=lambda point: point.gain, default=None)
