"""Relative input errors of plants against a nominal one: E = G^-1 (G_k - G).

A full block covers E where sigma_max(E) <= |w_I|; independent actuators (a diagonal block) only
where E is diagonal besides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ErrorCurve", "diagonal_part", "matrix_errors", "parallel_errors"]

# A nominal plant whose least singular value is below this part of its largest has no inverse.
SINGULAR = 1e-12


@dataclass(frozen=True, eq=False)
class ErrorCurve:
    """One source of error over frequency.

    Attributes
    ----------
    source : str
        What errs, in words.
    size : (k,) ndarray
        sigma_max of the relative input error; 0 where the record says nothing of this source.
    diagonal : (k,) ndarray
        The largest diagonal entry of the error: what independent actuators would explain.

    """

    source: str
    size: NDArray[np.float64]
    diagonal: NDArray[np.float64]


def matrix_errors(
    nominal: NDArray[np.complex128], other: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return sigma_max and the largest diagonal entry of E.

    Parameters
    ----------
    nominal : (k, n, n) ndarray
        G(j omega).
    other : (..., k, n, n) ndarray
        G_k(j omega).

    Returns
    -------
    tuple of (..., k) ndarray
        Infinite where the nominal plant is singular.

    """
    # Rows scaled to one, so that units of outputs decide nothing about singularity.
    rows = np.linalg.norm(nominal, axis=-1, keepdims=True)
    rows = np.where(rows > 0, rows, 1.0)
    scaled = nominal / rows
    s = np.linalg.svd(scaled, compute_uv=False)
    singular = s[..., -1] < SINGULAR * s[..., 0]
    safe = np.where(singular[..., None, None], np.eye(nominal.shape[-1]), scaled)
    E = np.linalg.solve(np.broadcast_to(safe, other.shape), (other - nominal) / rows)
    size = np.linalg.norm(E, 2, axis=(-2, -1)) if E.shape[-1] > 1 else np.abs(E[..., 0, 0])
    diagonal = np.max(np.abs(np.diagonal(E, axis1=-2, axis2=-1)), axis=-1)
    return np.where(singular, np.inf, size), np.where(singular, np.inf, diagonal)


def parallel_errors(
    n: int, nominal: NDArray[np.complex128], other: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the same for parallel plants, given as (..., 2, k): g and i.

    E is a parallel matrix then; its eigenvalues are the relative errors of g + (n-1) i and g - i.
    """
    g, i = nominal[..., 0, :], nominal[..., 1, :]
    dg, di = other[..., 0, :] - g, other[..., 1, :] - i
    with np.errstate(divide="ignore", invalid="ignore"):
        total = (dg + (n - 1) * di) / (g + (n - 1) * i)
        difference = (dg - di) / (g - i)
    total = np.where(np.isfinite(total), total, np.inf)
    difference = np.where(np.isfinite(difference), difference, np.inf)
    if n == 1:
        return np.abs(total), np.abs(total)
    diagonal = np.abs((total + (n - 1) * difference) / n)
    return np.maximum(np.abs(total), np.abs(difference)), diagonal


def diagonal_part(curves: list[ErrorCurve]) -> float:
    """Return the largest part that the diagonal takes of any error, 0 to 1."""
    shares = [
        float(np.min(np.where(curve.size > 0, curve.diagonal / np.maximum(curve.size, 1e-300), 1)))
        for curve in curves
    ]
    return min(shares, default=1.0)
