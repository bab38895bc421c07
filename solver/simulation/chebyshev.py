"""Polynomials on one step, held by their values at Chebyshev points of the second kind.

The points of a step of length h are ``h * NODES``; both ends belong to them. Barycentric
formulas: Berrut and Trefethen, SIAM Review 46 (2004) 501-517.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "DEGREE",
    "DIFFERENTIATION",
    "NODES",
    "QUADRATURE",
    "TO_COEFFICIENTS",
    "evaluation_matrix",
    "first_root",
    "roots",
]

# Measured on loops with and without dead time: 8 takes up to 2.5 times as many steps. From 14 on
# the exponentials that carry a polynomial across its step lose more digits than the tolerance
# allows (1e-9 there, 1e-12 here).
DEGREE = 10

_CHEBYSHEV = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
NODES: NDArray[np.float64] = (1 + _CHEBYSHEV) / 2
_WEIGHTS = (-1.0) ** np.arange(DEGREE + 1)
_WEIGHTS[[0, -1]] /= 2

# Values at the nodes -> coefficients of T_k(2 tau - 1); column k of the inverse is T_k there.
TO_COEFFICIENTS: NDArray[np.float64] = np.asarray(
    np.linalg.inv(np.polynomial.chebyshev.chebvander(_CHEBYSHEV, DEGREE)), dtype=np.float64
)


def _differentiation() -> NDArray[np.float64]:
    distance = NODES[:, None] - NODES[None, :]
    np.fill_diagonal(distance, 1.0)
    matrix = (_WEIGHTS[None, :] / _WEIGHTS[:, None]) / distance
    np.fill_diagonal(matrix, 0.0)
    # Rows sum to zero: the derivative of a constant (the accurate form of the diagonal).
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix


# Values at the nodes -> derivative by tau = t/h at the nodes.
DIFFERENTIATION: NDArray[np.float64] = _differentiation()

_INTEGRALS = np.array([0.0 if k % 2 else 1 / (1.0 - k * k) for k in range(DEGREE + 1)])
# Weights of the integral over tau in [0, 1], exact for degree DEGREE (Clenshaw-Curtis).
QUADRATURE: NDArray[np.float64] = _INTEGRALS @ TO_COEFFICIENTS


def evaluation_matrix(points: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix that takes node values to values at `points`.

    Parameters
    ----------
    points : (k,) array_like
        Places tau = t/h; 0..1 is the step itself.

    Returns
    -------
    (k, DEGREE + 1) ndarray

    """
    places = np.atleast_1d(np.asarray(points, dtype=float))
    distance = places[:, None] - NODES[None, :]
    exact = distance == 0
    distance[exact] = 1.0
    matrix: NDArray[np.float64] = _WEIGHTS / distance
    matrix /= matrix.sum(axis=1, keepdims=True)
    hit = exact.any(axis=1)
    matrix[hit] = exact[hit]
    return matrix


_FINE_PLACES = np.linspace(0.0, 1.0, 4 * DEGREE + 1)
_FINE = evaluation_matrix(_FINE_PLACES)


def first_root(values: NDArray[np.float64], tolerance: float) -> float | None:
    """Return the first place where a polynomial becomes positive, or None.

    Excursions above zero that are not seen at 4 DEGREE + 1 even places are missed.

    Parameters
    ----------
    values : (DEGREE + 1,) ndarray
        Values at the nodes.
    tolerance : float
        Excursions up to this height do not count: rounding after an earlier crossing.

    Returns
    -------
    float or None
        tau in 0..1; 0 where it is positive from the start.

    """
    fine = _FINE @ values
    above = np.flatnonzero(fine > tolerance)
    if above.size == 0:
        return None
    below = np.flatnonzero(fine[: above[0]] <= 0)
    if below.size == 0:
        return 0.0
    bracket = _FINE_PLACES[below[-1]], _FINE_PLACES[below[-1] + 1]
    return float(
        scipy.optimize.brentq(lambda tau: float((evaluation_matrix(tau) @ values)[0]), *bracket)
    )


def roots(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the places tau in 0..1 where a polynomial given at the nodes is zero, ascending."""
    coefficients = TO_COEFFICIENTS @ values
    size = float(np.abs(coefficients).max(initial=0.0))
    if size == 0:
        return np.empty(0)
    # Coefficients below rounding would make spurious huge roots.
    significant = np.flatnonzero(np.abs(coefficients) > 1e-15 * size)
    found = np.polynomial.chebyshev.chebroots(coefficients[: significant[-1] + 1])
    real = found[np.abs(found.imag) < 1e-7].real  # a double root splits by the root of rounding
    places = (1 + real) / 2
    return np.sort(places[(places >= 0) & (places <= 1)])
