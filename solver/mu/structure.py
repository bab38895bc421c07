"""Block structure of the perturbation, and the bound that given D-scales prove."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BlockStructure", "Bound", "bound_of_scales", "sigma_max"]


@dataclass(frozen=True)
class BlockStructure:
    """Complex perturbation blocks: uncertain channels first, then one full performance block.

    Parameters
    ----------
    scales : tuple of int
        D-scale of each uncertain channel, numbered from 0. Channels with different scales are
        independent scalars; channels that share one form a full block.
    performance : int
        Size of the performance block, whose scale is fixed to 1; 0: none.

    """

    scales: tuple[int, ...]
    performance: int

    def __post_init__(self) -> None:
        if sorted(set(self.scales)) != list(range(len(set(self.scales)))):
            message = "scales must be numbered 0, 1, ... without gaps"
            raise InvalidInputError(message, "/scales")
        if self.performance < 0 or not self.size:
            message = "a structure has at least one channel"
            raise InvalidInputError(message, "/performance")

    @property
    def size(self) -> int:
        """Number of channels p of N."""
        return len(self.scales) + self.performance

    @property
    def n_scales(self) -> int:
        """Number of different D-scales."""
        return len(set(self.scales))

    def diagonal(self, d: NDArray[np.float64]) -> NDArray[np.float64]:
        """Diagonal of D, (k, p), from the scales d (k, n_scales)."""
        ones = np.ones((d.shape[0], self.performance))
        return np.hstack([d[:, list(self.scales)], ones])

    def check(self, N: NDArray[np.complex128]) -> None:
        """Raise `InvalidInputError` unless N is (k, p, p) and finite."""
        if N.ndim != 3 or N.shape[1:] != (self.size, self.size):
            message = f"N must have the shape (k, {self.size}, {self.size}), not {N.shape}"
            raise InvalidInputError(message, "/N")
        if not np.isfinite(N).all():
            message = "N must be finite"
            raise InvalidInputError(message, "/N")


@dataclass(frozen=True)
class Bound:
    """Upper bounds of mu and the scales that prove them.

    Attributes
    ----------
    mu : (k,)
        sigma_max(D N D^-1): an upper bound of mu whatever the scales.
    d : (k, n_scales)
        The scales, > 0.

    """

    mu: NDArray[np.float64]
    d: NDArray[np.float64]


def bound_of_scales(
    N: NDArray[np.complex128], d: NDArray[np.float64], structure: BlockStructure
) -> Bound:
    """Upper bound of mu that the scales d (k, n_scales) prove for N (k, p, p)."""
    D = structure.diagonal(d)
    scaled = D[:, :, None] * N / D[:, None, :]
    return Bound(sigma_max(scaled), d)


def sigma_max(matrices: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Largest singular value of each matrix (k, p, p), right to rounding, (k,).

    From the eigenvalues of M^H M, in half the time of a decomposition: only small singular values
    lose digits by it.
    """
    size = np.abs(matrices).max(axis=(1, 2), keepdims=True)
    unit = matrices / np.where(size > 0, size, 1)  # no square of an entry can overflow
    square = np.linalg.eigvalsh(unit.conj().swapaxes(1, 2) @ unit)[:, -1]
    return np.asarray(size[:, 0, 0] * np.sqrt(np.maximum(square, 0)))
