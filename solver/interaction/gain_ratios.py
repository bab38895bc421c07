"""Ratios of gains by which slow integral action is unstable: D-stability of a static gain, refuted.

Slow poles of integral control u = -(eps/s) D y are -eps times the eigenvalues of D G. A diagonal
D > 0 for which one of them has a negative real part is reached from any gains by reducing some, so
that none stay stable. Whether one exists is sought: the greatest argument of an eigenvalue over
log D, from the best of many drawn D on, along its gradient. With D G v = lambda v, w^H D G =
lambda w^H the derivative of log lambda with respect to log d_i is conj(w_i) v_i/(w^H v); rows of
the inverse of the v are w^H/(w^H v).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["unstable_speeds"]

DRAWN = 500
REFINED = 6
FARTHEST = 6.0  # decades to either side, more than loops differ in speed
CLEAR = 1e-7  # rad beyond a right angle, far more than rounding makes
PLAIN = 2  # digits that a reader can type


def unstable_speeds(gain: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return v, (n,), 0 <= v <= 1, for which diag(v/g_ii) G has an eigenvalue on the wrong side.

    v_i is how fast loop i is alone, d_i g_ii; the largest is 1, loops that do not matter have 0.
    None where no such v was found.

    Parameters
    ----------
    gain : (n, n)
        Static gain with a positive diagonal.

    """
    from scipy import linalg  # noqa: PLC0415 - what reads requests needs neither
    from scipy.optimize import minimize  # noqa: PLC0415

    n = len(gain)
    # Units of the outputs move D alone, those of the inputs nothing.
    balanced, _ = linalg.matrix_balance(gain / np.diag(gain)[:, None], permute=False)
    G = np.asarray(balanced, dtype=np.float64)
    reach = FARTHEST * math.log(10)
    starts = np.random.default_rng(0).uniform(-0.5, 0.5, (DRAWN, n)) * reach
    starts[0] = 0.0
    values = np.linalg.eigvals(np.exp(starts)[:, :, None] * G)
    best = np.argsort(-np.abs(np.angle(values)).max(axis=1), kind="stable")[:REFINED]

    def steepest(y: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        values, right = np.linalg.eig(np.exp(y)[:, None] * G)
        at = int(np.argmax(np.abs(np.angle(values))))
        angle = float(np.angle(values[at]))
        slope = np.imag(np.linalg.pinv(right)[at] * right[:, at])
        return -abs(angle), -math.copysign(1.0, angle) * slope

    for start in starts[best]:
        found = minimize(steepest, start, jac=True, method="L-BFGS-B", bounds=[(-reach, reach)] * n)
        v = np.exp(found.x)
        if _is_unstable(v, G):
            return _plain(v, G)
    return None


def _is_unstable(v: NDArray[np.float64], G: NDArray[np.float64]) -> bool:
    from scipy import linalg  # noqa: PLC0415

    scaled, _ = linalg.matrix_balance(v[:, None] * G, permute=False)
    values = np.linalg.eigvals(scaled)
    sound = np.abs(values) > np.finfo(float).eps * len(v) * np.linalg.norm(scaled, 2) / CLEAR
    return bool((np.abs(np.angle(values[sound])) > math.pi / 2 + CLEAR).any())


def _plain(v: NDArray[np.float64], G: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return v without the loops that do not matter, of few digits where these serve too."""
    for loop in np.argsort(v):
        less = np.where(np.arange(len(v)) == loop, 0.0, v)
        if _is_unstable(less, G):
            v = less
    short = np.array([float(f"{each:.{PLAIN}g}") for each in v / v.max()])
    return short if _is_unstable(short, G) else v / v.max()
