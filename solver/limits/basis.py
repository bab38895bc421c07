"""A rational basis of stable functions: Takenaka-Malmquist sections.

    b_0 = p_0/(s + p_0) 1/(1 + s/f),   b_j = s phi_j(s) 1/(1 + s/f),
    phi_j = sqrt(2 p_j)/(s + p_j) prod_(i<j) (s - p_i)/(s + p_i),

orthonormal on the imaginary axis and still nearly dependent on a logarithmic grid, so they are
combined by a singular value decomposition over the weighted grid; what falls below working
accuracy is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.state_space import StateSpace

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Basis"]

KEPT = 1e-7  # singular values below this share of the largest are rounding to the convex program


@dataclass(frozen=True, eq=False)
class Basis:
    """b_0 and the combinations b = s phi mix.

    Attributes
    ----------
    first : float
        p_0, rad per time unit.
    poles : (q,)
        p_j, rad per time unit.
    mix : (q, j)
        Coefficients of the sections in each function.
    end : float
        f, rad per time unit: where all functions begin to fall.

    """

    first: float
    poles: NDArray[np.float64]
    mix: NDArray[np.float64]
    end: float

    @classmethod
    def over(
        cls,
        omega: NDArray[np.float64],
        first: float,
        poles: NDArray[np.float64],
        end: float,
    ) -> Basis:
        """Return the functions that can be told from each other on the grid `omega` (k,)."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        values = _sections(s, poles) * (s / (1 + s / end))[:, None]
        stacked = np.vstack([values.real, values.imag])
        _, size, combinations = np.linalg.svd(stacked, full_matrices=False)
        kept = size > KEPT * size[0]
        # On the grid, each function then has a root mean square of 1.
        scale = np.sqrt(omega.size) / size[kept]
        return cls(first, poles, combinations[kept].T * scale, end)

    @property
    def size(self) -> int:
        """Number of functions b_1, b_2, ..."""
        return int(self.mix.shape[1])

    def __call__(
        self, s: NDArray[np.complex128]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """b_0 (k,) and the others (k, j) at the points `s` (k,)."""
        fall = 1 / (1 + s / self.end)
        rest = (s * fall)[:, None] * (_sections(s, self.poles) @ self.mix)
        return self.first / (s + self.first) * fall, rest

    def realise(self, X: NDArray[np.float64]) -> StateSpace:
        """Return b_0 I + sum_j b_j X_j, X (j, m, m), in state space."""
        count, channels = self.poles.size, X.shape[1]
        # One chain of all-passes: z_j' = -p_j z_j + u_j, u_(j+1) = u_j - 2 p_j z_j.
        A = -np.diag(self.poles)
        for row in range(1, count):
            A[row, :row] = -2 * self.poles[:row]
        scale = np.sqrt(2 * self.poles)
        # s phi_j = scale_j z_j'
        rise, through = scale[:, None] * A, scale
        weights = np.einsum("qj,jab->qab", self.mix, X)
        each = np.eye(channels)
        C = np.einsum("qab,qz->abz", weights, rise).reshape(channels, channels * count)
        D = np.einsum("qab,q->ab", weights, through)
        chains = StateSpace(np.kron(each, A), np.kron(each, np.ones((count, 1))), C, D)
        lag = StateSpace(-self.first * each, each, self.first * each, 0 * each)
        fall = StateSpace(-self.end * each, each, self.end * each, 0 * each)
        return fall.after(lag.beside(chains))


def _sections(s: NDArray[np.complex128], poles: NDArray[np.float64]) -> NDArray[np.complex128]:
    """phi_j (k, q) at the points `s` (k,)."""
    values = np.empty((s.size, poles.size), dtype=complex)
    passed = np.ones(s.size, dtype=complex)
    for j, pole in enumerate(poles):
        values[:, j] = np.sqrt(2 * pole) / (s + pole) * passed
        passed = passed * (s - pole) / (s + pole)
    return values
