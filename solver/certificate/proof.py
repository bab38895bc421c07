"""The two statements a certificate rests on, decided for one frequency interval at a time.

Robust performance: the form F of `EnclosedLoop` is positive definite. It is, on the
whole interval, a convex combination of its control points, so it is if they are.

Nominal stability: det E, multiplied by the power of s that makes it finite at s = 0, is analytic
in the right half plane, where its zeros are the unstable poles. They are counted by the change of
its argument from s = 0 up the imaginary axis and back to the real axis at infinity. On an
interval where all control points of E, times some fixed matrix, lie within sin(pi/k) of the k x k
identity, each of the k eigenvalues turns by less than pi/k from the positive axis, so that the
change of argument is that of the principal arguments at the ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING

from flint import acb, acb_mat, arb, arb_mat, fmpq

from solver.certificate.enclosed_loop import EnclosedLoop, ExactLoop
from solver.certificate.enclosures import Frame, Interval
from solver.certificate.taylor_models import UnenclosedError, control_points

if TYPE_CHECKING:
    from collections.abc import Sequence


__all__ = ["Gap", "Turns", "examine", "proven_unstable_poles"]


class Gap(StrEnum):
    """What could not be proven on an interval."""

    ENCLOSURE = "a response could not be enclosed"
    PERFORMANCE = "the level of mu could not be proven"
    STABILITY = "the argument of det(I + G C) could not be followed"


@dataclass(frozen=True)
class Turns:
    """Change of the argument of det E along an interval (rad), a ball for each block."""

    angles: tuple[arb, ...]


def examine(loop: ExactLoop, interval: Interval, scales: Sequence[float]) -> Turns | Gap:
    """Return the change of argument on the interval, or what could not be proven there.

    Parameters
    ----------
    loop : ExactLoop
        The loop and the level.
    interval : Interval
        Frequencies, rad per time unit.
    scales : sequence of float
        D-scales d > 0, one or one a setting.

    """
    X = loop.X(scales)
    turns = []
    try:
        enclosed = EnclosedLoop(loop, interval.axis)
        for index, block in enumerate(loop.blocks):
            F = control_points(enclosed.performance_form(index, X))
            if not all(_is_positive(F, k, len(block.settings)) for k in range(F.ncols())):
                return Gap.PERFORMANCE
        for index in range(len(loop.blocks)):
            if interval.unbounded:
                turn = _turn_to_the_real_axis(loop, index, interval)
            else:
                turn = _turn_along_the_axis(enclosed, index, interval)
            if turn is None:
                return Gap.STABILITY
            turns.append(turn)
    except UnenclosedError:
        return Gap.ENCLOSURE
    return Turns(tuple(turns))


def proven_unstable_poles(loop: ExactLoop, turns: Sequence[Turns]) -> int | None:
    """Return the number of closed-loop poles with Re s >= 0; None if the angles do not tell.

    Parameters
    ----------
    loop : ExactLoop
        The loop.
    turns : sequence of Turns
        Of intervals that cover all frequencies from 0 to infinity.

    """
    total = 0
    for block, angles in zip(
        loop.blocks, zip(*(turn.angles for turn in turns), strict=True), strict=True
    ):
        zeros = (-sum(angles, arb(0)) / arb.pi()).unique_fmpz()
        if zeros is None:
            return None
        total += block.multiplicity * int(zeros)
    return total


def _is_positive(elements: acb_mat, point: int, size: int) -> bool:
    """Whether the Hermitian matrix in column `point` is positive definite: its L D L^H."""
    L: list[list[acb]] = []
    D: list[arb] = []
    position = 0
    for row in range(size):
        L.append([])
        for column in range(row + 1):
            value = elements[position, point]
            position += 1
            for k in range(column):
                value -= L[row][k] * L[column][k].conjugate() * D[k]
            if column < row:
                L[row].append(value / D[column])
            elif value.real > 0:
                D.append(value.real)
            else:
                return False
    return True


def _turn_along_the_axis(enclosed: EnclosedLoop, index: int, interval: Interval) -> arb | None:
    """Return the change of argument of det E from the low end of an interval to the high one."""
    E = enclosed.blocks[index].return_difference
    points = control_points([element for row in E for element in row])
    hull = [
        acb_mat([[points[r * len(E) + c, k] for c in range(len(E))] for r in range(len(E))])
        for k in range(points.ncols())
    ]
    multiplier = _approximate_inverse(hull[len(hull) // 2])
    if multiplier is None or not all(_is_near_identity(multiplier * point) for point in hull):
        return None
    low, high = (
        _argument(multiplier, enclosed.loop, index, interval, end)
        for end in (interval.low, interval.high)
    )
    return high - low


def _turn_to_the_real_axis(loop: ExactLoop, index: int, interval: Interval) -> arb | None:
    """Return the change of argument of det E from j low to the real axis, at a large |s|."""
    # The half disk holds both the axis beyond low and the arc that closes the contour.
    E = _values(EnclosedLoop(loop, interval.tail), index)
    # A real multiplier keeps the determinant real at real s; near the identity it is positive.
    multiplier = _approximate_inverse(E.real)
    if multiplier is None or not _is_near_identity(multiplier * E):
        return None
    # Here the rows lack their powers of s, which turn by a quarter each.
    powers = loop.turns(loop.blocks[index])
    return -powers * arb.pi() / 2 - _argument(multiplier, loop, index, interval, interval.low)


def _argument(
    multiplier: acb_mat, loop: ExactLoop, index: int, interval: Interval, omega: float
) -> arb:
    E = _values(_at(loop, omega, inverse=interval.unbounded), index)
    return (multiplier * E).det().arg()


@lru_cache(maxsize=2)
def _at(loop: ExactLoop, omega: float, *, inverse: bool) -> EnclosedLoop:
    """Return the loop at one frequency; an interval's end is the start of the next."""
    return EnclosedLoop(loop, Frame.at(omega, inverse=inverse))


def _values(enclosed: EnclosedLoop, index: int) -> acb_mat:
    """Return balls that hold E of a block over the frame of `enclosed`."""
    E = enclosed.blocks[index].return_difference
    return acb_mat([[element.values for element in row] for row in E])


def _approximate_inverse(matrix: acb_mat | arb_mat) -> acb_mat | None:
    try:
        return acb_mat(matrix.mid().inv().mid())
    except ZeroDivisionError:
        return None


def _is_near_identity(matrix: acb_mat) -> bool:
    """Whether max_r sum_c |a_rc - (r = c)| < sin(pi/k), or 1 for k = 1."""
    size = matrix.nrows()
    reach = arb.sin_pi_fmpq(fmpq(1, max(size, 2)))
    return all(
        sum((abs(matrix[r, c] - (r == c)) for c in range(size)), arb(0)) < reach
        for r in range(size)
    )
