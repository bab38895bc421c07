"""Standard errors of a fit whose residual is coloured.

The fit is least squares, whatever colours the disturbances: consistent, and true to what is to be
predicted. Its covariance is the sandwich (J'J)^-1 J' Omega J (J'J)^-1 with Omega from an
autoregression of the residual; J' Omega J needs J filtered backwards in time, nothing of size k^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import LinAlgError, solve_toeplitz
from scipy.linalg.lapack import dtbtrs
from scipy.special import stdtrit

from solver.identification.fitting import steps

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.colour import Colour
    from solver.identification.fitting import TimeLimits
    from solver.identification.row import Row, Solved

__all__ = ["Covariance", "autoregression", "backwards", "covariance"]

LONGEST_MEMORY = 12  # samples that the autoregression looks back
MOST_WIDENED = 2.0  # with fewer independent readings than parameters
LEAST_FREEDOM = 6.0
# Readings that an estimate of colour costs: Yule and Walker find too short a memory.
MEMORY = 4
# Two-sided 97.5 per cent: the intervals are to hold 95, and the fit is not quite linear in the
# shapes (measured on plants drawn at random: 96 to 97).
QUANTILE = 0.9875
# Directions in which the scaled normal matrix falls below this tell nothing: rounding.
UNTOLD = 1e-13


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of a row's parameters, shapes first, then gains.

    Attributes
    ----------
    matrix : (p, p) ndarray
        Infinite on the diagonal where the record says nothing, or no more than a bound.
    factor : (p, q) ndarray
        factor @ factor.T is `matrix` within what the record tells.
    quantile : float
        Student's for an interval, with as many degrees of freedom as the residual has independent
        readings beyond the parameters.
    noise : float
        Standard deviation of the residual.
    independent : float
        Number of independent readings in the residual.

    """

    matrix: NDArray[np.float64]
    factor: NDArray[np.float64]
    quantile: float
    noise: float
    independent: float


def covariance(
    row: Row,
    solved: Solved,
    limits: TimeLimits,
    colours: Sequence[Colour | None] | None = None,
) -> Covariance:
    """Return the covariance of shapes and gains at a fit.

    Parameters
    ----------
    row : Row
        The readings.
    solved : Solved
        The fit.
    limits : TimeLimits
        The box of the shapes.
    colours : sequence of Colour or None
        Of each segment's disturbances, where they are known beside the autoregression: what says
        more of the errors counts.

    """
    columns = [solved.left]
    if any(solved.shapes):
        columns.insert(0, row.jacobian(solved, steps(solved.kinds, limits)))
    F = np.hstack(columns)
    size = np.linalg.norm(F, axis=0)
    told = (size > 0) & ~_taken_as_known(solved, limits, size.size)
    F = F[:, told] / size[told]
    u, s, vt = np.linalg.svd(F, full_matrices=False)
    kept = s > UNTOLD**0.5 * s[0]
    own = sum(base.shape[1] for base in solved.bases)
    meat, variance, independent = _meat(row, solved, u[:, kept], colours)
    # Residuals are smaller than the noise by the share that the parameters have taken, and of
    # coloured noise they take as many independent readings.
    taken = own + int(np.count_nonzero(kept)) + (MEMORY if independent < 0.9 * row.readings else 0)
    scale = independent / max(independent - taken, independent / MOST_WIDENED)
    # (F'F)^-1 F' Omega F (F'F)^-1 with F = u s v'.
    root = np.linalg.cholesky(meat * scale + 1e-300 * np.eye(meat.shape[0]))
    factor = np.zeros((size.size, root.shape[1]))
    factor[told] = (vt[kept].T / s[kept]) @ root / size[told, None]
    matrix = factor @ factor.T
    loose = np.zeros(size.size, dtype=bool)
    loose[told] = np.any(np.abs(vt[~kept]) > 1e-3, axis=0)
    matrix[np.diag_indices(size.size)] += np.where(loose | ~told, np.inf, 0.0)
    freedom = max(independent - taken, LEAST_FREEDOM)
    return Covariance(
        matrix,
        factor,
        float(stdtrit(freedom, QUANTILE)),
        float(np.sqrt(variance * scale)),
        float(independent),
    )


def _taken_as_known(solved: Solved, limits: TimeLimits, size: int) -> NDArray[np.bool_]:
    """Whether each parameter is given: a fixed shape, or a lag as long as the record can tell.

    With such a lag goes a ratio of lags on its bound. Gains are then told for that lag.
    """
    low, high = limits.box(solved.kinds)
    known = np.zeros(size, dtype=bool)
    place = 0
    for index, (kind, shape) in enumerate(zip(solved.kinds, solved.shapes, strict=True)):
        here = slice(place, place + len(shape))
        place += len(shape)
        if index in limits.fixed:
            known[here] = True
        elif "log_lag" in kind.shape_names and shape[0] >= high[here][0]:
            known[here.start] = True
            if "ratio" in kind.shape_names:
                known[here.start + 1] = not low[here][1] < shape[1] < high[here][1]
    return known


def _meat(
    row: Row,
    solved: Solved,
    u: NDArray[np.float64],
    colours: Sequence[Colour | None] | None,
) -> tuple[NDArray[np.float64], float, float]:
    """Return u' Omega u, the residual's variance and its number of independent readings."""
    meat = np.zeros((u.shape[1], u.shape[1]))
    first, total, independent, used = 0, 0.0, 0.0, 0
    for segment, colour in zip(row.segments, colours or [None] * len(row.segments), strict=True):
        last = first + segment.time.size
        seen = segment.weight > 0
        left = solved.residual[first:last][seen]
        part = u[first:last][seen]
        first = last
        if not left.size:
            continue
        variance = float(left @ left) / left.size
        own, longrun = _by_autoregression(left, part)
        if colour is not None:
            # An autoregression is too short for a slow disturbance below white noise.
            keep = math.exp(-float(np.median(np.diff(segment.time))) / colour.memory)
            other = _by_colour(variance, colour.share, keep, part)
            if np.trace(other[0]) > np.trace(own):
                own, longrun = other
        meat += own
        share = variance / longrun if longrun > 0 else 1.0
        independent += left.size * min(share, 1.0)
        total += variance * left.size
        used += left.size
    return meat, total / max(used, 1), independent


def _by_autoregression(
    left: NDArray[np.float64], part: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return part' Omega part, and k times the variance of the mean of k readings."""
    model, innovation = autoregression(left)
    filtered = backwards(model, part)
    # Of white noise through 1/A the mean of k readings has the variance innovation/A(1)^2/k.
    return innovation * filtered.T @ filtered, innovation / max(float(np.sum(model)) ** 2, 1e-12)


def _by_colour(
    variance: float, share: float, keep: float, part: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the same of a disturbance with the correlation keep^|k - l|, and white noise."""
    slow = variance / (1 + share)
    later = part.T @ backwards(np.array([1.0, -keep]), part)[::-1]
    within = part.T @ part
    return (
        slow * (later + later.T + (share - 1) * within),
        slow * ((1 + keep) / (1 - keep) + share),
    )


def backwards(model: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the columns through 1/A(z), filtered backwards in time (and turned round)."""
    # The recursion is a triangular system with few bands; scipy.signal would bring scipy.stats,
    # together 25 MB, into every process that computes.
    length = len(columns)
    bands = np.repeat(np.asarray(model)[:length, None], length, axis=1)
    filtered, _ = dtbtrs(bands, columns[::-1], uplo="L", diag="U")
    return np.asarray(filtered).reshape(columns.shape)


def autoregression(left: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return [1, a1, ..., ap] and the innovations' variance; p by the criterion of Schwarz.

    Yule and Walker's equations, so the model is stable.
    """
    size = left.size
    centred = left
    power = float(centred @ centred) / size
    if power == 0:
        return np.ones(1), 0.0
    most = min(LONGEST_MEMORY, size // 10)
    lags = np.array([float(centred[k:] @ centred[: size - k]) / size for k in range(most + 1)])
    best = (size * np.log(power), np.ones(1), power)
    for order in range(1, most + 1):
        try:
            weights = solve_toeplitz(lags[:order], lags[1 : order + 1])
        except LinAlgError:  # a residual that repeats itself exactly
            break
        innovation = float(lags[0] - weights @ lags[1 : order + 1])
        if not innovation > 0:
            break
        score = size * np.log(innovation) + order * np.log(size)
        if score < best[0]:
            best = (score, np.r_[1.0, -weights], innovation)
    return best[1], best[2]
