"""Compiled: what does not depend on the settings, at any frequencies: plant and weights."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.model.sums import Sums, squares, summed
from solver.mu.workspace import compiled

__all__ = ["Samples", "Sources", "joined", "samples"]


class Sources(NamedTuple):
    """Where samples come from.

    Attributes
    ----------
    plant, weights, performance : Sums
        `LoopBlocks.sums`, the weight of each row, and that of the performance rows.
    rows, widest : int
        Of the plant.
    target : float
        The mu that is demanded.
    saturation : float
        The value of s, plus log omega, from which a frequency measures it no more.

    """

    plant: Sums
    weights: Sums
    performance: Sums
    rows: int
    widest: int
    target: float
    saturation: float


class Samples(NamedTuple):
    """Plant, weights and the rest at k frequencies.

    Attributes
    ----------
    omega : (k,)
        Frequencies, rad per time unit.
    G, u, b : (k, rows, widest) complex, (k, rows), (k,)
        As for `sweep`.
    saturated : (k,)
        As for `judged`.

    """

    omega: NDArray[np.float64]
    G: NDArray[np.complex128]
    u: NDArray[np.float64]
    b: NDArray[np.float64]
    saturated: NDArray[np.float64]


@compiled
def samples(sources, omega):
    """Return the samples at `omega` (k,)."""
    s = 1j * omega
    G = summed(sources.plant, sources.rows, sources.widest, s)
    u = squares(sources.weights, sources.rows, s) / sources.target**2
    b = squares(sources.performance, 1, s)[:, 0].copy()
    return Samples(omega, G, u, b, sources.saturation - np.log(omega))


@compiled
def joined(one, other):
    """Return samples behind others."""
    return Samples(
        np.concatenate((one.omega, other.omega)),
        np.concatenate((one.G, other.G)),
        np.concatenate((one.u, other.u)),
        np.concatenate((one.b, other.b)),
        np.concatenate((one.saturated, other.saturated)),
    )
