"""All stabilising controllers of a plant, by one stable parameter, block by block.

For a stable plant C = Q (I - G Q)^-1 with Q stable reaches every stabilising controller, and
C S = Q, S = I - G Q are affine in Q (Youla; Skogestad and Postlethwaite, section 4.8). Here

    Q(s) = J(s) P Y(s),   Y(s) = b_0(s) I + sum_j b_j(s) X_j,   b_0(0) = 1, b_j(0) = 0,

with P = (G J)(0)^-1, so that S = O(s) holds exactly: integral action. J = diag(s/(1 + s/f)) on
inputs whose elements integrate, 1 on the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.frequencies import corners
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.limits.basis import Basis
    from solver.model.blocks import LoopBlocks

__all__ = ["YoulaBlock", "youla_blocks"]

NEAR_ZERO = 1e-6  # of the lowest bend: two such points and Richardson's rule give 12 digits
WHOLE = 1e-3  # how near to a whole number the order of a pole at s = 0 must read


@dataclass(frozen=True)
class YoulaBlock:
    """What turns Y into Q for one block of the plant.

    Attributes
    ----------
    index : int
        Number of the block in `LoopBlocks.blocks`.
    inverse : (m, m)
        P.
    integrating : (m,) bool
        Inputs whose elements have a pole at s = 0.
    fast : float
        f, rad per time unit.

    """

    index: int
    inverse: NDArray[np.float64]
    integrating: NDArray[np.bool_]
    fast: float

    @property
    def size(self) -> int:
        """Number of channels m."""
        return len(self.inverse)

    def prefilter(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """J(s) P at the points `s` (k,), (k, m, m)."""
        lift = np.where(self.integrating, s[:, None] / (1 + s[:, None] / self.fast), 1)
        return np.asarray(lift[:, :, None] * self.inverse)

    def parameter(
        self, s: NDArray[np.complex128], basis: Basis, X: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        """Q at the points `s` (k,), (k, m, m), for the coefficients X (j, m, m)."""
        first, rest = basis(s)
        Y = first[:, None, None] * np.eye(self.size) + np.einsum("kj,jab->kab", rest, X)
        return np.asarray(self.prefilter(s) @ Y)


def youla_blocks(blocks: LoopBlocks, fast: float) -> tuple[YoulaBlock, ...]:
    """Return the parametrisation of each block.

    Parameters
    ----------
    blocks : LoopBlocks
        Under a full controller.
    fast : float
        f, rad per time unit: above what any loop reaches.

    Raises
    ------
    InvalidInputError
        The static gain is singular: no controller holds all outputs.
    UnsupportedPlantError
        Elements with double poles at s = 0, or integrators that do not belong to inputs.

    """
    plant = blocks.plant
    s = NEAR_ZERO * float(corners(plant).min()) * np.array([1.0, 0.5])
    if all(element.is_zero or element.den[-1] != 0 for element in plant.elements):
        # The static gain itself, without the digits that the limit towards s = 0 loses.
        for index, (gain,) in enumerate(blocks(np.zeros(1, dtype=np.complex128))):
            if is_singular(gain.real):
                _refuse_singular(parallel=plant.interchangeable, index=index)
    return tuple(
        _youla_block(index, G.real, s, fast, parallel=plant.interchangeable)
        for index, G in enumerate(blocks(s.astype(np.complex128)))
    )


def _youla_block(
    index: int,
    G: NDArray[np.float64],
    s: NDArray[np.float64],
    fast: float,
    *,
    parallel: bool,
) -> YoulaBlock:
    size = np.abs(G).max(axis=1)  # (2, m): the largest element of each column
    if (size == 0).any():
        _refuse_singular(parallel=parallel, index=index)
    slope = np.log2(size[1] / size[0])
    order = np.round(slope)
    if (order > 1).any() or (np.abs(slope - order) > WHOLE).any():
        message = (
            "the limit needs elements that are stable or integrate once, "
            "and no gain that falls towards zero frequency"
        )
        raise UnsupportedPlantError(message, "/plant")
    if (order < 0).any():
        _refuse_singular(parallel=parallel, index=index)
    here, below = (value * point**order for value, point in zip(G, s, strict=True))
    lead = 2 * below - here
    lead = np.where(np.abs(lead) < WHOLE * np.abs(here), 0.0, lead)  # it has fewer integrators
    if is_singular(lead):
        if order.any():
            message = (
                "the limit of a plant with integrators is found where each input's own "
                "integrators make the gain regular"
            )
            raise UnsupportedPlantError(message, "/plant")
        _refuse_singular(parallel=parallel, index=index)
    return YoulaBlock(index, np.linalg.inv(lead), order > 0, fast)


def _refuse_singular(*, parallel: bool, index: int) -> None:
    which = "" if not parallel else " of the differences" if index else " of the sum"
    message = f"the static gain{which} is singular: no controller holds all outputs"
    raise InvalidInputError(message, "/plant")
