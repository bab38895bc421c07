"""How far down in frequency a loop has anything to show: the eigenvalues of G C.

A nearly singular plant is weak in one direction. The loops are slow there, by the factor of its
condition number slower than any corner of plant or controllers. det(I + G C) is the product of
1 + eigenvalue, whatever the units of the signals, so nothing changes below a frequency at which
each eigenvalue is far above one, or constant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["slow_end"]

_FAR_ABOVE_ONE = 1e6  # then S is at its asymptote to about as many digits
_CONSTANT = 1e-9  # relative change over two decades
_DECADES = 30  # beyond the condition number that double precision can tell from infinity


def slow_end(plant: Plant, loops: Sequence[Controller], start: float) -> float:
    """Return a frequency, `start` or below, under which no direction of the loop changes.

    Sub-systems with one loop open are watched too: they are what the others see.

    Parameters
    ----------
    plant : Plant
        The plant.
    loops : sequence of Controller
        One a unit.
    start : float
        Frequency to begin from, rad per time unit.

    """
    blocks, controllers = group_loops(plant, loops)
    omega = start * 10.0 ** -np.arange(_DECADES + 2)
    responses = blocks.response(omega)
    c = np.stack([controller.response(omega) for controller in controllers], axis=1)
    sizes = []
    for block, G in zip(blocks.blocks, responses, strict=True):
        loop = G * c[:, None, block.channels]
        sizes.append(_eigenvalues(loop))
        if block.size > 1:
            for channel in range(block.size):
                rest = np.delete(np.arange(block.size), channel)
                sizes.append(_eigenvalues(loop[:, rest[:, None], rest]))
    size = np.concatenate(sizes, axis=1)
    constant = np.abs(size[:-2] - size[2:]) <= _CONSTANT * size[:-2]
    # An integral term and a weak static gain: constant is what the proportional part makes of it,
    # until the integral takes over.
    if all(loop.integral_time is not None for loop in loops) and not _has_zero_at_origin(plant):
        constant[:] = False
    known = np.all((size[:-2] >= _FAR_ABOVE_ONE) | constant, axis=1)
    return float(omega[np.argmax(known)] if known.any() else start)


def _eigenvalues(loop: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.sort(np.abs(np.linalg.eigvals(loop)), axis=1)


def _has_zero_at_origin(plant: Plant) -> bool:
    return any(not element.is_zero and element.num[-1] == 0 for element in plant.elements)
