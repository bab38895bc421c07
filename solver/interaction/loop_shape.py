"""The loop of a process and a PI controller at all frequencies: stability, peaks, limits of k_I.

The frequency response is sampled so densely that no turn of the Nyquist curve is missed, and
whatever is read off the samples is refined between them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import InvalidInputError
from solver.frequencies import corners_of, resonances_of
from solver.results import Peak

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from solver.interaction.weighted_sum import WeightedSum
    from solver.transfer_function import TransferFunction

    _Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]

__all__ = ["LoopShape", "RobustnessLimits", "dense_frequencies", "refine_minima"]

_POINTS = 1000  # even in logarithm
_DECADES = 3  # beyond the corners on both sides
_DEAD_TIME_STEP = 0.1  # rad of the longest dead time between samples ...
_DEAD_TIME_POINTS = 3000  # ... for that many samples: 300 rad
_STEP = 0.1  # relative change of the process between samples
_SMALL = 1e-3  # relative size of the process below which larger changes are let pass
_HALVINGS = 12
_MAX_POINTS = 8000


@dataclass(frozen=True)
class RobustnessLimits:
    """Greatest permitted peaks of |S| (M_s) and |T| (M_t, M_p in the book), both above 1."""

    max_sensitivity: float = 1.6
    max_complementary: float = 1.6

    def __post_init__(self) -> None:
        for name in ("max_sensitivity", "max_complementary"):
            if not 1 < getattr(self, name) <= 1e3:
                message = "a permitted peak lies above 1 and at most at 1000"
                raise InvalidInputError(message, f"/{name}")


@dataclass(frozen=True)
class LoopShape:
    """A stable process q(s) with positive static gain, sampled.

    Attributes
    ----------
    process : WeightedSum
        q(s).
    omega : (k,)
        Frequencies, rad per time unit, ascending.
    response : (k,) complex
        q(j omega).

    """

    process: WeightedSum
    omega: NDArray[np.float64]
    response: NDArray[np.complex128]

    @classmethod
    def of(cls, process: WeightedSum) -> LoopShape:
        """Sample the process."""
        omega = dense_frequencies(process.active_terms)
        response = process.response(omega)
        for _ in range(_HALVINGS):
            change = np.abs(np.diff(response))
            size = np.maximum(np.abs(response[1:]), np.abs(response[:-1]))
            # Far above the resonances only dead time turns: sampled evenly already.
            coarse = np.flatnonzero((change > _STEP * size) & (size > _SMALL * np.max(size)))
            if not coarse.size or omega.size > _MAX_POINTS:
                break
            middle = np.sqrt(omega[coarse] * omega[coarse + 1])
            omega = np.insert(omega, coarse + 1, middle)
            response = np.insert(response, coarse + 1, process.response(middle))
        return cls(process, omega, response)

    def is_stable(self, proportional: float, integral: float) -> bool:
        """Whether the closed loop with c = k + k_I/s, k_I > 0, is stable.

        (1 + q c) s/(s + 1) has no pole in the right half plane, so the closed loop is stable
        when its argument returns to zero. A curve that the samples do not resolve is unstable:
        it turns fast where the loop gain is high.
        """
        F = 1 + self.response * (proportional - 1j * integral / self.omega)
        middle = self.omega[len(self.omega) // 2]
        F = F * (1j * self.omega / (1j * self.omega + middle))
        steps = np.angle(F[1:] * F[:-1].conj())
        if float(np.max(np.abs(steps))) > 2.5:
            return False
        turn = float(np.angle(F[0])) + float(np.sum(steps))
        return round(turn / math.pi) == 0

    def sampled_peaks(self, proportional: float, integral: float) -> tuple[float, float]:
        """Return the peaks of |S| and |T| over the samples, at least 1."""
        L = self.response * (proportional - 1j * integral / self.omega)
        S = 1 / np.abs(1 + L)
        return max(float(np.max(S)), 1.0), max(float(np.max(np.abs(L) * S)), 1.0)

    def peaks(self, proportional: float, integral: float) -> tuple[Peak, Peak]:
        """Return the peaks of |S| and |T|, refined; at least 1 (at infinity, at zero)."""

        def both(omega: NDArray[np.float64]) -> NDArray[np.float64]:
            L = self._response(omega) * (proportional - 1j * integral / omega)
            return np.asarray(np.abs(np.stack([1 / (1 + L), L / (1 + L)])), dtype=np.float64)

        samples = both(self.omega)
        sensitivity = self._peak(samples[0], lambda omega: -both(omega)[0])
        complementary = self._peak(samples[1], lambda omega: -both(omega)[1])
        if sensitivity.value < 1:
            sensitivity = Peak(1.0, math.inf)
        if complementary.value < 1:
            complementary = Peak(1.0, 0.0)
        return sensitivity, complementary

    def sampled_limit(self, proportional: float, limits: RobustnessLimits) -> float:
        """Return the greatest k_I within the limits at the samples; 0: none, infinite: no end."""
        forbidden = _forbidden(self.response, self.omega, proportional, limits)
        return next((gap.end for gap in self._stable_gaps(proportional, *forbidden)), 0.0)

    def limit(self, proportional: float, limits: RobustnessLimits) -> float:
        """Return the greatest k_I within the limits, refined between the samples.

        The gaps between the forbidden intervals are tried from the top; the first stable one
        that stays open between the samples holds the answer at its upper end.
        """

        def ends(omega: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            return _forbidden(self._response(omega), omega, proportional, limits)

        lower, upper = _forbidden(self.response, self.omega, proportional, limits)
        for gap in self._stable_gaps(proportional, lower, upper):
            if math.isinf(gap.end):
                return math.inf
            start, end = gap.start, gap.end
            for index in range(2):
                dips = _local_minima(lower[index], 1.05 * gap.end, gap.start)
                end = min(end, *self._refined(dips, _component(ends, 0, index, 1.0)))
                if start < 0.9 * gap.end:
                    continue  # samples err by far less: the gap stays open
                tops = _local_minima(-upper[index], -0.95 * gap.start, -gap.end)
                start = max(start, *(-self._refined(tops, _component(ends, 1, index, -1.0))))
            if start < end:
                return float(end)
        return 0.0

    def _stable_gaps(
        self, proportional: float, lower: NDArray[np.float64], upper: NDArray[np.float64]
    ) -> Iterator[_Gap]:
        for gap in _gaps(lower, upper):
            if math.isfinite(gap.end):
                inside = (gap.start + gap.end) / 2
            else:
                inside = 2 * gap.start + float(self.omega[0])
            if self.is_stable(proportional, inside):
                yield gap

    def _response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return self.process.response(omega.ravel()).reshape(omega.shape)

    def _peak(self, samples: NDArray[np.float64], negative: _Function) -> Peak:
        tops = _local_minima(-samples, -0.95 * float(np.max(samples)))
        omega, values = refine_minima(negative, self.omega, tops)
        best = int(np.argmin(values))
        return Peak(float(-values[best]), float(omega[best]))

    def _refined(self, indices: NDArray[np.intp], function: _Function) -> NDArray[np.float64]:
        """Return the refined minima, and infinity so that there is always one value."""
        return np.append(refine_minima(function, self.omega, indices)[1], math.inf)


@dataclass(frozen=True)
class _Gap:
    """Integral gains between two forbidden intervals."""

    start: float
    end: float


def dense_frequencies(terms: Iterable[TransferFunction]) -> NDArray[np.float64]:
    """Return frequencies (rad per time unit) that resolve every corner, resonance and dead time.

    Even in logarithm from three decades below the lowest to three above the highest corner,
    finer around lightly damped poles and zeros, and evenly spaced as far as dead time turns.
    """
    elements = tuple(terms)
    bends = corners_of(elements)
    low, high = float(bends[0]) / 10**_DECADES, float(bends[-1]) * 10**_DECADES
    parts = [np.geomspace(low, high, _POINTS), resonances_of(elements)]
    longest = max((element.dead_time for element in elements), default=0.0)
    if longest:
        parts.append(_DEAD_TIME_STEP / longest * np.arange(1, _DEAD_TIME_POINTS))
    merged = np.unique(np.concatenate(parts))
    return np.asarray(merged[merged > 0], dtype=np.float64)


def _forbidden(
    q: NDArray[np.complex128],
    omega: NDArray[np.float64],
    proportional: float,
    limits: RobustnessLimits,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the intervals of k_I forbidden by |S| <= M_s and |T| <= M_t at each frequency.

    With x = k_I/omega,

        |1 + q c|^2 = |1 + k q|^2 + 2 x Im q + x^2 |q|^2,   |q c|^2 = (k^2 + x^2) |q|^2,

    so both conditions, |1 + q c|^2 >= 1/M_s^2 and M_t^2 |1 + q c|^2 >= |q c|^2, are quadratics.

    Returns
    -------
    lower, upper : (2, ...) real
        Ends for the two constraints; NaN where nothing is forbidden.

    """
    square = np.abs(q) ** 2
    fixed = 1 + 2 * proportional * q.real + proportional**2 * square
    Mt2 = limits.max_complementary**2
    a = np.stack([square, (Mt2 - 1) * square])
    half_b = np.stack([q.imag, Mt2 * q.imag])
    c = np.stack([fixed - limits.max_sensitivity**-2, Mt2 * fixed - proportional**2 * square])
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(half_b**2 - a * c)
        # The root of larger magnitude first, the other one from the product: no cancellation.
        large = -half_b - np.copysign(root, half_b)
        first, second = large / a * omega, c / large * omega
    return np.minimum(first, second), np.maximum(first, second)


def _component(
    ends: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    side: int,
    constraint: int,
    sign: float,
) -> _Function:
    """Return one end of the interval of one constraint as a function to be minimised."""
    return lambda omega: sign * ends(omega)[side][constraint]


def _gaps(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> list[_Gap]:
    """Return the positive numbers outside all intervals, as gaps from the top down."""
    present = upper > 0
    low, high = lower[present], upper[present]
    order = np.argsort(low)
    starts = np.append(0.0, np.maximum.accumulate(high[order]))
    ends = np.append(low[order], math.inf)
    found = np.flatnonzero(ends > starts)[::-1]
    return [_Gap(float(starts[index]), float(ends[index])) for index in found]


def _local_minima(
    values: NDArray[np.float64], at_most: float, above: float = -math.inf
) -> NDArray[np.intp]:
    """Return indices of local minima with above < value <= at_most; NaN counts as infinite."""
    padded = np.concatenate([[math.inf], np.where(np.isnan(values), math.inf, values), [math.inf]])
    inner = padded[1:-1]
    lowest = (inner <= padded[:-2]) & (inner <= padded[2:])
    return np.flatnonzero(lowest & (inner <= at_most) & (inner > above))


def refine_minima(
    function: _Function, omega: NDArray[np.float64], indices: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Refine minima between samples by parabolas in log omega; NaN counts as infinite.

    Parameters
    ----------
    function : callable
        Values at frequencies, any shape.
    omega : (k,)
        The samples, rad per time unit, ascending.
    indices : (m,)
        Samples at which the function has local minima.

    Returns
    -------
    omega, values : (m,)
        Refined places and values.

    """
    t = np.log(omega[indices])
    log_omega = np.log(omega)
    left = t - log_omega[np.maximum(indices - 1, 0)]
    right = log_omega[np.minimum(indices + 1, omega.size - 1)] - t
    step = np.maximum(left, right)
    best_t, best = t, np.full(t.shape, math.inf)
    for _ in range(3):
        points = best_t + step * np.array([[-1.0], [0.0], [1.0]])
        values = function(np.exp(points))
        with np.errstate(invalid="ignore", divide="ignore"):
            curvature = values[0] - 2 * values[1] + values[2]
            shift = 0.5 * (values[0] - values[2]) / curvature
        vertex = best_t + step * np.where(curvature > 0, np.clip(shift, -1, 1), 0.0)
        points = np.concatenate([points, vertex[None, :]])
        values = np.concatenate([values, function(np.exp(vertex[None, :]))])
        values = np.where(np.isnan(values), math.inf, values)
        choice = np.argmin(values, axis=0)
        columns = np.arange(choice.size)
        better = values[choice, columns] < best
        best_t = np.where(better, points[choice, columns], best_t)
        best = np.where(better, values[choice, columns], best)
        step = step / 15
    return np.exp(best_t), best
