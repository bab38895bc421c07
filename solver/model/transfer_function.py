"""Rational transfer functions with dead time, g(s) = num(s)/den(s) exp(-dead_time s)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.validation import frequencies, read_only, real, reals, settle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["LARGEST", "MAX_ORDER", "SMALLEST", "TransferFunction", "refuse_vanishing"]

# Products of a few dozen such numbers still fit a double, so no evaluation can overflow.
LARGEST = 1e12
# Quotients of coefficients must be numbers: a smaller one is zero or a slip.
SMALLEST = 1e-150
MAX_ORDER = 20
# Roots of one polynomial further apart than this are not told by coefficients in double
# precision: what one of them adds is three digits above the rounding of the others.
ROUNDING = 1e13
HARDLY_ZERO = 1e-77
LARGEST_POWER = 250  # of ten


@dataclass(frozen=True)
class TransferFunction:
    """A proper rational function of s times a dead time.

    Parameters
    ----------
    num, den : sequence of float
        Coefficients in descending powers of s, at most as many in the numerator; leading zeros
        are dropped. ``num = (0,)`` is the zero function. What is left of a zero by rounding, as
        conversions from state space print it, is taken for the zero that it is: poles at s = 0,
        and zeros at infinity. `remarks` says so.
    dead_time : float
        Dead time >= 0, in the caller's time unit.

    Raises
    ------
    InvalidInputError
        An empty polynomial, a denominator of zero, a number that is not finite, is above `LARGEST`
        or, without being zero, below `SMALLEST` in magnitude, an improper quotient, an order above
        `MAX_ORDER`, a negative dead time.

    Examples
    --------
    >>> lag = TransferFunction([1], [100, 1])
    >>> lag.poles
    array([-0.01+0.j])
    >>> lag(0.0)
    (1+0j)

    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    dead_time: float = 0.0
    remarks: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def __init__(self, num: Sequence[float], den: Sequence[float], dead_time: float = 0.0) -> None:
        above, below = _polynomial(num, "/num"), _polynomial(den, "/den")
        if below[0] == 0:
            message = "the denominator is zero"
            raise InvalidInputError(message, "/den")
        exact_below, integrators = _without_origin_noise(below)
        exact_above, infinite = _without_leading_noise(above, exact_below)
        remarks = []
        if integrators:
            remarks.append(
                f"{_count(integrators, 'pole')} within rounding of s = 0: taken for "
                f"{'an integrator' if integrators == 1 else 'integrators'}"
            )
        if infinite:
            remarks.append(
                f"{_count(infinite, 'leading coefficient')} of the numerator within rounding of 0: "
                "left out"
            )
        settle(
            self,
            num=exact_above,
            den=exact_below,
            dead_time=real(dead_time, "/dead_time"),
            remarks=tuple(remarks),
        )
        if len(self.num) > len(self.den):
            message = (
                f"improper: the numerator has degree {len(self.num) - 1}, "
                f"above the denominator's {len(self.den) - 1}"
            )
            raise InvalidInputError(message, "/num")
        if not 0 <= self.dead_time <= LARGEST:
            message = f"the dead time must lie in 0..{LARGEST:g}"
            raise InvalidInputError(message, "/dead_time")

    def in_series(self, other: TransferFunction) -> TransferFunction:
        """Return the product with another one."""
        return TransferFunction(
            np.polymul(self.num, other.num).tolist(),
            np.polymul(self.den, other.den).tolist(),
            self.dead_time + other.dead_time,
        )

    @property
    def is_zero(self) -> bool:
        """Whether this is the zero function."""
        return self.num == (0.0,)

    @property
    def relative_degree(self) -> int:
        """Degree of the denominator minus that of the numerator."""
        return len(self.den) - len(self.num)

    @property
    def feedthrough(self) -> float:
        """What passes at once, or after the dead time: the rational part at s -> infinity."""
        return 0.0 if self.relative_degree or self.is_zero else self.num[0] / self.den[0]

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of the denominator, (order,) complex, read-only."""
        return read_only(np.roots(self.den).astype(complex))

    @cached_property
    def zeros(self) -> NDArray[np.complex128]:
        """Roots of the numerator, (order,) complex, read-only."""
        return read_only(np.roots(self.num).astype(complex))

    @cached_property
    def integrators(self) -> int:
        """Number of poles at s = 0 that no zero there cancels."""
        if self.is_zero:
            return 0
        return max(_trailing_zeros(self.den) - _trailing_zeros(self.num), 0)

    @property
    def static_gain(self) -> float:
        """Value at s = 0; infinite with the sign of the residue for an integrating process."""
        if self.is_zero:
            return 0.0
        num, den = self._without_common_origin_roots()
        if den[-1] == 0:
            lowest = next(c for c in reversed(den) if c != 0)
            return math.copysign(math.inf, num[-1] / lowest)
        return num[-1] / den[-1]

    def __call__(self, s: ArrayLike) -> NDArray[np.complex128] | complex:
        """Value at the complex points `s` (any shape)."""
        points = np.asarray(s, dtype=complex)
        far = np.abs(points) > self.reach
        if np.count_nonzero(far):  # there in 1/s, so that no power of s overflows
            inverse: NDArray[np.complex128] = np.reciprocal(np.where(far, points, 1))
            value = np.where(
                far,
                _quotient(self.num[::-1], self.den[::-1], inverse) * inverse**self.relative_degree,
                _quotient(self.num, self.den, np.where(far, 1, points)),
            )
        else:
            value = _quotient(self.num, self.den, points)
        if self.dead_time:
            value = value * np.exp(-self.dead_time * points)
        return complex(value) if value.ndim == 0 else value

    @cached_property
    def reach(self) -> float:
        """Largest |s| whose powers fit a double with room for the coefficients."""
        return math.pow(10, LARGEST_POWER / max(len(self.den) - 1, 1))

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` > 0 (rad per time unit), (k,) complex, in its order.

        Raises
        ------
        InvalidInputError
            Frequencies that are not finite and positive, or more than one axis of them. The
            function itself may be called at any complex point, s = 0 included.

        """
        return np.atleast_1d(self(1j * frequencies(omega)))

    def derivative_at_zero(self) -> float:
        """First Taylor coefficient at s = 0, dead time exact.

        Raises
        ------
        InvalidInputError
            The function has a pole at s = 0.

        """
        num, den = self._without_common_origin_roots()
        if den[-1] == 0:
            message = "the process integrates: no Taylor expansion at s = 0"
            raise InvalidInputError(message, "/den")
        slope_num = num[-2] if len(num) > 1 else 0.0
        slope_den = den[-2] if len(den) > 1 else 0.0
        gain = num[-1] / den[-1]
        return (slope_num - gain * slope_den) / den[-1] - self.dead_time * gain

    def _without_common_origin_roots(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        common = min(_trailing_zeros(self.num), _trailing_zeros(self.den))
        if self.is_zero or not common:
            return self.num, self.den
        return self.num[:-common], self.den[:-common]


def refuse_vanishing(value: float, field: str) -> None:
    """Refuse a number that is not zero and below `SMALLEST` in magnitude.

    Parameters
    ----------
    value : float
        A coefficient, or what becomes one.
    field : str
        JSON pointer of the number that the caller gave.

    Raises
    ------
    InvalidInputError
        It is so small.

    """
    if 0 < abs(value) < SMALLEST:
        message = f"the number must be zero or at least {SMALLEST:g} in magnitude"
        raise InvalidInputError(message, field)


def _polynomial(coefficients: Sequence[float], field: str) -> tuple[float, ...]:
    values = reals(coefficients, field)
    if not values:
        message = "a polynomial needs at least one coefficient"
        raise InvalidInputError(message, field)
    if len(values) > MAX_ORDER + 1:
        message = f"polynomials above degree {MAX_ORDER} are not supported"
        raise InvalidInputError(message, field)
    for index, value in enumerate(values):
        if not abs(value) <= LARGEST:
            message = f"coefficients must be finite and at most {LARGEST:g} in magnitude"
            raise InvalidInputError(message, f"{field}/{index}")
        refuse_vanishing(value, f"{field}/{index}")
    first = next((index for index, value in enumerate(values) if value), len(values) - 1)
    return values[first:]


def _without_origin_noise(den: tuple[float, ...]) -> tuple[tuple[float, ...], int]:
    """Return the denominator with poles that are 0 but for rounding at 0, and their number.

    The magnitudes of the roots are the slopes of Newton's polygon, the upper hull of the
    coefficients' logarithms over their power. A gap of `ROUNDING` between two of them separates
    what the coefficients can tell from what they cannot, in any unit of time. The slow roots are
    the doubtful ones only where their coefficient is small as it was typed: 1e-15 s^2 + s + 1 has
    a fast pole beyond doubt.
    """
    powers = [k for k, value in enumerate(reversed(den)) if value]
    if powers[0] > 0 or len(den) < 2 or not _is_small(den[-1], den):
        return den, 0
    if len(den) == 2:  # no other pole to be slow beside: a slow lag, or else what is left of 0
        return ((den[0], 0.0), 1) if den[0] * den[1] < 0 else (den, 0)
    logs = [math.log(abs(den[len(den) - 1 - k])) for k in powers]
    hull: list[int] = []
    for index in range(len(powers)):
        while len(hull) > 1 and _above(powers, logs, hull[-2], hull[-1], index):
            hull.pop()
        hull.append(index)
    sizes = [(logs[a] - logs[b]) / (powers[b] - powers[a]) for a, b in itertools.pairwise(hull)]
    gap = next(
        (at for at in range(len(sizes) - 1) if sizes[at + 1] - sizes[at] > math.log(ROUNDING)), None
    )
    if gap is None:
        return den, 0
    count = powers[hull[gap + 1]]
    if not all(_is_small(value, den) for value in den[len(den) - count :]):
        return den, 0
    return (*den[: len(den) - count], *(0.0,) * count), count


def _above(powers: list[int], logs: list[float], a: int, b: int, c: int) -> bool:
    """Whether point b lies on or below the line from a to c."""
    return (logs[b] - logs[a]) * (powers[c] - powers[a]) <= (logs[c] - logs[a]) * (
        powers[b] - powers[a]
    )


def _without_leading_noise(
    num: tuple[float, ...], den: tuple[float, ...]
) -> tuple[tuple[float, ...], int]:
    """Return the numerator without leading coefficients that are rounding, and their number.

    Such a zero lies `ROUNDING` times beyond all poles and all other zeros.
    """
    dropped = 0
    while len(num) > 1 and num[1] and _is_small(num[0], num):
        fastest = max((float(abs(pole)) for pole in np.roots(den)), default=0.0)
        others = max((float(abs(zero)) for zero in np.roots(num[1:])), default=0.0)
        if abs(num[1] / num[0]) <= ROUNDING * max(fastest, others) or not fastest:
            break
        num, dropped = num[1:], dropped + 1
    return num, dropped


def _is_small(value: float, among: tuple[float, ...]) -> bool:
    return abs(value) * ROUNDING <= max(map(abs, among))


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _trailing_zeros(values: tuple[float, ...]) -> int:
    count = 0
    for value in reversed(values):
        if value != 0:
            break
        count += 1
    return count


def _quotient(
    num: tuple[float, ...], den: tuple[float, ...], s: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """num(s)/den(s) by Horner's rule; a pole reads as huge instead of dividing by zero."""
    below = _polynomial_at(den, s)
    if np.count_nonzero(below) < below.size:
        below = np.where(below == 0, HARDLY_ZERO, below)
    return np.asarray((_polynomial_at(num, s) if len(num) > 1 else num[0]) / below)


def _polynomial_at(
    coefficients: tuple[float, ...], s: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    if len(coefficients) == 1:
        return np.full_like(s, coefficients[0])
    value = coefficients[0] * s + coefficients[1]
    for coefficient in coefficients[2:]:
        value = value * s + coefficient
    return value
