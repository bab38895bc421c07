r"""Lower bound of mu for complex blocks, with the perturbation that attains it.

mu(N) is the largest m for which a vector v satisfies, in every block i of the uncertainty,

    |(N v)_i| = m |v_i|

(Packard and Doyle 1993, section 4): the blocks of Delta then turn (N v)_i into v_i at the norm
1/m, and I - N Delta is singular. Its first-order conditions, with multipliers x_i,

    (N^H X N - m^2 X) v = 0,    |(N v)_i|^2 = m^2 |v_i|^2,    X = diag(x_i I)

are the D-scaled problem seen from the other side (X = D^2), so there are two ways to a v:

1. the top singular vector of D N D^-1 at the best D, which meets the upper bound wherever that
   singular value is simple; where it is repeated, random mixtures of its vectors, then Newton's
   method on the conditions above;
2. for what is left, the power iteration of Packard, Fan and Doyle (1988) from several starts,
   and Newton's method again.

Whatever way a v was found, the bound reported is the spectral radius of N Delta for its Delta.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.mu.structure import BlockStructure

__all__ = ["MuLowerBound", "lower_bound"]

MIXTURES = 6  # of the top singular vectors: one suffices in 99 of 100 cases that are exact
ACTIVE = 1e-3  # relative distance from the greatest singular value that counts as equal
ROUNDS = 2  # of the search, each for what the ones before left open
STARTS = 4
POWER_ITERATIONS = 40
POLISHED = 2  # of the starts, the best ones
NEWTON_STEPS = 10
TIGHT = 1e-9  # relative gap to the upper bound that is worth Newton steps
CLOSED = 1e-7  # gap that is worth a search: a tenth of what is promised for three blocks
DAMPING = 1e-11  # of the balanced normal equations: blocks that do not matter make them singular
SMALLEST = 1e-300


@dataclass(frozen=True)
class MuLowerBound:
    """Lower bound of mu at each frequency.

    `mu` : (k,); `Delta` : (k, p, p) complex, block diagonal, every block of norm one (or zero),
    scaled so that I - N Delta / mu is singular.
    """

    mu: NDArray[np.float64]
    Delta: NDArray[np.complex128]


def lower_bound(
    N: NDArray[np.complex128], structure: BlockStructure, d: NDArray[np.float64]
) -> MuLowerBound:
    """Lower bound of mu for complex blocks.

    Equal to mu where it meets the upper bound at `scales`. For three blocks or fewer it does, if
    the scales are the best ones; for more, mu may lie between the two.

    Parameters
    ----------
    N : (k, p, p) complex
        The matrices, frequency first.
    structure : BlockStructure
        The perturbation's blocks.
    d : (k, n_scales) float
        Scales of the upper bound sigma_max(D N D^-1), which help to meet it. Any positive
        numbers give a valid lower bound.

    Returns
    -------
    MuLowerBound
        The bound and its perturbation at each frequency. Deterministic.

    Raises
    ------
    InvalidInputError
        N has another shape, or an entry that is not finite.

    Notes
    -----
    Packard and Doyle (1993), "The complex structured singular value", Automatica 29(1);
    Packard, Fan and Doyle (1988), "A power method for the structured singular value", CDC.

    """
    structure.check(N)
    blocks = _Blocks(structure)
    D = structure.diagonal(d)
    # D commutes with Delta, so N Delta and D N D^-1 Delta have the same spectral radius.
    balanced = N * D[:, :, None] / D[:, None, :]
    _, sigma, right = np.linalg.svd(balanced)
    upper = sigma[:, 0]
    v = right[:, 0].conj()
    best = _attained(balanced, v, blocks)
    generator = np.random.default_rng(0)
    for attempt in range(MIXTURES):
        gap = CLOSED if attempt else TIGHT
        unmet = np.flatnonzero(best.mu < (1 - gap) * upper)
        if unmet.size:
            v = _mixture(sigma[unmet], right[unmet], generator)
            polished = _newton(balanced[unmet], v, v, blocks)
            _keep_better(best, unmet, _attained(balanced[unmet], polished, blocks))
    for seed in range(ROUNDS):
        unmet = np.flatnonzero(best.mu < (1 - CLOSED) * upper)
        if unmet.size:
            _keep_better(best, unmet, _search(balanced[unmet], blocks, seed))
    return best


def _keep_better(best: MuLowerBound, where: NDArray[np.intp], candidate: MuLowerBound) -> None:
    """Put the candidates into `best` at the frequencies `where` they raise the bound."""
    improved = candidate.mu > best.mu[where]
    best.mu[where[improved]] = candidate.mu[improved]
    best.Delta[where[improved]] = candidate.Delta[improved]


class _Blocks:
    """The partition of p coordinates into blocks."""

    def __init__(self, structure: BlockStructure) -> None:
        self.size = structure.size
        performance = [structure.n_scales] * structure.performance
        self.owner = np.array([*structure.scales, *performance])
        self.count = int(self.owner.max()) + 1
        self.indicator = (self.owner == np.arange(self.count)[:, None]).astype(float)
        self.same = self.indicator.T @ self.indicator

    def norms(self, v: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the norm of each block of `v` (..., p), at each coordinate of that block."""
        norms: NDArray[np.float64] = np.sqrt((v.real**2 + v.imag**2) @ self.same)
        return norms


def _attained(
    N: NDArray[np.complex128], v: NDArray[np.complex128], blocks: _Blocks
) -> MuLowerBound:
    """Return the spectral radius of N Delta and Delta, whose blocks turn N v into v."""
    image = _times(N, v)
    target = v / np.maximum(blocks.norms(v), SMALLEST)
    source = image / np.maximum(blocks.norms(image), SMALLEST)
    Delta = target[:, :, None] * source[:, None, :].conj() * blocks.same
    eigenvalues = np.linalg.eigvals(N @ Delta)
    largest = np.take_along_axis(
        eigenvalues, np.argmax(np.abs(eigenvalues), axis=1)[:, None], axis=1
    )[:, 0]
    mu = np.abs(largest)
    turn = largest.conj() / np.maximum(mu, SMALLEST)
    return MuLowerBound(mu, Delta * turn[:, None, None])


def _mixture(
    sigma: NDArray[np.float64], right: NDArray[np.complex128], generator: np.random.Generator
) -> NDArray[np.complex128]:
    """Return random vectors from the span of the top singular vectors, (k, p).

    At the best scales every v that attains the upper bound lies in it.
    """
    active = sigma >= (1 - ACTIVE) * sigma[:, :1]
    real, imaginary = generator.standard_normal((2, *sigma.shape))
    weights = np.where(active, real + 1j * imaginary, 0)
    return _unit(np.einsum("kj,kji->ki", weights, right.conj()))


def _search(N: NDArray[np.complex128], blocks: _Blocks, seed: int) -> MuLowerBound:
    """Return the best of several power iterations, polished."""
    right, left = _power_iteration(N, blocks, seed)
    values = np.stack([_attained(N, right[:, start], blocks).mu for start in range(STARTS)], axis=1)
    here = np.arange(N.shape[0])
    best = MuLowerBound(np.zeros(N.shape[0]), np.zeros_like(N))
    for start in np.argsort(-values, axis=1)[:, :POLISHED].T:
        v = right[here, start]
        _keep_better(best, here, _attained(N, v, blocks))
        polished = _newton(N, v, left[here, start], blocks)
        _keep_better(best, here, _attained(N, polished, blocks))
    return best


def _power_iteration(
    N: NDArray[np.complex128], blocks: _Blocks, seed: int
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the vectors v and w = X v after the iterations, both (k, starts, p)."""
    generator = np.random.default_rng(seed)
    real, imaginary = generator.standard_normal((2, STARTS, blocks.size))
    v = np.tile(_unit(real + 1j * imaginary), (N.shape[0], 1, 1))
    w = v
    N_transposed = np.swapaxes(N, 1, 2)
    N_conjugate = N.conj()
    for _ in range(POWER_ITERATIONS):
        # Packard, Fan and Doyle (1988): each block keeps its norm from the other side.
        image = _unit(v @ N_transposed)
        z = image * blocks.norms(w) / np.maximum(blocks.norms(image), SMALLEST)
        w = _unit(z @ N_conjugate)
        v = w * blocks.norms(image) / np.maximum(blocks.norms(w), SMALLEST)
    return v, w


def _newton(
    N: NDArray[np.complex128],
    v: NDArray[np.complex128],
    w: NDArray[np.complex128],
    blocks: _Blocks,
) -> NDArray[np.complex128]:
    """Return v after damped Newton steps on the first-order conditions in (v, x, m^2)."""
    # Balanced again by the iteration's own scales, x = |w|/|v|, the multipliers start at one.
    floor = 1e-12  # a block that the vector does not touch
    D = np.sqrt((blocks.norms(w) + floor) / (blocks.norms(v) + floor))
    N = N * D[:, :, None] / D[:, None, :]
    v = _unit(v * D)
    x = np.ones((N.shape[0], blocks.count))
    m_squared = np.sum(np.abs(_times(N, v)) ** 2, axis=1)
    p, b = blocks.size, blocks.count
    for _ in range(NEWTON_STEPS):
        residual, jacobian = _conditions(N, v, x, m_squared, blocks)
        transposed = np.swapaxes(jacobian, 1, 2)
        normal = transposed @ jacobian + DAMPING * np.eye(2 * p + b + 1)
        try:
            step = np.linalg.solve(normal, transposed @ residual[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # conditions that rounding makes dependent: no better here
            break
        v = _unit(v - step[:, :p] - 1j * step[:, p : 2 * p])
        x = np.maximum(x - step[:, 2 * p : 2 * p + b], 1e-6)
        m_squared = m_squared - step[:, -1]
    return v / D


def _conditions(
    N: NDArray[np.complex128],
    v: NDArray[np.complex128],
    x: NDArray[np.float64],
    m_squared: NDArray[np.float64],
    blocks: _Blocks,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return residual and Jacobian of the first-order conditions in (Re v, Im v, x, m^2).

    Rows: stationarity (2 p), one equality a block (b), |v| = 1, the phase of v, sum x = b.
    """
    k, (p, b) = N.shape[0], (blocks.size, blocks.count)
    X = x[:, blocks.owner]
    N_adjoint = np.swapaxes(N.conj(), 1, 2)
    stationary = (N_adjoint * X[:, None, :]) @ N
    stationary[:, np.arange(p), np.arange(p)] -= m_squared[:, None] * X
    # Column i: (N^H E_i N - m^2 E_i) v, half the gradient of block i's equality.
    by_block = N_adjoint @ (_times(N, v)[:, :, None] * blocks.indicator.T)
    by_block -= m_squared[:, None, None] * v[:, :, None] * blocks.indicator.T
    along_m = -X * v

    residual = np.zeros((k, 2 * p + b + 3))
    first = _times(stationary, v)
    residual[:, :p], residual[:, p : 2 * p] = first.real, first.imag
    residual[:, 2 * p : 2 * p + b] = np.einsum("ki,kib->kb", v.conj(), by_block).real
    residual[:, -1] = x.sum(axis=1) - b

    jacobian = np.zeros((k, 2 * p + b + 3, 2 * p + b + 1))
    jacobian[:, :p, :p] = jacobian[:, p : 2 * p, p : 2 * p] = stationary.real
    jacobian[:, p : 2 * p, :p] = stationary.imag
    jacobian[:, :p, p : 2 * p] = -stationary.imag
    jacobian[:, :p, 2 * p : -1], jacobian[:, p : 2 * p, 2 * p : -1] = by_block.real, by_block.imag
    jacobian[:, :p, -1], jacobian[:, p : 2 * p, -1] = along_m.real, along_m.imag
    rows = slice(2 * p, 2 * p + b)
    jacobian[:, rows, :p] = 2 * np.swapaxes(by_block.real, 1, 2)
    jacobian[:, rows, p : 2 * p] = 2 * np.swapaxes(by_block.imag, 1, 2)
    jacobian[:, rows, -1] = -(np.abs(v) ** 2) @ blocks.indicator.T
    jacobian[:, -3, :p], jacobian[:, -3, p : 2 * p] = 2 * v.real, 2 * v.imag
    jacobian[:, -2, :p], jacobian[:, -2, p : 2 * p] = -v.imag, v.real
    jacobian[:, -1, 2 * p : -1] = 1
    return residual, jacobian


def _times(N: NDArray[np.complex128], v: NDArray[np.complex128]) -> NDArray[np.complex128]:
    product: NDArray[np.complex128] = (N @ v[:, :, None])[:, :, 0]
    return product


def _unit(v: NDArray[np.complex128]) -> NDArray[np.complex128]:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    unit: NDArray[np.complex128] = v / np.maximum(length, SMALLEST)
    return unit
