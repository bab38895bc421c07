"""Zeros of an analytic function in a box, by the argument principle.

The number of zeros in a box is the winding number of the function along its edge. Boxes are
split until each holds one zero (or one cluster), which Newton's method then refines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.interaction.rational_matrix import Root

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Function = Callable[[NDArray[Any]], NDArray[np.complex128]]

__all__ = ["Rectangle", "zeros_in_box"]

# A box is split off its middle: real zeros and those of symmetric plants lie on halves.
_SPLIT = 0.4837
_CLUSTER = 1e-5  # zeros closer to each other than this, relative to their size, count as one
_FINEST = 1e-13  # of an edge; a step that turns by more than 45 degrees still is a zero on it
_MAX_POINTS = 100_000


@dataclass(frozen=True)
class Rectangle:
    """The rectangle of complex numbers between two corners."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def size(self) -> float:
        """Longer side."""
        return max(self.right - self.left, self.top - self.bottom)

    @property
    def centre(self) -> complex:
        """Middle."""
        return complex((self.left + self.right) / 2, (self.bottom + self.top) / 2)

    def contains(self, point: complex, margin: float) -> bool:
        """Whether the point lies in the box widened by `margin` times its size on all sides."""
        reach = margin * self.size
        return (
            self.left - reach <= point.real <= self.right + reach
            and self.bottom - reach <= point.imag <= self.top + reach
        )

    def halves(self) -> tuple[Rectangle, Rectangle]:
        """Split across the longer side."""
        if self.right - self.left >= self.top - self.bottom:
            cut = self.left + _SPLIT * (self.right - self.left)
            return (
                Rectangle(self.left, self.bottom, cut, self.top),
                Rectangle(cut, self.bottom, self.right, self.top),
            )
        cut = self.bottom + _SPLIT * (self.top - self.bottom)
        return (
            Rectangle(self.left, self.bottom, self.right, cut),
            Rectangle(self.left, cut, self.right, self.top),
        )


def zeros_in_box(function: Function, box: Rectangle) -> tuple[Root, ...]:
    """Return the zeros of `function` in the box, clusters as one with their number.

    Parameters
    ----------
    function : callable
        Analytic on the box, values (m,) complex at points (m,) complex; not zero throughout.
    box : Rectangle
        Its edge passes through no zero.

    """
    roots: list[Root] = []
    pending = [(box, _winding(function, box))]
    while pending:
        part, count = pending.pop()
        if count <= 0:
            continue
        if count == 1 or part.size < _CLUSTER * abs(part.centre):
            root = _polish(function, part)
            if root is not None:
                roots.append(Root(root, count))
                continue
        if part.size < 1e-12 * box.size:
            roots.append(Root(part.centre, count))
            continue
        first, second = part.halves()
        inside = _winding(function, first)
        pending += [(first, inside), (second, count - inside)]
    return tuple(sorted(roots, key=lambda root: (abs(root.value), root.value.imag)))


def _winding(function: Function, box: Rectangle) -> int:
    """Winding number of the function along the edge of the box, anticlockwise."""
    corners = [
        complex(box.left, box.bottom),
        complex(box.right, box.bottom),
        complex(box.right, box.top),
        complex(box.left, box.top),
    ]
    turn = sum(
        _turn(function, start, end)
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True)
    )
    return round(turn / (2 * math.pi))


def _turn(function: Function, start: complex, end: complex) -> float:
    """Change of the function's argument along a straight line.

    The samples are refined until no step turns by more than 45 degrees and twice as many tell
    the same.
    """
    fractions = _samples(start, end)
    values = function(start + fractions * (end - start))
    total = math.inf
    while fractions.size <= _MAX_POINTS:
        turns = np.angle(values[1:] / values[:-1])
        steps = np.diff(fractions)
        coarse = np.flatnonzero((np.abs(turns) > math.pi / 4) & (steps > _FINEST))
        if not coarse.size:
            before, total = total, float(np.sum(turns))
            if abs(total - before) < 0.1:
                break
            coarse = np.flatnonzero(steps > _FINEST)
        middle = fractions[coarse] + steps[coarse] / 2
        fractions = np.insert(fractions, coarse + 1, middle)
        values = np.insert(values, coarse + 1, function(start + middle * (end - start)))
    return total


def _samples(start: complex, end: complex) -> NDArray[np.float64]:
    """Fractions of a line: even ones, and ever finer towards the point nearest to the origin.

    The corner frequencies of a plant spread over decades around the origin.
    """
    direction = end - start
    nearest = -(start * direction.conjugate()).real / abs(direction) ** 2
    nearest = min(max(nearest, 0.0), 1.0)
    fine = np.geomspace(1e-10, 1.0, 61)
    all_fractions = np.concatenate([np.linspace(0, 1, 33), nearest - fine, nearest + fine])
    inside = all_fractions[(all_fractions >= 0) & (all_fractions <= 1)]
    return np.asarray(np.unique(inside), dtype=np.float64)


def _polish(function: Function, box: Rectangle) -> complex | None:
    """Secant iteration from the middle of the box; None where it leaves the box or stalls."""
    before, now = box.centre + 0.01 * box.size, box.centre
    value_before = complex(function(np.array([before]))[0])
    for _ in range(80):
        value = complex(function(np.array([now]))[0])
        if value in {0, value_before}:
            return now if box.contains(now, 1e-6) else None
        step = value * (now - before) / (value - value_before)
        before, value_before, now = now, value, now - step
        if not box.contains(now, 0.5):
            return None
        if abs(step) <= 1e-14 * abs(now):
            return now if box.contains(now, 1e-6) else None
    return None
