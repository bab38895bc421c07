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
from solver.optimality.infeasibility import ROUNDING, least_weights

__all__ = ["demands", "narrow"]

MARGIN = 1e-13  # of the sum of the moduli in a cut, for rounding; see docs/optimality.md
HALVINGS = 40
NEVER = 1e300  # right side of a condition that says nothing
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
def narrow(low, high, cut, p, points, reach, signs, cone, weight, target, known):
    m, ways = low.size, cut[0].shape[1]
    count = points.size * ways
    a = np.empty((count + cone.shape[0], m))
    b = np.empty(count + cone.shape[0])
    bends = np.empty((count + cone.shape[0], 3**m))
    _linearise(low, high, cut, p, points, reach, signs, cone, a, b, bends)
    w, e = least_weights(a, b)
    gain = np.zeros(m)
    total = np.zeros(3**m)
    size = 0.0
    room = np.full(points.size, math.inf)
    for k in range(b.size):
        if w[k] > 0.0:
            largest = 0.0
            for i in range(total.size):
                total[i] += w[k] * bends[k, i]
                largest = max(largest, abs(bends[k, i]))
            size += w[k] * largest
    rest = total.max() + ROUNDING * size
    if rest < 0.0:
        return True, target, e, gain, room
    share = np.zeros(count)
    for k in range(count):
        if w[k] > 0.0:
            point, way = k // ways, k % ways
            share[k] = w[k] * _least_length(
                low, high, points[point], cut[1][point, way], cut[2][point, way], signs
            )
    s = _excluded_up_to(rest, p, points, share, weight, target, known)
    _gains(total, low, high, gain)
    for k in range(count):
        value = b[k]
        for i in range(m):
            value += a[k, i] * e[i]
        room[k // ways] = min(room[k // ways], value)
    excluded = not _tighten(low, high, total, bends)
    return excluded, target if excluded else s, e, gain, room


@compiled
def _gains(total, low, high, gain):
    """How much less the greatest coefficient is in the halves of each variable, on average."""
    m = gain.size
    most = total.max()
    for i in range(m):
        step = 3 ** (m - 1 - i)
        t = 1.0 / (1.0 + math.sqrt(high[i] / low[i]))  # of the geometric middle
        below, above = -math.inf, -math.inf
        for at in range(total.size):
            if at // step % 3 == 0:
                first, second, third = total[at], total[at + step], total[at + 2 * step]
                left = first + t * (second - first)
                right = second + t * (third - second)
                middle = left + t * (right - left)
                below = max(below, first, left, middle)
                above = max(above, middle, right, third)
        gain[i] = most - 0.5 * (below + above)


@compiled
def _ends(low, high, at, sign, c, squares):
    """Bernstein coefficients of degrees (2, 2) of c = sign (k + m/s) and |c|^2 over k and m."""
    inverse = 1.0 / at
    for i in range(3):
        k = 0.5 * ((2 - i) * low[0] + i * high[0])
        k2 = low[0] * high[0] if i == 1 else k * k
        for j in range(3):
            m = 0.5 * ((2 - j) * low[1] + j * high[1])
            m2 = low[1] * high[1] if j == 1 else m * m
            c[3 * i + j] = sign * (k + m * inverse)
            squares[3 * i + j] = (
                k2 + 2.0 * k * m * inverse.real
                + m2 * (inverse.real * inverse.real + inverse.imag * inverse.imag)
            )


@compiled
def _coefficients(form, c, squares, out):
    """Bernstein coefficients of psi^H form psi."""
    if form.shape[0] == 2:
        for i in range(9):
            out[i] = (
                form[0, 0].real + 2.0 * (form[0, 1] * c[0, i]).real
                + form[1, 1].real * squares[0, i]
            )
        return
    for j in range(9):
        cj, sj = c[1, j], squares[1, j]
        plain = form[0, 0].real + 2.0 * (form[0, 2] * cj).real + form[2, 2].real * sj
        whole = form[1, 1].real + 2.0 * (form[1, 3] * cj).real + form[3, 3].real * sj
        mixed = form[0, 1] + form[0, 3] * cj + form[2, 1] * np.conj(cj) + form[2, 3] * sj
        for i in range(9):
            out[9 * i + j] = plain + 2.0 * (mixed * c[0, i]).real + whole * squares[0, i]


@compiled
def _middle(form, c):
    """psi^H form psi in the middle of the box."""
    if form.shape[0] == 2:
        psi = np.array([1.0 + 0j, c[0, 4]])
    else:
        psi = np.array([1.0 + 0j, c[0, 4], c[1, 4], c[0, 4] * c[1, 4]])
    total = 0.0
    for i in range(psi.size):
        for j in range(psi.size):
            total += (np.conj(psi[i]) * form[i, j] * psi[j]).real
    return total


@compiled
def _linearise(low, high, cut, p, points, reach, signs, cone, a, b, bends):
    """Fill in the linear conditions b + a e >= 0 over the box, relative to the demand."""
    square, norm, sizes = cut
    m, ways = low.size, square.shape[1]
    count = points.size * ways
    controllers = signs.size
    c = np.empty((controllers, 9), np.complex128)
    squares = np.empty((controllers, 9))
    largest = np.empty(controllers)
    places = _places(m)
    form = np.empty(square.shape[2:], np.complex128)
    for point in range(points.size):
        size = 1.0
        for i in range(controllers):
            own = slice(2 * i, 2 * i + 2)
            _ends(low[own], high[own], points[point], signs[i], c[i], squares[i])
            largest[i] = high[2 * i] + high[2 * i + 1] / abs(points[point])
            size += largest[i] * reach[point]
        for way in range(ways):
            k = ways * point + way
            length = sizes[point, way, 0]
            for i in range(controllers):
                length += sizes[point, way, 1 + i] * largest[i]
            unit = p[point] * _middle(norm[point, way], c)
            if not unit > 0.0:
                bends[k] = NEVER
                a[k] = 0.0
                b[k] = NEVER
                continue
            for i in range(form.shape[0]):
                for j in range(form.shape[0]):
                    form[i, j] = square[point, way, i, j] - p[point] * norm[point, way, i, j]
            _coefficients(form, c, squares, bends[k])
            margin = MARGIN * (size * size + p[point]) * length * length
            for i in range(bends.shape[1]):
                bends[k, i] = (bends[k, i] + margin) / unit
            b[k] = _slopes(bends[k], places, a[k])
    for row in range(cone.shape[0]):
        value, norms = 0.0, 0.0
        for i in range(m):
            value += cone[row, i] * 0.5 * (low[i] + high[i])
            norms += abs(cone[row, i]) * 0.5 * (low[i] + high[i])
        k = count + row
        for i in range(m):
            a[k, i] = cone[row, i] * 0.5 * (high[i] - low[i]) / norms
        b[k] = value / norms + MARGIN
        for at in range(bends.shape[1]):
            bends[k, at] = b[k]
            for i in range(m):
                bends[k, at] += a[k, i] * places[at, i]


@compiled
def _least_length(low, high, at, norm, sizes, signs):
    """Lower bound of |Z|^2 over the box, relative to its value in the middle."""
    c = np.empty((signs.size, 9), np.complex128)
    squares = np.empty((signs.size, 9))
    lengths = np.empty(9**signs.size)
    length = sizes[0]
    for i in range(signs.size):
        own = slice(2 * i, 2 * i + 2)
        _ends(low[own], high[own], at, signs[i], c[i], squares[i])
        length += sizes[1 + i] * (high[2 * i] + high[2 * i + 1] / abs(at))
    _coefficients(norm, c, squares, lengths)
    return max(lengths.min() - MARGIN * length * length, 0.0) / _middle(norm, c)


@compiled
def _places(m):
    """Place -1, 0, 1 in each variable of the Bernstein coefficients, (3^m, m)."""
    places = np.empty((3**m, m))
    for at in range(3**m):
        rest = at
        for i in range(m - 1, -1, -1):
            places[at, i] = rest % 3 - 1
            rest //= 3
    return places


@compiled
def _slopes(bends, places, slope):
    """Mean slopes, and the most that the coefficients are above a linear function with them."""
    size, m = places.shape
    slope[:] = 0.0
    for at in range(size):
        for i in range(m):
            slope[i] += bends[at] * places[at, i]
    for i in range(m):
        slope[i] /= 2 * 3 ** (m - 1)
    most = -math.inf
    for at in range(size):
        value = bends[at]
        for i in range(m):
            value -= slope[i] * places[at, i]
        most = max(most, value)
    return most


@compiled
def _excluded_up_to(rest, p, points, share, weight, target, known):
    """Greatest s up to `target` that the weights exclude from the box, at least `known`.

    Only the demand depends on s: what a condition lacks is share (p(s)/p - 1) more.
    """
    lowest, highest = max(known, LOWEST), target
    for turn in range(HALVINGS):
        middle = lowest if turn == 0 else 0.5 * (lowest + highest)
        value = rest
        for k in range(share.size):
            if share[k] > 0.0:
                point = k // (share.size // points.size)
                more = _demand(middle, points[point], weight[0], weight[1]) / p[point]
                value += share[k] * (1.0 - more * (1.0 - ROUNDING))
        if value < 0.0:
            lowest = middle
        elif turn == 0:
            return known
        else:
            highest = middle
    return lowest


@compiled
def _tighten(low, high, total, bends):
    """Shrink the box to what each condition, and their weighted sum, leaves; False if nothing."""
    m = low.size
    start, width = low.copy(), high - low
    most = np.empty(3)
    for k in range(bends.shape[0] + 1):
        row = bends[k] if k < bends.shape[0] else total
        size = 0.0
        for at in range(row.size):
            size = max(size, abs(row[at]))
        for i in range(m):
            step = 3 ** (m - 1 - i)
            most[:] = -math.inf
            for at in range(row.size):
                place = at // step % 3
                most[place] = max(most[place], row[at])
            for place in range(3):
                most[place] += ROUNDING * size
            low[i] = max(low[i], start[i] + width[i] * _negative(most) - ROUNDING * high[i])
            most[:] = most[::-1].copy()
            left = 1.0 - _negative(most)
            high[i] = min(high[i], start[i] + width[i] * left + ROUNDING * high[i])
            if not low[i] <= high[i]:
                return False
    return True


@compiled
def _negative(bends):
    """A t for which the quadratic with these Bernstein coefficients is negative on [0, t]."""
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


