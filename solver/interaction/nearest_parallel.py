"""The parallel plant nearest to a matrix plant, and how near it is.

Skogestad, Lundstrom and Hovd (1989), section 2, call a distillation column "quite close" to two
parallel units with a = -0.986. Units are as given: identical units have the same ones.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.equality import ByValue

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant

__all__ = ["NearestParallel", "nearest_parallel"]

# Nearer than this the results for parallel units are a guide: models are seldom known better.
_NEAR = 0.15
_TIE = 1e-9  # of the squared norm: patterns of signs that serve equally well


@dataclass(frozen=True, eq=False)
class NearestParallel(ByValue):
    """The parallel matrix nearest to a plant in the Frobenius norm, signs of signals turned.

    Attributes
    ----------
    own, interaction : float
        Its static gain k and degree of interaction a. For two units a and -a are one plant: the
        sign goes with that of one input and one output.
    output_signs, input_signs : tuple of int
        +1 or -1, a signal each: those with -1 are counted the other way round.
    distance : float
        |G(0) - P(0)| / |G(0)|, Frobenius norms; 0 for identical units.
    greatest_distance : float
        The largest one over the frequencies, P(j omega) being the nearest at each.
    interactions : (k,) complex
        a(j omega); NaN where the own response vanishes.
    near : bool
        Whether the greatest distance is at most 0.15.

    """

    own: float
    interaction: float
    output_signs: tuple[int, ...]
    input_signs: tuple[int, ...]
    distance: float
    greatest_distance: float
    interactions: NDArray[np.complex128]
    near: bool


def nearest_parallel(plant: Plant, omega: NDArray[np.float64]) -> NearestParallel | None:
    """Return the nearest parallel plant, or None where a loop has no static gain of its own.

    Parameters
    ----------
    plant : Plant
        At least two loops, finite static gain.
    omega : (k,)
        Frequencies, rad per time unit.

    """
    static = plant.static_gain()
    if np.any(np.diag(static) == 0):
        return None
    output_signs, input_signs = _signs(static / np.abs(static).max())
    turned = np.outer(output_signs, input_signs)
    own, other, distance = _nearest((turned * static)[None])
    responses = turned * plant.response(omega)
    owns, others, distances = _nearest(responses)
    with np.errstate(divide="ignore", invalid="ignore"):
        interactions = others / owns
    missing = complex(np.nan, np.nan)
    greatest = float(max(distance[0], np.max(distances)))
    return NearestParallel(
        own=float(own[0].real),
        interaction=float((other[0] / own[0]).real),
        output_signs=tuple(int(sign) for sign in output_signs),
        input_signs=tuple(int(sign) for sign in input_signs),
        distance=float(distance[0]),
        greatest_distance=greatest,
        interactions=np.where(np.isfinite(interactions), interactions, missing),
        near=greatest <= _NEAR,
    )


def _signs(static: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return signs of outputs and inputs, (n,) each, that make the gain most nearly parallel.

    Own gains are made positive, so the signs of the outputs fix those of the inputs. The squared
    distance is what the mean of the other elements leaves, so the largest such mean is sought;
    among equals the one that turns fewest inputs, then fewest outputs.
    """
    n = len(static)
    own = np.sign(np.diag(static))
    patterns = np.array(list(itertools.product((1.0, -1.0), repeat=n)))
    total = np.einsum("pi,pj,ij->p", patterns, patterns * own, static)
    strength = (total - np.abs(np.diag(static)).sum()) ** 2
    best = patterns[strength >= strength.max() - _TIE * np.sum(static**2)]
    turned = [(int(np.sum(each * own < 0)), int(np.sum(each < 0))) for each in best]
    outputs = best[turned.index(min(turned))]
    return outputs, outputs * own


def _nearest(
    responses: NDArray[np.complex128] | NDArray[np.float64],
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.float64]]:
    """Return own and other element, and relative distance, of each matrix of (k, n, n); (k,)."""
    n = responses.shape[1]
    diagonal = np.eye(n, dtype=bool)
    # Scaled first: squares of tiny responses at high frequencies underflow.
    scale = np.max(np.abs(responses), axis=(1, 2))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = responses / scale[:, None, None]
    owns = scaled[:, diagonal].mean(axis=1)
    others = scaled[:, ~diagonal].mean(axis=1)
    nearest = np.where(diagonal, owns[:, None, None], others[:, None, None])
    norms = np.linalg.norm(scaled, axis=(1, 2))
    left = np.linalg.norm(scaled - nearest, axis=(1, 2))
    distance = np.divide(left, norms, out=np.zeros_like(left), where=norms > 0)
    return owns * scale, others * scale, np.asarray(distance, dtype=np.float64)
