"""The colour of what a fit leaves, and readings weighted by it.

Least squares on a coloured residual is consistent, but it listens to slow disturbances as if each
reading were new. Weighted by the disturbance's own colour (generalised least squares: Aitken, Proc.
R. Soc. Edinb. 55 (1936) 42) each reading counts by what it adds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

from solver.identification.innovations import innovations

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Colour", "colour_of"]

MEMORIES = 10
SHARES = (0.0, 0.03, 0.3, 3.0)
LONGEST = 0.1  # of the record: a longer memory would leave the gains to the quickest moves alone
LEAST = 1e-8  # white part of a disturbance, so that the filter of a constant stays regular


@dataclass(frozen=True)
class Colour:
    """A disturbance that forgets, and white noise.

    Attributes
    ----------
    memory : float
        Time after which 1/e of the disturbance is left.
    share : float
        Variance of the white noise over the disturbance's.
    """

    memory: float
    share: float

    def whitened(
        self, time: NDArray[np.float64], seen: NDArray[np.bool_], columns: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what is new in each reading, (k,) or (k, c).

        Of a disturbance of this colour it is white, with the disturbance's own variance.
        """
        table = np.ascontiguousarray(columns.reshape(time.size, -1).T)
        out = np.empty_like(table)
        innovations(time, seen, self.memory, self.share, table, out)
        return out.T.reshape(columns.shape)


def colour_of(
    time: NDArray[np.float64], seen: NDArray[np.bool_], left: NDArray[np.float64]
) -> Colour | None:
    """Return the likeliest colour of a residual, or None where white noise is as likely.

    Parameters
    ----------
    time : (k,) ndarray
        Of the readings.
    seen : (k,) ndarray of bool
        Which count.
    left : (k,) ndarray
        Residual.

    """
    count = int(np.count_nonzero(seen))
    power = float(np.sum(left[seen] ** 2)) / max(count, 1)
    if not power > 0:
        return None
    table, out = left[None] / math.sqrt(power), np.empty((1, left.size))

    def cost(memory: float, share: float) -> float:
        level = float(innovations(time, seen, memory, share + LEAST, table, out))
        return count * (math.log(float(out[0] @ out[0]) / count) + level)

    sample = float(np.median(np.diff(time)))
    longest = LONGEST * float(time[-1] - time[0])
    if not longest > sample:
        return None
    grid = [(m, s) for m in np.geomspace(sample / 2, longest, MEMORIES) for s in SHARES]
    begin = min(grid, key=lambda pair: cost(*pair))
    low, high = math.log(sample / 2), math.log(longest)

    def away(x: NDArray[np.float64]) -> float:
        return cost(math.exp(min(max(float(x[0]), low), high)), float(x[1]) ** 2)

    found = minimize(
        away,
        np.array([math.log(begin[0]), math.sqrt(begin[1])]),
        method="Nelder-Mead",
        tol=1e-2,
    )
    # The criterion of Schwarz; white noise has neither number.
    if not found.fun + 2 * math.log(count) < 0:
        return None
    return Colour(math.exp(min(max(found.x[0], low), high)), float(found.x[1] ** 2) + LEAST)
