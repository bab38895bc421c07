"""Closed loops around a statically decoupled plant, interaction included.

With Q = P D and diagonal C, C_bar: Y = H_bar Y_sp, H_bar = (I + Q C)^-1 Q C_bar. The
approximation H neglects products of off-diagonal elements: h_ij = q_ij c_bar_j/(1 + q_ii c_i)
(Astrom and Hagglund, section 11.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.sampling import turns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import ParallelForm
    from solver.model.plants import Plant

__all__ = ["DecoupledLoops"]


@dataclass(frozen=True)
class DecoupledLoops:
    """A stable plant behind a static decoupler, under PI controllers with set-point weights.

    Attributes
    ----------
    plant : Plant
        P(s), n x n.
    decoupler : (n, n)
        D = P(0)^-1.
    gains : tuple of ParallelForm
        PI settings, one a loop, with positive integral gains.
    weights : tuple of float
        Set-point weights b, one a loop.

    """

    plant: Plant
    decoupler: NDArray[np.float64]
    gains: tuple[ParallelForm, ...]
    weights: tuple[float, ...]

    def approximate(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return H at `omega` (k,) rad per time unit, (k, n, n)."""
        Q = self._process(omega)
        own = np.diagonal(Q, axis1=1, axis2=2)
        single = 1 + own * self._feedback(omega)
        result = Q * self._set_point(omega)[:, None, :] / single[:, :, None]
        return np.asarray(result, dtype=np.complex128)

    def exact(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return H_bar at `omega` (k,) rad per time unit, (k, n, n)."""
        Q = self._process(omega)
        identity = np.eye(self.plant.n)
        result = np.linalg.solve(
            identity + Q * self._feedback(omega)[:, None, :],
            Q * self._set_point(omega)[:, None, :],
        )
        return np.asarray(result, dtype=np.complex128)

    def is_stable(self, omega: NDArray[np.float64]) -> bool:
        """Whether the loops are stable together, from samples (k,) that resolve the plant.

        det(I + Q C) (s/(s + m))^n has no pole in the right half plane and is positive at s = 0,
        so the loops are stable when its argument returns to zero.
        """
        C = self._feedback(omega)
        middle = omega[omega.size // 2]
        wash = 1j * omega / (1j * omega + middle)
        F = np.linalg.det(np.eye(self.plant.n) + self._process(omega) * C[:, None, :])
        F = F * wash**self.plant.n
        # At the lowest frequency Q is nearly the identity: the argument is that of its loops.
        loops = (1 + C[0]) * wash[0]
        start = float(np.sum(np.angle(loops)) + np.angle(F[0] / np.prod(loops)))
        turn = start + float(np.sum(turns(np.angle(F))))
        return round(turn / math.pi) == 0

    def _process(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.asarray(self.plant.response(omega) @ self.decoupler, dtype=np.complex128)

    def _feedback(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return _pi(omega, self.gains, [1.0] * len(self.gains))

    def _set_point(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return _pi(omega, self.gains, self.weights)


def _pi(
    omega: NDArray[np.float64], gains: Sequence[ParallelForm], weights: Sequence[float]
) -> NDArray[np.complex128]:
    """Responses b k + k_I/s, (k, n)."""
    k = np.array([b * g.proportional_gain for g, b in zip(gains, weights, strict=True)])
    k_I = np.array([g.integral_gain for g in gains])
    return np.asarray(k - 1j * k_I / omega[:, None], dtype=np.complex128)
