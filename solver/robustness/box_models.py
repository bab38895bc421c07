"""Taylor models of the second degree in several variables, many boxes side by side.

A function of z, -1 <= z_i <= 1, is a polynomial of degree two at most and a radius that holds the
rest and all rounding: |f(z) - p(z)| <= radius. Frequency is one of the variables, the parameters of
a plant that spread are the others. Every operation is done for all boxes at once and adds
`ROUNDING` times the magnitudes that went into it.

K. Makino and M. Berz, "Taylor models and other validated functional inclusion methods", Int. J.
Pure Appl. Math. 4 (2003).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ROUNDING", "BoxModel", "constant", "disc", "monomials", "phasor", "variable"]

# A sum of up to 16 complex products errs by 20 units of rounding, 2.3e-15, of its magnitudes.
ROUNDING = 1e-14


class Monomials(NamedTuple):
    """Numbers of the coefficients: 0 is the constant, then the variables, then their products.

    Attributes
    ----------
    variables : int
        Their number.
    pairs : tuple of (int, int)
        The variables of each product of two.

    """

    variables: int
    pairs: tuple[tuple[int, int], ...]

    @property
    def coefficients(self) -> int:
        """Coefficients of a polynomial."""
        return 1 + self.variables + len(self.pairs)


@cache
def monomials(variables: int) -> Monomials:
    """Return the monomials of degree two at most."""
    return Monomials(variables, tuple(itertools.combinations_with_replacement(range(variables), 2)))


@dataclass(frozen=True, eq=False)
class BoxModel:
    """Taylor models of one function over k boxes.

    Parameters
    ----------
    P : (coefficients, k) complex
        As `Monomials` numbers them.
    radius : (k,)
        Infinite where nothing is known.

    """

    P: NDArray[np.complex128]
    radius: NDArray[np.float64]

    @property
    def variables(self) -> int:
        """Number of the variables."""
        return next(m for m in itertools.count() if monomials(m).coefficients == len(self.P))

    def sizes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the magnitudes of the constant, of the linear and of the quadratic part, (k,)."""
        size, m = np.abs(self.P), self.variables
        return size[0], size[1 : m + 1].sum(axis=0), size[m + 1 :].sum(axis=0)

    def norm(self) -> NDArray[np.float64]:
        """Return a bound of the magnitude over each box, (k,)."""
        return np.asarray((np.abs(self.P).sum(axis=0) + self.radius) * (1 + ROUNDING))

    def __add__(self, other: BoxModel) -> BoxModel:
        P = self.P + other.P
        lost = ROUNDING * (np.abs(self.P).sum(axis=0) + np.abs(other.P).sum(axis=0))
        return BoxModel(P, self.radius + other.radius + lost)

    def __mul__(self, other: BoxModel) -> BoxModel:
        A, B, (m, pairs) = self.P, other.P, monomials(self.variables)
        P = A[0] * B + A * B[0]
        P[0] = A[0] * B[0]
        for number, (i, j) in enumerate(pairs, start=m + 1):
            P[number] += A[i + 1] * B[j + 1]
            if i != j:
                P[number] += A[j + 1] * B[i + 1]
        a0, a1, a2 = self.sizes()
        b0, b1, b2 = other.sizes()
        a, b = a0 + a1 + a2, b0 + b1 + b2
        with np.errstate(invalid="ignore"):  # 0 times an infinite radius: nothing is known
            radius = (
                self.radius * (b + other.radius)
                + other.radius * a
                + a1 * b2
                + a2 * (b1 + b2)
                + ROUNDING * a * b
            )
        return BoxModel(P, _known(radius))

    def times(self, factor: NDArray[np.complex128] | NDArray[np.float64] | complex) -> BoxModel:
        """Return the function times a number, one for all boxes or one a box."""
        size = np.abs(factor)
        with np.errstate(invalid="ignore"):
            radius = size * (self.radius + ROUNDING * np.abs(self.P).sum(axis=0))
        return BoxModel(self.P * factor, _known(radius))

    def conj(self) -> BoxModel:
        """Return the complex conjugate: the variables are real."""
        return BoxModel(self.P.conj(), self.radius)

    def reciprocal(self) -> BoxModel:
        """Return 1/f: (1 - d + d^2)/f_0 with f = f_0 (1 + d), the rest below |d|^3/(1 - |d|)."""
        middle = np.where(self.P[0] == 0, 1.0, self.P[0])
        unit = self.times(1 / middle)
        d = BoxModel(unit.P.copy(), unit.radius)
        d.P[0] = 0.0
        size = d.norm()
        sound = (size < 1) & (self.P[0] != 0)
        with np.errstate(over="ignore", invalid="ignore"):
            rest = np.where(sound, size**3 / np.where(sound, 1 - size, 1.0), np.inf)
        square = d * d
        P = square.P - d.P
        P[0] += 1
        radius = d.radius + square.radius + rest + ROUNDING * (2 + 2 * size)
        return BoxModel(P, radius).times(1 / middle)


def _known(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isnan(radius), np.inf, radius)


def constant(value: NDArray[np.complex128], variables: int) -> BoxModel:
    """Return a number for each box, (k,)."""
    P = np.zeros((monomials(variables).coefficients, value.size), dtype=complex)
    P[0] = value
    return BoxModel(P, np.zeros(value.size))


def variable(
    middle: NDArray[np.float64], half: NDArray[np.float64], number: int, variables: int
) -> BoxModel:
    """Return middle + half z of variable `number`, (k,) each; `half` a rounding wider."""
    model = constant(np.asarray(middle, dtype=complex), variables)
    model.P[number + 1] = half * (1 + ROUNDING) + ROUNDING * np.abs(middle)
    return model


def disc(boxes: int, variables: int) -> BoxModel:
    """Return every number of magnitude one at most."""
    model = constant(np.zeros(boxes, dtype=complex), variables)
    return BoxModel(model.P, np.ones(boxes))


def phasor(angle: BoxModel) -> BoxModel:
    """Return exp(-j x) of a real x; any phase where x varies by more than one.

    exp(-j d) = 1 - j d - d^2/2, the rest below |d|^3/6: d is real.
    """
    d = BoxModel(angle.P.copy(), angle.radius)
    d.P[0] = 0.0
    size = d.norm()
    square = d * d
    P = -1j * d.P - 0.5 * square.P
    P[0] += 1
    with np.errstate(over="ignore", invalid="ignore"):
        radius = d.radius + 0.5 * square.radius + size**3 / 6 + ROUNDING * (2 + size + size**2)
    middle = angle.P[0].real
    turn = np.exp(-1j * middle)
    turned = BoxModel(P, _known(radius)).times(turn)
    # The phase itself is as right as its angle.
    close = BoxModel(turned.P, turned.radius + ROUNDING * (1 + np.abs(middle)) * (1 + size))
    any_phase = ~(size <= 1)
    P = np.where(any_phase, 0.0, close.P)
    return BoxModel(P, np.where(any_phase, 1.0, close.radius))
