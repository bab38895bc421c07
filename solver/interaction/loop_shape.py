"""The loop of a process and a PI controller at all frequencies: stability, peaks, limits of k_I.

The frequency response is sampled so densely that no turn of the Nyquist curve is missed, and
whatever is read off the samples is refined between them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.sampling import local_minima, refine_minima, sample, turns
from solver.model.errors import InvalidInputError
from solver.model.peaks import Peak
from solver.model.validation import real, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from solver.interaction.weighted_sum import WeightedSum

    _Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]
    _Ends = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]

__all__ = ["LoopShape", "RobustnessLimits"]


@dataclass(frozen=True)
class RobustnessLimits:
    """Greatest permitted peaks, both above 1.

    `max_sensitivity` of |S| (M_s), `max_complementary` of |T| (M_t, M_p in the book).
    """

    max_sensitivity: float = 1.6
    max_complementary: float = 1.6

    def __post_init__(self) -> None:
        for name in ("max_sensitivity", "max_complementary"):
            settle(self, **{name: real(getattr(self, name), f"/{name}")})
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
        return cls(process, *sample(process))

    def is_stable(self, proportional: float, integral: float) -> bool:
        """Whether the closed loop with c = k + k_I/s, k_I > 0, is stable.

        (1 + q c) s/(s + 1) has no pole in the right half plane, so the closed loop is stable
        when its argument returns to zero. A curve that the samples do not resolve is unstable:
        it turns fast where the loop gain is high.
        """
        F = 1 + self.response * (proportional - 1j * integral / self.omega)
        middle = self.omega[len(self.omega) // 2]
        F = F * (1j * self.omega / (1j * self.omega + middle))
        arguments = np.angle(F)
        steps = turns(arguments)
        if float(np.max(np.abs(steps))) > 2.5:
            return False
        turn = float(arguments[0] + np.sum(steps))
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
            dips = local_minima(gap.above(lower), 1.05 * gap.end)
            end = self._refined(dips, partial(_above, gap, ends))
            if gap.start < 0.9 * gap.end:
                return end  # samples err by far less: the gap stays open
            tops = local_minima(-gap.below(upper), -0.95 * gap.start)
            start = -self._refined(tops, partial(_below, gap, ends))
            if start < end:
                return end
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
        tops = local_minima(-samples, -0.95 * float(np.max(samples)))
        omega, values = refine_minima(negative, self.omega, tops)
        best = int(np.argmin(values))
        return Peak(float(-values[best]), float(omega[best]))

    def _refined(self, indices: NDArray[np.intp], function: _Function) -> float:
        return float(np.min(refine_minima(function, self.omega, indices)[1], initial=math.inf))


@dataclass(frozen=True)
class _Gap:
    """Integral gains between two forbidden intervals."""

    start: float
    end: float

    def above(self, lower: NDArray[np.float64]) -> NDArray[np.float64]:
        """Least lower end (2, ...) of the constraints above the gap; NaN where there is none."""
        ends = np.fmin.reduce(np.where(lower > self.start, lower, np.nan))
        return np.asarray(ends, dtype=np.float64)

    def below(self, upper: NDArray[np.float64]) -> NDArray[np.float64]:
        """Greatest upper end (2, ...) of the constraints below the gap; NaN where none."""
        ends = np.fmax.reduce(np.where(upper < self.end, upper, np.nan))
        return np.asarray(ends, dtype=np.float64)


def _above(gap: _Gap, ends: _Ends, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    return gap.above(ends(omega)[0])


def _below(gap: _Gap, ends: _Ends, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    return -gap.below(ends(omega)[1])


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


def _gaps(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> list[_Gap]:
    """Return the positive numbers outside all intervals, as gaps from the top down."""
    present = upper > 0
    low, high = lower[present], upper[present]
    order = np.argsort(low)
    starts = np.append(0.0, np.maximum.accumulate(high[order]))
    ends = np.append(low[order], math.inf)
    # Narrower gaps are left by the distance between samples.
    found = np.flatnonzero(ends > 1.001 * starts)[::-1]
    return [_Gap(float(starts[index]), float(ends[index])) for index in found]
