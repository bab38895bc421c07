r"""Compiled: what conditions on the controllers leave of a box of PI settings.

The variables are k and k/tau_I of each controller, in which c(s) = k + (k/tau_I)/s is linear. A
cut (`solver.optimality.cuts`) is then a condition  p <= q(variables)  with q quadratic and convex;
over a box with centre and half widths r it implies the linear one

    p <= q(centre) + q'(centre) d + sum_ij |q''_ij| r_i r_j / 2,      |d_i| <= r_i,

exact up to the square of the width. The cuts of all points together, with the limits of tau_I,
exclude the box if no d meets them all.
"""

import math

import numpy as np

from solver.mu.workspace import compiled
from solver.optimality.cuts import NEVER
from solver.optimality.infeasibility import ROUNDING, excludes, least_weights

__all__ = ["demands", "in_settings", "narrow"]

MARGIN = 1e-13  # of the sum of the moduli in a cut, for rounding; see docs/optimality.md
HALVINGS = 40
LOWEST = -60.0  # s of no interest below


@compiled
def demands(s, points, max_peak, offset):
    """|w_P|^2 at `points` (k,) of the closed right half plane, for tau_P = e^s, less its rounding.

    It falls in s there: log |(1 + z)/(1 + r z)| rises with |z| for Re z >= 0 and 0 <= r < 1, here
    z = 1/(tau_P point) and r = A/M.
    """
    p = np.empty(points.size)
    for k in range(points.size):
        p[k] = _demand(s, points[k], max_peak, offset)
    return p


@compiled
def _demand(s, at, max_peak, offset):
    tau = math.exp(s)
    real, imag = tau * at.real, tau * at.imag
    above = (real + 1.0) * (real + 1.0) + imag * imag
    below = real + offset / max_peak
    square = max_peak * max_peak * (below * below + imag * imag)
    return above / square * (1.0 - ROUNDING)


@compiled
def in_settings(beta, M, signs, points):
    """Linear (k, m) and quadratic (k, m, m) coefficients of cuts in the variables of the box."""
    m = 2 * signs.size
    linear = np.empty((points.size, m))
    quadratic = np.empty((points.size, m, m))
    for k in range(points.size):
        for i in range(m):
            unit = signs[i // 2] * (1.0 + 0j if i % 2 == 0 else 1.0 / points[k])
            linear[k, i] = 2.0 * (unit * beta[k, i // 2]).real
            for j in range(m):
                other = signs[j // 2] * (1.0 + 0j if j % 2 == 0 else 1.0 / points[k])
                quadratic[k, i, j] = (np.conj(unit) * other * M[k, i // 2, j // 2]).real
    return linear, quadratic


@compiled
def narrow(low, high, cut, p, points, reach, cone, weight, target, known):
    """Exclude a box, or tell what is possible in it.

    Parameters
    ----------
    low, high : (m,)
        The box, > 0; tightened in place to what each condition leaves.
    cut : tuple
        constant (k,), linear (k, m) and quadratic (k, m, m) of the cuts; several may stand for a
        point.
    p, points, reach : (k,)
        The demand at the target, the point of each cut, and a bound of the norm of I + G C and
        its derivative there for controllers of modulus 1.
    cone : (rows, m)
        Conditions cone v >= 0.
    weight : tuple
        M, A of w_P.
    target, known : float
        s to be excluded, and a lower bound of s over the box.

    Returns
    -------
    excluded : bool
        No settings in the box reach the target.
    s : float
        Lower bound of s over the box.
    e : (m,)
        Where, in -1..1 of the box as it was, the conditions are met best.
    hidden : (m,)
        What the curvature in each variable adds to the conditions that matter.
    room : float
        By how much the conditions are met there, with the curvature added.
    w : (k,)
        Weights of the cuts.

    """
    m, count = low.size, points.size
    a = np.empty((count + cone.shape[0], m))
    b = np.empty(count + cone.shape[0])
    _linearise(low, high, cut, p, points, reach, cone, a, b)
    w, e = least_weights(a, b)
    hidden = np.zeros(m)
    if excludes(w, a, b):
        return True, target, e, hidden, 0.0, w[:count]
    s = _excluded_up_to(w, a, b, p, points, weight, target, known)
    for k in range(count):
        if w[k] > 0.0:
            for i in range(m):
                for j in range(m):
                    widths = (high[i] - low[i]) * (high[j] - low[j])
                    hidden[i] += 0.25 * w[k] / p[k] * abs(cut[2][k, i, j]) * widths
    room = math.inf
    for k in range(b.size):
        value = b[k]
        for i in range(m):
            value += a[k, i] * e[i]
        room = min(room, value)
    excluded = not _tighten(low, high, w, a, b)
    return excluded, target if excluded else s, e, hidden, room, w[:count]


@compiled
def _linearise(low, high, cut, p, points, reach, cone, a, b):
    """Fill in the linear conditions b + a e >= 0 over the box, relative to the demand."""
    constant, linear, quadratic = cut
    m, count = low.size, points.size
    for k in range(count):
        value, size = constant[k] * (1.0 - p[k]), 1.0
        for i in range(0, m, 2):
            size += (high[i] + high[i + 1] / abs(points[k])) * reach[k]
        for i in range(m):
            middle, half = 0.5 * (low[i] + high[i]), 0.5 * (high[i] - low[i])
            value += linear[k, i] * middle
            slope = linear[k, i]
            for j in range(m):
                other = 0.5 * (low[j] + high[j])
                value += quadratic[k, i, j] * middle * other
                value += abs(quadratic[k, i, j]) * half * 0.5 * (high[j] - low[j])
                slope += 2.0 * quadratic[k, i, j] * other
            a[k, i] = slope * half / p[k]
        b[k] = NEVER if constant[k] >= NEVER else (value + MARGIN * size * size) / p[k]
    for row in range(cone.shape[0]):
        value, norm = 0.0, 0.0
        for i in range(m):
            value += cone[row, i] * 0.5 * (low[i] + high[i])
            norm += abs(cone[row, i]) * 0.5 * (low[i] + high[i])
        for i in range(m):
            a[count + row, i] = cone[row, i] * 0.5 * (high[i] - low[i]) / norm
        b[count + row] = value / norm + MARGIN


@compiled
def _excluded_up_to(w, a, b, p, points, weight, target, known):
    """Greatest s up to `target` that the weights exclude from the box, at least `known`.

    Only the demand depends on s: what a condition lacks is w (p(s)/p - 1) more.
    """
    rest = 0.0
    for k in range(b.size):
        rest += w[k] * (b[k] + ROUNDING * abs(b[k]))
    for i in range(a.shape[1]):
        slope, sizes = 0.0, 0.0
        for k in range(b.size):
            slope += w[k] * a[k, i]
            sizes += w[k] * abs(a[k, i])
        rest += abs(slope) + ROUNDING * sizes
    lowest, highest = max(known, LOWEST), target
    for turn in range(HALVINGS):
        middle = lowest if turn == 0 else 0.5 * (lowest + highest)
        value = rest
        for k in range(points.size):
            if w[k] > 0.0:
                share = _demand(middle, points[k], weight[0], weight[1]) / p[k]
                value += w[k] * (1.0 - share * (1.0 - ROUNDING))
        if value < 0.0:
            lowest = middle
        elif turn == 0:
            return known
        else:
            highest = middle
    return lowest


@compiled
def _tighten(low, high, w, a, b):
    """Shrink the box to what each condition, and their weighted sum, leaves; False if nothing."""
    count, m = a.shape
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    row = np.empty(m)
    for k in range(count + 1):
        base = size = 0.0
        row[:] = 0.0
        for other in range(k if k < count else 0, k + 1 if k < count else count):
            share = 1.0 if k < count else w[other]
            if share > 0.0:
                base += share * b[other]
                size += share * abs(b[other])
                for i in range(m):
                    row[i] += share * a[other, i]
                    size += share * abs(a[other, i])
        reach = base + ROUNDING * size
        for i in range(m):
            reach += abs(row[i])
        for i in range(m):
            # reach - |row_i| + row_i e_i >= 0
            if reach < 2.0 * abs(row[i]):
                edge = (abs(row[i]) - reach) / abs(row[i]) - ROUNDING
                if row[i] > 0.0:
                    low[i] = max(low[i], middle[i] + half[i] * edge - ROUNDING * high[i])
                else:
                    high[i] = min(high[i], middle[i] - half[i] * edge + ROUNDING * high[i])
                if not low[i] <= high[i]:
                    return False
    return True
