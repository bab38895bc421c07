"""Linear combinations of transfer functions: what a decoupled process is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from solver.model.transfer_function import TransferFunction

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
