"""Dynamic decoupling of two loops, and what errors of the inputs do to a decoupler.

u = D(s) u_bar with D = [[1, -p_12/p_11], [-p_21/p_22, 1]] diag(1/q_1(0), 1/q_2(0)) leaves loops
that do not interact at any frequency, q_i = (p_ii - p_ij p_ji/p_jj)/q_i(0) (simplified decoupling;
Seborg, Edgar and Mellichamp, Process Dynamics and Control, section 18.4). It exists where its
elements can be built: no negative dead time, proper, no right-half-plane zero of p_ii in a
denominator.

A decoupler is an inverse and lives by it. With each input off by its own relative error of at most
delta, any phase, the loops stay stable while delta mu(T_I) < 1, T_I = K P (I + K P)^-1 at the
plant's inputs, mu for a diagonal perturbation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.weighted_sum import WeightedSum
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.transfer_function import TransferFunction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant

__all__ = ["DynamicDecoupler", "diagonal_mu"]

_SWEEPS = 10
_FARTHEST = 20.0  # logarithm of a scale: 5e8


@dataclass(frozen=True)
class DynamicDecoupler:
    """The decoupler of a plant with two loops, and the loops that it leaves.

    Attributes
    ----------
    first, second : TransferFunction
        -p_12/p_11, from u_bar_2 to u_1, and -p_21/p_22, from u_bar_1 to u_2, before their scaling.
    gains : tuple of float
        1/q_1(0) and 1/q_2(0): the loops have a static gain of 1, as behind a static decoupler.
    processes : tuple of WeightedSum
        q_1 and q_2.

    """

    first: TransferFunction
    second: TransferFunction
    gains: tuple[float, float]
    processes: tuple[WeightedSum, WeightedSum]

    @classmethod
    def of(cls, plant: Plant) -> DynamicDecoupler:
        """Return the decoupler of a plant.

        Raises
        ------
        InvalidInputError
            Not two loops, or an element of it cannot be built.
        UnsupportedPlantError
            It would be unstable.

        """
        if plant.n != 2:
            message = f"dynamic decoupling is for two loops, not {plant.n}"
            raise InvalidInputError(message, "/decoupler")
        p = [[plant.element(row, column) for column in (0, 1)] for row in (0, 1)]
        first = _quotient(p[0][1], p[0][0], "1,2 by element 1,1")
        second = _quotient(p[1][0], p[1][1], "2,1 by element 2,2")
        # q_1 belongs to column 1 of D: p_11 - p_12 p_21/p_22.
        around = (second.in_series(p[0][1]), first.in_series(p[1][0]))
        gains = (
            1 / (p[0][0].static_gain + around[0].static_gain),
            1 / (p[1][1].static_gain + around[1].static_gain),
        )
        processes = (
            WeightedSum((gains[0], gains[0]), (p[0][0], around[0])),
            WeightedSum((gains[1], gains[1]), (p[1][1], around[1])),
        )
        return cls(first, second, gains, processes)

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return D at `omega` (k,) rad per time unit, (k, 2, 2)."""
        D = np.empty((omega.size, 2, 2), dtype=complex)
        D[:, 0, 0], D[:, 1, 1] = self.gains
        D[:, 0, 1] = self.first.response(omega) * self.gains[1]
        D[:, 1, 0] = self.second.response(omega) * self.gains[0]
        return D

    @property
    def static(self) -> NDArray[np.float64]:
        """D(0), (2, 2): that of the static decoupler."""
        a, b = self.gains
        return np.array([[a, self.first.static_gain * b], [self.second.static_gain * a, b]])


def _quotient(num: TransferFunction, den: TransferFunction, name: str) -> TransferFunction:
    """Return -num/den.

    Raises
    ------
    InvalidInputError, UnsupportedPlantError
        It cannot be built.

    """
    where = "/decoupler"
    if num.is_zero:
        return TransferFunction([0.0], [1.0])
    if den.is_zero:
        message = f"dividing element {name}: that is zero"
        raise InvalidInputError(message, where)
    if num.dead_time < den.dead_time:
        message = (
            f"dividing element {name} needs a prediction over {den.dead_time - num.dead_time:g}: "
            "the disturbance is faster than what should cancel it; take the static decoupler"
        )
        raise InvalidInputError(message, where)
    if num.relative_degree < den.relative_degree:
        message = f"dividing element {name} needs derivatives; take the static decoupler"
        raise InvalidInputError(message, where)
    if np.any(np.roots(den.num).real >= 0):
        message = (
            f"dividing element {name} is unstable: it has a zero in the right half plane; take the "
            "static decoupler"
        )
        raise UnsupportedPlantError(message, where)
    return TransferFunction(
        (-np.polymul(num.num, den.den)).tolist(),
        np.polymul(num.den, den.num).tolist(),
        num.dead_time - den.dead_time,
    )


def diagonal_mu(T: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Upper bound of mu for a diagonal complex perturbation, (k,), of matrices T (k, n, n).

    sigma_max(D T D^-1) at the diagonal D > 0 of least Frobenius norm, by Osborne's sweeps. For two
    loops that is mu: with the determinant fixed the largest singular value grows with the Frobenius
    norm, and the bound is tight for so few blocks. For more loops it may be above mu.
    """
    n = T.shape[1]
    size = np.abs(T)
    log_scale = np.zeros(T.shape[:2])
    for _ in range(_SWEEPS):
        for i in range(n):
            scaled = size * np.exp(log_scale[:, :, None] - log_scale[:, None, :])
            rows = np.linalg.norm(np.delete(scaled[:, i, :], i, axis=1), axis=1)
            columns = np.linalg.norm(np.delete(scaled[:, :, i], i, axis=1), axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                change = 0.5 * np.log(columns / rows)
            # A matrix that is triangular has no least: a large scale comes near enough.
            log_scale[:, i] += np.where(np.isnan(change), 0.0, np.clip(change, -7, 7))
            log_scale[:, i] = np.clip(log_scale[:, i], -_FARTHEST, _FARTHEST)
    scale = np.exp(log_scale)
    return np.asarray(np.linalg.norm(T * scale[:, :, None] / scale[:, None, :], 2, axis=(1, 2)))
