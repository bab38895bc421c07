r"""Compiled: what conditions on the controllers leave of a box of PI settings.

The weighted sum of conditions P_k >= 0, w >= 0, is one again. If all its Bernstein coefficients
over a box are negative, no settings in the box meet all of them. The weights are those that exclude
the linear conditions above the P_k (`solver.optimality.infeasibility`); how they were found is of
no matter to the proof.
"""

import math
from typing import NamedTuple

import numpy as np

from solver.mu.workspace import compiled
from solver.optimality.enclosure import ROUNDING, least_length, linearise
from solver.optimality.infeasibility import least_weights

__all__ = ["Demand", "demands", "narrow", "weighted"]

HALVINGS = 40
LOWEST = -60.0  # s of no interest below


class Demand(NamedTuple):
    """What s makes of the demand: the logarithm of tau_P, or of mu at a given tau_P.

    Attributes
    ----------
    max_peak, offset : float
        M and A of w_P.
    tau_p : float
        Its tau_P where mu is sought; 0 where tau_P is.

    """

    max_peak: float
    offset: float
    tau_p: float


@compiled
def demands(s, points, demand):
    """|w_P|^2, over mu^2 = e^2s where mu is sought, less its rounding, (k,).

    `points` (k,) are in the closed right half plane. It falls in s there, for tau_P = e^s too: log
    |(1 + z)/(1 + r z)| rises with |z| for Re z >= 0 and 0 <= r < 1, here z = 1/(tau_P point) and
    r = A/M.
    """
    p = np.empty(points.size)
    for k in range(points.size):
        p[k] = _demand(s, points[k], demand)
    return p


@compiled
def _demand(s, at, demand):
    tau, level = math.exp(s), 1.0
    if demand.tau_p > 0.0:
        tau, level = demand.tau_p, tau * tau
    real, imag = tau * at.real, tau * at.imag
    above = (real + 1.0) * (real + 1.0) + imag * imag
    below = real + demand.offset / demand.max_peak
    square = level * demand.max_peak * demand.max_peak * (below * below + imag * imag)
    return above / square * (1.0 - ROUNDING)


@compiled
def narrow(low, high, cut, p, points, reach, signs, cone, demand, target, known):
    """Exclude a box, or tell what is possible in it.

    Parameters
    ----------
    low, high : (m,)
        The box, > 0; tightened in place to what each condition leaves.
    cut, p, points, reach, signs, cone
        As in `linearise`, at the target.
    demand : Demand
        What s makes of the demand.
    target, known : float
        s to be excluded, and a lower bound of s over the box.

    Returns
    -------
    excluded : bool
        No settings in the box reach the target.
    s : float
        Lower bound of s over the box.
    e : (m,)
        Where, in -1..1 of the box as it was, the linear conditions are met best.
    room : (k,)
        By how much each point's conditions are met at `e`.

    """
    m, several = low.size, cut.above.shape[1]
    count = points.size * several
    a = np.empty((count + cone.shape[0], m))
    b = np.empty(count + cone.shape[0])
    bends = np.empty((count + cone.shape[0], 3**m))
    linearise(low, high, cut, p, points, reach, signs, cone, a, b, bends)
    w, e = least_weights(a, b)
    room = np.full(points.size, math.inf)
    total = np.zeros(3**m)
    rest, rounding = weighted(w, bends, total)
    if rest < 0.0:
        return True, target, e, room
    share = np.zeros(count)
    for k in range(count):
        value = b[k]
        for i in range(m):
            value += a[k, i] * e[i]
        at, turn = k // several, k % several
        room[at] = min(room[at], value)
        if w[k] > 0.0:
            norm, sizes = cut.norm[at, turn], cut.size[at, turn]
            share[k] = w[k] * least_length(low, high, points[at], norm, sizes, signs)
    s = _excluded_up_to(rest, p, points, share, demand, target, known)
    excluded = not _tighten(low, high, total, rounding, bends)
    return excluded, target if excluded else s, e, room


@compiled
def weighted(w, bends, total):
    """Fill in the weighted sum of conditions; returns its greatest coefficient, rounded up.

    Also by how much it was.
    """
    size = 0.0
    total[:] = 0.0
    for k in range(w.size):
        if w[k] > 0.0:
            largest = 0.0
            for at in range(total.size):
                total[at] += w[k] * bends[k, at]
                largest = max(largest, abs(bends[k, at]))
            size += w[k] * largest
    return total.max() + ROUNDING * size, ROUNDING * size


@compiled
def _excluded_up_to(rest, p, points, share, demand, target, known):
    """Greatest s up to `target` that the weights exclude from the box, at least `known`.

    Of the conditions at the target, which hold below it, only the demand depends on s: what one
    lacks is share (p(s)/p - 1) more.
    """
    lowest, highest = max(known, LOWEST), target
    for turn in range(HALVINGS):
        middle = lowest if turn == 0 else 0.5 * (lowest + highest)
        value = rest
        for k in range(share.size):
            if share[k] > 0.0:
                point = k // (share.size // points.size)
                more = _demand(middle, points[point], demand) / p[point]
                value += share[k] * (1.0 - more * (1.0 - ROUNDING))
        if value < 0.0:
            lowest = middle
        elif turn == 0:
            return known
        else:
            highest = middle
    return lowest


@compiled
def _tighten(low, high, total, rounding, bends):
    """Shrink the box to what each condition, and their weighted sum, leaves; False if nothing.

    The sum may err by `rounding`.
    """
    m = low.size
    start, width = low.copy(), high - low
    most = np.empty(3)
    for k in range(bends.shape[0] + 1):
        row = bends[k] if k < bends.shape[0] else total
        error = rounding
        if k < bends.shape[0]:
            error = ROUNDING * np.abs(row).max()
        for i in range(m):
            step = 3 ** (m - 1 - i)
            most[:] = -math.inf
            for at in range(row.size):
                place = at // step % 3
                most[place] = max(most[place], row[at])
            for place in range(3):
                most[place] += error
            low[i] = max(low[i], start[i] + width[i] * _negative(most) - ROUNDING * high[i])
            most[:] = most[::-1].copy()
            left = 1.0 - _negative(most)
            high[i] = min(high[i], start[i] + width[i] * left + ROUNDING * high[i])
            if not low[i] <= high[i]:
                return False
    return True


@compiled
def _negative(bends):
    """Return a t for which the quadratic with these coefficients is negative on [0, t]."""
    first, second, third = bends[0], bends[1], bends[2]
    if not first < 0.0:
        return 0.0
    if second < 0.0 and third < 0.0:
        return 1.0
    half = first - second
    root = half * half - first * (first - 2.0 * second + third)
    if not root >= 0.0:
        return 0.0
    t = (1.0 - ROUNDING) * first / (half - math.sqrt(root))
    left = first + t * (second - first)
    right = second + t * (third - second)
    return t if 0.0 < t < 1.0 and left < 0.0 and left + t * (right - left) < 0.0 else 0.0
