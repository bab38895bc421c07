"""Plant and uncertainty at single points s, each value checked in ball arithmetic.

Points on the imaginary axis are frequencies; those to its right see what makes a loop unstable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import acb, acb_poly

from solver.certificate.enclosures import exact
from solver.model.plants import ParallelPlant
from solver.model.precision import working_precision

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Uncertainty

__all__ = ["Samples", "samples"]

ERROR = 1e-14  # largest relative error of a value; the margin of a cut is ten times that
PRECISION = (
    203  # bits of the balls, 60 digits: no polynomial of the permitted order cancels so much
)


@dataclass(frozen=True)
class Samples:
    """What the bound needs of each point.

    Attributes
    ----------
    s : (k,) complex
        Points with a real part >= 0, 1 per time unit.
    G : (k, rows, widest) complex
        `LoopBlocks.packed_at`.
    u : (k,)
        |w_I|^2.
    size : (k,)
        Bounds the norm of each block of G, all its entries and their parts taken by modulus.

    """

    s: NDArray[np.complex128]
    G: NDArray[np.complex128]
    u: NDArray[np.float64]
    size: NDArray[np.float64]


def samples(blocks: LoopBlocks, uncertainty: Uncertainty, s: NDArray[np.complex128]) -> Samples:
    """Return the values at those of the points `s` (k,) where they are right to 1e-14."""
    plant = blocks.plant
    weight = uncertainty.weight_of(0)
    right = _right(weight, s)
    for function in set(plant.elements):
        right &= _right(function, s)
    s = s[right]
    if isinstance(plant, ParallelPlant):
        process, interaction = np.abs(plant.process(s)), np.abs(plant.interaction(s))
        # The block of the group means has g - i on its diagonal, and i sqrt(m_a m_b) everywhere.
        size = process + (1 + plant.n) * interaction * blocks.ratios.max()
    else:
        known = {element: np.abs(np.asarray(element(s))) for element in set(plant.elements)}
        squares = [
            sum(
                sum(abs(term.factor) * known[term.element] for term in terms) ** 2
                for row in blocks.terms(index)
                for terms in row
            )
            for index in range(len(blocks.blocks))
        ]
        size = np.sqrt(np.max(squares, axis=0))
    u = np.abs(weight(s)) ** 2
    return Samples(s, blocks.packed_at(s), u, np.asarray(size))


def _right(function: TransferFunction, s: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Whether the computed values of a function are proven to be right, (k,)."""
    if function.is_zero:
        return np.ones(s.shape, dtype=bool)
    values = np.asarray(function(s))
    right = np.zeros(s.shape, dtype=bool)
    with working_precision(PRECISION):
        num, den = (
            acb_poly([acb(exact(c)) for c in reversed(p)]) for p in (function.num, function.den)
        )
        delay = -acb(exact(function.dead_time))
        for k, (point, value) in enumerate(zip(s, values, strict=True)):
            at = acb(exact(point.real), exact(point.imag))
            true = num(at) / den(at) * (delay * at).exp()
            computed = acb(exact(value.real), exact(value.imag))
            right[k] = bool(abs(computed - true) <= ERROR * abs(computed))
    return right
