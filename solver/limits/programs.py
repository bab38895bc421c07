"""One convex step towards the least mu, in the Youla parameter and the D-scales together.

With v = d^-2 and R(v) = (I + G diag(v) G^H)^-1, mu <= gamma at a frequency is

    A(Q)^H diag(gamma^2 v, gamma^2 I)^-1 A(Q) <= R(v),      A = [w_I Q; w_P (I - G Q)].

The left side is convex in (Q, v) jointly, and R is an operator-convex function of v: its tangent
R0 - R0 G diag(v - v0) G^H R0 lies below it. Replacing R by its tangent at the present scales gives
a convex program whose solutions are all feasible for the true problem, so that mu falls with every
step (convex-concave procedure). D-K iteration is the same with v held in the program, and stalls
where no change of Q or of D alone gains. Where tau_P is sought, mu stays where it is, and |w_P|^2
grows with tau_P^-2: by 1 + h u for a relative growth u of that, which 1/(1 - h u) covers, convex.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.interior import Inequalities, Inequality, largest_slack

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["AffineBlock", "convex_step"]

# Of a step that makes tau_P fall: mu falls too, by this share. tau_P counts for nothing at high
# frequency, and the program would have no inside where mu is at its peak there.
SHARED = 0.1
LARGEST_RISE = 20.0  # of v in one step: a scale that does not matter would run away


@dataclass(frozen=True, eq=False)
class AffineBlock:
    """Q = prefilter (first I + sum_j b_j X_j) of one block, affine in the coefficients X_j.

    Attributes
    ----------
    G : (k, m, m) complex
        The block's plant.
    prefilter : (k, m, m) complex
        J P, see `solver.limits.youla`.
    first : (k,) complex
        b_0.
    functions : (k, j) complex
        b_j.
    scales : tuple of int
        Scale of each channel.

    """

    G: NDArray[np.complex128]
    prefilter: NDArray[np.complex128]
    first: NDArray[np.complex128]
    functions: NDArray[np.complex128]
    scales: tuple[int, ...]

    @property
    def offset(self) -> NDArray[np.complex128]:
        """Q (k, m, m) for zero coefficients."""
        return self.first[:, None, None] * self.prefilter

    def parameter(self, X: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Q (k, m, m) for the coefficients X (j, m, m)."""
        Y = (self.functions @ X.reshape(len(X), -1)).reshape(self.G.shape)
        return np.asarray(self.offset + self.prefilter @ Y)


def convex_step(
    blocks: list[AffineBlock],
    X: list[NDArray[np.float64]],
    v: NDArray[np.float64],
    *,
    level: float,
    weights: tuple[NDArray[np.float64], NDArray[np.float64]],
    rise: NDArray[np.float64] | None = None,
    tick: Callable[[], None] = lambda: None,
) -> list[NDArray[np.float64]]:
    """Return the coefficients (j, m, m) of each block after one step.

    Parameters
    ----------
    blocks : list of AffineBlock
        They share functions and scales.
    X : list of (j, m, m)
        Coefficients to begin with.
    v : (k, scales)
        d^-2.
    level : float
        gamma, the peak of mu at these scales.
    weights : (k,), (k,)
        |w_I| and |w_P|.
    rise : (k,) or None
        Where tau_P is to fall: d log |w_P|^2 / d log tau_P^-2. None: mu is to fall.
    tick : callable
        As of `largest_slack`.

    """
    inequalities = [_inequality(block, v, level, *weights) for block in blocks]
    functions = blocks[0].functions
    if rise is None:
        problem = Inequalities(inequalities, functions, LARGEST_RISE, 1.0, np.zeros(len(v)))
    else:
        problem = Inequalities(inequalities, functions, LARGEST_RISE, SHARED, rise)
    return largest_slack(problem, X, tick)[0]


def _inequality(
    block: AffineBlock,
    v: NDArray[np.float64],
    level: float,
    w_I: NDArray[np.float64],
    w_P: NDArray[np.float64],
) -> Inequality:
    """Return the program's data in coordinates where R is I: I + G V G^H = L L^H."""
    eye = np.eye(block.G.shape[1])
    own = v[:, list(block.scales)]
    inverse_R = eye + (block.G * own[:, None, :]) @ block.G.conj().swapaxes(1, 2)
    L = np.asarray(np.linalg.cholesky(inverse_R), dtype=np.complex128)
    left = (w_I[:, None] / (level * np.sqrt(own)))[:, :, None]
    weight = (w_P / level)[:, None, None]
    offset = block.offset
    A = np.concatenate([left * offset, weight * (eye - block.G @ offset)], axis=1) @ L
    U = np.concatenate([left * block.prefilter, -weight * (block.G @ block.prefilter)], axis=1)
    tangent = np.linalg.solve(L, block.G) * np.sqrt(own)[:, None, :]
    scales = np.zeros((v.shape[1], len(block.scales)))
    scales[list(block.scales), np.arange(len(block.scales))] = 1
    T = np.einsum("kai,si,kbi->ksab", tangent, scales, tangent.conj())
    return Inequality(A, U, L, T, scales)
