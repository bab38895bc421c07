"""PI settings with the greatest integral gain that given robustness permits.

For a stable process q(s) and c(s) = k + k_I/s:

    maximise k_I   subject to   |S(jw)| <= M_s,  |T(jw)| <= M_t  for all w,  closed loop stable,

with S = 1/(1 + q c), T = 1 - S. The integrated error after a load step is 1/k_I. Astrom and
Hagglund, chapter 11.3 (their M_p is M_t); the geometry below is that of Astrom, Panagopoulos and
Hagglund (1998): for each frequency and each k, a constraint forbids one interval of k_I, whose
ends are the roots of a quadratic. So for each k the permitted set is known exactly (up to the
frequency grid, refined where it matters), and what is left is a search over k alone. Between
forbidden intervals the curve 1 + q c does not meet the origin, so each gap is stable or unstable
as a whole; no convexity is assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.loop_shape import LoopShape, RobustnessLimits
from solver.interaction.weighted_sum import WeightedSum
from solver.model.controllers import ParallelForm
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.peaks import Peak

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["DesignStatus", "LoopDesigner", "PIDesign", "RobustnessLimits", "design_pi"]

# Proportional gains tried first, in units of 1/q(0). Below -10 a loop could be stable only if
# the process led in phase by 90 degrees and more where its gain is that of steady state.
_GAINS = np.concatenate([-np.geomspace(1e-3, 10, 41)[::-1], [0.0], np.geomspace(1e-3, 1e6, 91)])
_FLAT = 1e-9  # excess of a peak over 1 that is rounding


class DesignStatus(StrEnum):
    """How a design ended, and what to try next.

    OPTIMAL: the greatest integral gain within the limits. DETUNED: less was asked for; the
    proportional gain is the one with the lowest peaks. UNBOUNDED: no finite optimum, because the
    model has no dead time, high order or right-half-plane zero that would set one; add what it
    neglects, or give a limit. GIVEN: the caller's own settings, analysed as they are.
    """

    OPTIMAL = "optimal"
    DETUNED = "detuned"
    UNBOUNDED = "unbounded"
    GIVEN = "given"


@dataclass(frozen=True)
class PIDesign:
    """Settings c(s) = k + k_I/s and the peaks that they reach.

    `gains`, `sensitivity` (peak of |S|) and `complementary` (peak of |T|) are None where the
    status is UNBOUNDED, the peaks also where given settings make the loop unstable. Peaks of
    exactly 1 are reached at infinite or zero frequency. `greatest_integral_gain` is the optimum
    without a limit on it; None where it is unbounded.
    """

    status: DesignStatus
    gains: ParallelForm | None
    sensitivity: Peak | None
    complementary: Peak | None
    greatest_integral_gain: float | None


def design_pi(
    process: WeightedSum, limits: RobustnessLimits, integral_gain_limit: float = math.inf
) -> PIDesign:
    """Return the PI settings with the greatest integral gain within the limits.

    See `LoopDesigner`, which takes the same arguments and raises the same errors.
    """
    return LoopDesigner(process, limits).design(integral_gain_limit)


class LoopDesigner:
    """Designs of one loop for several limits of its integral gain.

    Parameters
    ----------
    process : WeightedSum
        q(s), stable, static gain not zero.
    limits : RobustnessLimits
        Permitted peaks.

    Raises
    ------
    UnsupportedPlantError
        An unstable or integrating process.
    InvalidInputError
        A static gain of zero.

    """

    def __init__(self, process: WeightedSum, limits: RobustnessLimits) -> None:
        self.process = process
        if any(np.any(term.poles.real >= 0) for term in process.active_terms):
            message = "the design is for stable processes; this one integrates or is unstable"
            raise UnsupportedPlantError(message)
        gain = process.static_gain
        if gain == 0:
            message = "the static gain is zero: integral action is impossible"
            raise InvalidInputError(message)
        # Turned, the process has a positive static gain; settings are turned back at the end.
        self._sign = math.copysign(1.0, gain)
        turned = tuple(self._sign * weight for weight in process.weights)
        self._shape = LoopShape.of(WeightedSum(turned, process.terms))
        self._limits = limits
        self._candidates = _GAINS / abs(gain)

    @cached_property
    def _best(self) -> tuple[float, float] | None:
        return _greatest_integral_gain(self._shape, self._limits, self._candidates)

    def design(self, integral_gain_limit: float = math.inf) -> PIDesign:
        """Return the settings with the greatest integral gain within the limits.

        With `integral_gain_limit` below that optimum the integral gain is set to the limit and the
        proportional gain is the one that makes the larger of the two peaks, each measured from 1
        to its limit, as low as possible; of several that keep both at 1, the smallest. As the
        limit rises this joins the optimum continuously.

        Parameters
        ----------
        integral_gain_limit : float
            Greatest magnitude of the integral gain, > 0.

        """
        best = self._best
        if best is not None and best[1] <= integral_gain_limit:
            return self._designed(DesignStatus.OPTIMAL, *best)
        detuned = _lowest_peaks(self._shape, self._limits, self._candidates, integral_gain_limit)
        if detuned is None:
            return PIDesign(DesignStatus.UNBOUNDED, None, None, None, None)
        return self._designed(DesignStatus.DETUNED, detuned, integral_gain_limit)

    def given(self, gains: ParallelForm) -> PIDesign:
        """Return the caller's own settings with the peaks that they reach.

        Raises
        ------
        InvalidInputError
            An integral gain that is zero or has not the sign of the process.

        """
        integral = self._sign * gains.integral_gain
        if integral <= 0:
            message = "the integral gain must have the sign of the process, and not be zero"
            raise InvalidInputError(message, "/integral_gain")
        proportional = self._sign * gains.proportional_gain
        if not self._shape.is_stable(proportional, integral):
            return PIDesign(DesignStatus.GIVEN, gains, None, None, self._greatest)
        return self._designed(DesignStatus.GIVEN, proportional, integral)

    @property
    def _greatest(self) -> float | None:
        return None if self._best is None else self._sign * self._best[1]

    def _designed(self, status: DesignStatus, proportional: float, integral: float) -> PIDesign:
        sensitivity, complementary = self._shape.peaks(proportional, integral)
        return PIDesign(
            status=status,
            gains=ParallelForm(self._sign * proportional, self._sign * integral),
            sensitivity=sensitivity,
            complementary=complementary,
            greatest_integral_gain=self._greatest,
        )


def _greatest_integral_gain(
    shape: LoopShape, limits: RobustnessLimits, candidates: NDArray[np.float64]
) -> tuple[float, float] | None:
    """Return (k, k_I) of the global optimum; None where there is no finite one."""
    values = np.array([shape.sampled_limit(k, limits) for k in candidates])
    if np.any(np.isinf(values)) or int(np.argmax(values)) in {0, len(values) - 1}:
        return None
    best = _search(lambda k: -shape.limit(k, limits), candidates, -values)
    return best[0], -best[1]


def _lowest_peaks(
    shape: LoopShape, limits: RobustnessLimits, candidates: NDArray[np.float64], integral: float
) -> float | None:
    """Return the k with the lowest peaks for the given k_I; None where none is within limits."""
    if math.isinf(integral):
        return None

    def excess(sensitivity: float, complementary: float) -> float:
        """Return the larger peak, 0 for a peak of 1 and 1 for a peak at its limit."""
        return max(
            (sensitivity - 1) / (limits.max_sensitivity - 1),
            (complementary - 1) / (limits.max_complementary - 1),
        )

    def sampled(proportional: float) -> float:
        if not shape.is_stable(proportional, integral):
            return math.inf
        return excess(*shape.sampled_peaks(proportional, integral))

    def refined(proportional: float) -> float:
        if not shape.is_stable(proportional, integral):
            return math.inf
        return excess(*(peak.value for peak in shape.peaks(proportional, integral)))

    values = np.array([sampled(k) for k in candidates])
    if not np.any(np.isfinite(values)):
        return None
    if np.min(values) > _FLAT:
        proportional, lowest = _search(refined, candidates, values)
        return proportional if lowest <= 1 else None
    # Both peaks stay at 1 from some gain on: the least such gain, by bisection.
    flat = candidates[values <= _FLAT]
    high = float(flat[int(np.argmin(np.abs(flat)))])
    nearer = candidates[np.abs(candidates) < abs(high)]
    low = float(nearer[int(np.argmin(np.abs(nearer - high)))]) if nearer.size else 0.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if sampled(middle) <= _FLAT else (middle, high)
    return high


def _search(
    exact: Callable[[float], float],
    candidates: NDArray[np.float64],
    values: NDArray[np.float64],
) -> tuple[float, float]:
    """Minimise a function from rough values: the three best dips, then golden section.

    No derivatives: the functions here have kinks.
    """
    padded = np.concatenate([[math.inf], values, [math.inf]])
    dips = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]) & (values < math.inf))
    brackets = []
    for dip in dips[np.argsort(values[dips])][:3]:
        left = candidates[max(dip - 1, 0)]
        right = candidates[min(dip + 1, len(candidates) - 1)]
        points = np.linspace(left, right, 17)
        finer = [exact(float(k)) for k in points]
        best = int(np.argmin(finer))
        bracket = float(points[max(best - 1, 0)]), float(points[min(best + 1, 16)])
        brackets.append((finer[best], bracket))
    return _golden(exact, *min(brackets)[1])


def _golden(function: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    ratio = (math.sqrt(5) - 1) / 2
    inner = [high - ratio * (high - low), low + ratio * (high - low)]
    values = [function(inner[0]), function(inner[1])]
    # 36 rounds shorten the bracket, about 2 per cent of the gain, by 3e-8.
    for _ in range(36):
        if values[0] <= values[1]:
            high, inner[1], values[1] = inner[1], inner[0], values[0]
            inner[0] = high - ratio * (high - low)
            values[0] = function(inner[0])
        else:
            low, inner[0], values[0] = inner[0], inner[1], values[1]
            inner[1] = low + ratio * (high - low)
            values[1] = function(inner[1])
    best = 0 if values[0] <= values[1] else 1
    return inner[best], values[best]
