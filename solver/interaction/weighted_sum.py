"""Linear combinations of transfer functions: what a decoupled process is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import DERIVATIVE_FILTER
from solver.model.transfer_function import TransferFunction

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["WeightedSum"]


@dataclass(frozen=True)
class WeightedSum:
    """The function sum_k weights[k] terms[k](s).

    Parameters
    ----------
    weights : tuple of float
        One a term.
    terms : tuple of TransferFunction
        At least one.

    """

    weights: tuple[float, ...]
    terms: tuple[TransferFunction, ...]

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` (rad per time unit), (k,) complex."""
        frequencies = np.atleast_1d(np.asarray(omega, dtype=float))
        total = np.zeros(frequencies.shape, dtype=complex)
        for weight, term in zip(self.weights, self.terms, strict=True):
            if weight:
                total += weight * term.response(frequencies)
        return total

    def led(self, time: float) -> WeightedSum:
        """Return the function times (1 + time s)/(1 + 0.1 time s), derivative action in series."""
        if not time:
            return self
        lead, lag = [time, 1.0], [DERIVATIVE_FILTER * time, 1.0]
        terms = [
            TransferFunction(
                np.polymul(term.num, lead).tolist(),
                np.polymul(term.den, lag).tolist(),
                term.dead_time,
            )
            for term in self.terms
        ]
        return WeightedSum(self.weights, tuple(terms))

    @property
    def static_gain(self) -> float:
        """Value at s = 0 of a function without pole there."""
        pairs = zip(self.weights, self.terms, strict=True)
        return float(sum(weight * term.static_gain for weight, term in pairs if weight))

    @property
    def active_terms(self) -> tuple[TransferFunction, ...]:
        """Terms with a weight other than zero."""
        pairs = zip(self.weights, self.terms, strict=True)
        return tuple(term for weight, term in pairs if weight and not term.is_zero)
