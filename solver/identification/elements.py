"""Elements of a plant that a record can be fitted with: lags, integrators, their dead times.

A second-order element has the denominator (r/4) b^2 s^2 + b s + 1: b is the sum of its time
constants, r = 0 one lag, r = 1 two equal ones, r > 1 a damping ratio of 1/sqrt(r). So the orders
are nested and nothing is singular where two lags meet. Gains enter linearly, b by its logarithm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.identification import held_input
from solver.model.transfer_function import LARGEST, TransferFunction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "HIGHEST_RATIO",
    "LOWEST_RATIO",
    "Element",
    "ElementKind",
    "free_motions",
    "frequency_responses",
    "responses",
]

LOWEST_RATIO = 1e-3  # below, the second lag is a 4000th of the first: one lag
HIGHEST_RATIO = 6.25  # damping ratio 0.4: process elements ring no more


class ElementKind(StrEnum):
    """Form of an element, its dead time aside."""

    NONE = "none"
    FIRST = "first"
    SECOND = "second"
    SECOND_ZERO = "second with zero"
    RESONANT = "resonant"
    INTEGRATOR = "integrator"
    INTEGRATOR_LAG = "integrator with lag"
    INTEGRATOR_ZERO = "integrator with lag and zero"

    @property
    def integrating(self) -> bool:
        """Whether it has a pole at s = 0."""
        return self.value.startswith("integrator")

    @property
    def shape_names(self) -> tuple[str, ...]:
        """Names of the parameters that enter nonlinearly, in order."""
        return _SHAPES[self]

    @property
    def motions(self) -> int:
        """Number of free motions beside a constant."""
        return _MOTIONS.get(self, 1)

    @property
    def gains(self) -> int:
        """Number of parameters that enter linearly."""
        return _GAINS[self]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.shape_names) + self.gains


_SHAPES: dict[ElementKind, tuple[str, ...]] = {
    ElementKind.NONE: (),
    ElementKind.FIRST: ("log_lag", "dead_time"),
    ElementKind.SECOND: ("log_lag", "ratio", "dead_time"),
    ElementKind.SECOND_ZERO: ("log_lag", "ratio", "dead_time"),
    ElementKind.RESONANT: ("log_lag", "ratio", "dead_time"),
    ElementKind.INTEGRATOR: ("dead_time",),
    ElementKind.INTEGRATOR_LAG: ("log_lag", "dead_time"),
    ElementKind.INTEGRATOR_ZERO: ("log_lag", "dead_time"),
}
_GAINS = {
    ElementKind.NONE: 0,
    ElementKind.FIRST: 1,
    ElementKind.SECOND: 1,
    ElementKind.SECOND_ZERO: 2,
    ElementKind.RESONANT: 1,
    ElementKind.INTEGRATOR: 1,
    ElementKind.INTEGRATOR_LAG: 1,
    ElementKind.INTEGRATOR_ZERO: 2,
}
_MOTIONS = {
    ElementKind.NONE: 0,
    ElementKind.INTEGRATOR: 0,
    ElementKind.SECOND: 2,
    ElementKind.SECOND_ZERO: 2,
    ElementKind.RESONANT: 2,
}


@dataclass(frozen=True)
class Element:
    """An element with numbers.

    Parameters
    ----------
    kind : ElementKind
        Its form.
    shape : tuple of float
        The nonlinear parameters that `ElementKind.shape_names` lists.
    gains : tuple of float
        Coefficients of the numerator, constant first.

    """

    kind: ElementKind
    shape: tuple[float, ...] = ()
    gains: tuple[float, ...] = ()

    @property
    def dead_time(self) -> float:
        """Dead time; 0 without element."""
        return self.shape[-1] if self.shape else 0.0

    @property
    def lag(self) -> float:
        """Sum of the time constants; 0 for an integrator alone."""
        return math.exp(self.shape[0]) if "log_lag" in self.kind.shape_names else 0.0

    def transfer_function(self) -> TransferFunction:
        """Return the element as a transfer function."""
        if not any(self.gains):
            return TransferFunction((0.0,), (1.0,))
        b = self.lag
        match self.kind:
            case ElementKind.FIRST:
                den = [b, 1.0]
            case ElementKind.SECOND | ElementKind.SECOND_ZERO | ElementKind.RESONANT:
                den = [self.shape[1] / 4 * b * b, b, 1.0]
            case ElementKind.INTEGRATOR:
                den = [1.0, 0.0]
            case _:
                den = [b, 1.0, 0.0]
        num = [float(gain) for gain in np.trim_zeros(self.gains[::-1], "f")]
        if max(den) > LARGEST:  # times in small units: the square of a lag is too large to write
            num, den = [v / b for v in num], [v / b for v in den]
        return TransferFunction(num, den, self.dead_time)


def responses(
    kind: ElementKind,
    shape: Sequence[float],
    time: NDArray[np.float64],
    at: NDArray[np.float64],
    level: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the response for each unit gain, (k, gains), to an input from rest.

    Parameters
    ----------
    kind, shape
        As of `Element`.
    time : (k,) ndarray
        Increasing, from 0 on.
    at, level : (c,) ndarray
        When the input changes, and its values from then on.

    """
    out = np.empty((kind.gains, time.size))
    if kind is ElementKind.NONE:
        return out.T
    delay = shape[-1]
    b = math.exp(shape[0]) if "log_lag" in kind.shape_names else 0.0
    if kind is ElementKind.FIRST:
        held_input.lag(time, at, level, b, delay, out[0])
    elif kind is ElementKind.INTEGRATOR:
        held_input.integral(time, at, level, delay, out[0])
    elif kind.integrating:  # 1/(s (b s + 1)) = 1/s - b/(b s + 1)
        lagged = np.empty(time.size)
        held_input.lag(time, at, level, b, delay, lagged)
        held_input.integral(time, at, level, delay, out[0])
        out[0] -= b * lagged
        if kind is ElementKind.INTEGRATOR_ZERO:
            out[1] = lagged
    else:
        slope = np.empty(time.size)
        held_input.pair(time, at, level, shape[1] / 4 * b * b, b, delay, out[0], slope)
        if kind is ElementKind.SECOND_ZERO:
            out[1] = slope
    return out.T


def free_motions(
    kind: ElementKind, shape: Sequence[float], time: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return what the element can do without input, its resting state aside; (k,) each."""
    if kind in {ElementKind.NONE, ElementKind.INTEGRATOR}:
        return []
    b = math.exp(shape[0])
    if "ratio" in kind.shape_names:
        first, second = np.empty(time.size), np.empty(time.size)
        held_input.free(time, shape[1] / 4 * b * b, b, first, second)
        return [first, second]
    return [np.exp(-time / b)]


def frequency_responses(
    kind: ElementKind,
    shapes: NDArray[np.float64],
    gains: NDArray[np.float64],
    omega: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Return the responses of many elements of one form, (d, k) complex.

    Parameters
    ----------
    kind : ElementKind
        Their form.
    shapes : (d, s) ndarray
        Of each element.
    gains : (d, g) ndarray
        Of each element.
    omega : (k,) ndarray
        rad per time unit.

    """
    s = 1j * omega[None, :]
    if kind is ElementKind.NONE:
        return np.zeros((len(shapes), omega.size), dtype=complex)
    num = gains[:, :1] + (gains[:, 1:2] * s if kind.gains > 1 else 0.0)
    den = s if kind.integrating else np.ones_like(s)
    if "log_lag" in kind.shape_names:
        b = np.exp(shapes[:, :1])
        if "ratio" in kind.shape_names:
            den = den * (shapes[:, 1:2] / 4 * (b * s) ** 2 + b * s + 1)
        else:
            den = den * (b * s + 1)
    return np.asarray(num / den * np.exp(-shapes[:, -1:] * s))
