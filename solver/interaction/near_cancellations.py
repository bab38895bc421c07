"""Zeros that exist by rounding only: a pole typed twice, in other digits, does not cancel.

A model with fewer states than its elements have poles, typed element by element, holds the same
pole in several roundings. Exact arithmetic then finds a zero between them, which the process has
not. Poles and zeros of elements nearer than a per cent are therefore made equal, and a zero that
vanishes so is named.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq_poly

from solver.interaction.rational_matrix import Rational, decimal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from solver.interaction.rational_matrix import Root
    from solver.model.transfer_function import TransferFunction

__all__ = ["near_cancelling"]

NEAR = 0.01  # relative distance: three digits of a coefficient leave about as much in a root


def near_cancelling(
    functions: Iterable[TransferFunction],
    roots: Sequence[Root],
    zeros_of: Callable[[dict[TransferFunction, Rational]], Sequence[Root] | None],
) -> frozenset[int]:
    """Return which of the `roots` are gone when nearly equal poles and zeros are equal.

    Parameters
    ----------
    functions : iterable of TransferFunction
        All elements of the plant.
    roots : sequence of Root
        Its zeros as the coefficients stand.
    zeros_of : callable
        Zeros of the same plant with other functions in the place of its elements.

    Returns
    -------
    frozenset of int
        Indices into `roots`, of zeros in the left half plane beside a pole.

    """
    elements = [function for function in dict.fromkeys(functions) if not function.is_zero]
    poles = [complex(pole) for element in elements for pole in element.poles]
    suspects = [
        index
        for index, root in enumerate(roots)
        if root.value.real < 0
        and any(root.value != pole and _near(root.value, pole, NEAR) for pole in poles)
    ]
    if not suspects:
        return frozenset()
    points = [*poles, *(complex(zero) for element in elements for zero in element.zeros)]
    middles = _middles([point for point in points if point.imag >= 0 and point.real < 0])
    clean = zeros_of({element: _joined(element, middles) for element in elements})
    if clean is None:
        return frozenset()
    left = [root.value for root in clean for _ in range(root.multiplicity)]
    gone = set()
    # Zeros far from all poles stay; of those near one as many are gone as the clean plant lacks.
    order = sorted(range(len(roots)), key=lambda index: index in suspects)
    for index in order:
        for _ in range(roots[index].multiplicity):
            value = roots[index].value
            nearest = min(left, key=lambda other: abs(other - value), default=None)
            if nearest is not None and (index not in suspects or _near(value, nearest, 3 * NEAR)):
                left.remove(nearest)
            elif index in suspects:
                gone.add(index)
    return frozenset(gone)


def _near(first: complex, second: complex, relative: float) -> bool:
    """Whether two points of the left half plane are as good as equal; damping counts."""
    return abs(first - second) <= relative * min(abs(first.real), abs(second.real))


def _middles(points: Sequence[complex]) -> list[tuple[complex, list[complex]]]:
    """Return clusters of nearly equal points with the value that stands for each."""
    clusters: list[list[complex]] = []
    for point in sorted(points, key=lambda each: (abs(each), each.imag)):
        home = next((c for c in clusters if _near(c[0], point, NEAR)), None)
        if home is None:
            clusters.append([point])
        else:
            home.append(point)
    return [(complex(np.mean(cluster)), cluster) for cluster in clusters]


def _joined(
    element: TransferFunction, middles: Sequence[tuple[complex, list[complex]]]
) -> Rational:
    """Return the rational part of an element with its roots moved to the clusters' values."""

    def polynomial(leading: float, roots: Iterable[complex]) -> fmpq_poly:
        product = fmpq_poly([decimal(leading)])
        for root in roots:
            if root.imag < 0:
                continue
            value = next((m for m, cluster in middles if root in cluster), root)
            if root.imag == 0:
                product *= fmpq_poly([decimal(-value.real), 1])
            else:
                size = abs(value) ** 2
                product *= fmpq_poly([decimal(size), decimal(-2 * value.real), 1])
        return product

    return Rational.reduced(
        polynomial(element.num[0], [complex(zero) for zero in element.zeros]),
        polynomial(element.den[0], [complex(pole) for pole in element.poles]),
    )
