"""A controller with the symmetry of parallel units: one part on their sum, one on differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.state_space import StateSpace
from solver.model.validation import instance

__all__ = ["ModeController"]


@dataclass(frozen=True)
class ModeController:
    """A parallel controller: one on the sum of all units, one on their differences.

    u = c_d (e - mean(e)) + c_s mean(e): c_s acts on the mean, c_d on what remains.

    Parameters
    ----------
    total, difference : StateSpace
        c_s and c_d, one input and one output each.

    """

    total: StateSpace
    difference: StateSpace

    def __post_init__(self) -> None:
        for name in ("total", "difference"):
            instance(getattr(self, name), StateSpace, f"/{name}")
            if getattr(self, name).D.shape != (1, 1):
                message = "a mode controller has one input and one output"
                raise InvalidInputError(message, f"/{name}")

    def full(self, n: int) -> StateSpace:
        """Return the n x n controller."""
        mean = np.full((n, 1), 1 / n)
        rest = np.linalg.svd(np.eye(n) - 1 / n)[0][:, : n - 1]  # orthonormal, of zero mean
        total = StateSpace(
            self.total.A,
            self.total.B @ mean.T,
            np.ones((n, 1)) @ self.total.C,
            np.ones((n, 1)) @ self.total.D @ mean.T,
        )
        if n == 1:
            return total
        each = np.eye(n - 1)
        d = self.difference
        difference = StateSpace(
            np.kron(each, d.A),
            np.kron(each, d.B) @ rest.T,
            rest @ np.kron(each, d.C),
            rest @ np.kron(each, d.D) @ rest.T,
        )
        return total.beside(difference)
