r"""Compiled: what the conditions on the controllers are over a box of PI settings.

The variables are k and m = k/tau_I of each controller, in which c(s) = k + m/s is linear. A
condition (`solver.optimality.cuts`) is a polynomial in them, at least 0, of degree 2 in each: a
Hermitian form in (1, c_1) x (1, c_2). Over a box it is the mean, with positive weights that depend
on the place, of its 3^m Bernstein coefficients, so it is at most the greatest of them; they exceed
it by the square of the width of the box at most (Garloff 1993). Each coefficient belongs to a
place, low, middle or high in each variable.
"""

import math

import numpy as np

from solver.mu.workspace import compiled, square

__all__ = ["ROUNDING", "least_length", "linearise"]

MARGIN = 1e-13  # of the sum of the moduli in a condition, for rounding; see docs/optimality.md
ROUNDING = 1e-12  # per term; sums of a few hundred of them err by 1e-13 at most
NEVER = 1e300  # left side of a condition that says nothing


@compiled
def linearise(low, high, cut, p, points, reach, signs, cone, a, b, bends):
    """Fill in the Bernstein coefficients of all conditions, and linear conditions above them.

    Parameters
    ----------
    low, high : (m,)
        The box, > 0.
    cut : Cuts
        With a second axis: several cuts a point.
    p, points, reach : (k,)
        The demand, the points, and a bound of the norm of I + G C and its derivative there for
        controllers of modulus 1.
    signs : (controllers,)
        Sign of each gain.
    cone : (rows, m)
        Conditions cone v >= 0.
    a, b : (conditions, m), (conditions,)
        Filled in: b + a e >= 0 where e in [-1, 1]^m is the place in the box. The cuts of the
        first point, those of the second, and so on; then the cone.
    bends : (conditions, 3^m)
        Filled in: each condition's coefficients, relative to the demand in the middle of the box.

    """
    above, norm, sizes = cut.above, cut.norm, cut.size
    m, several = low.size, above.shape[1]
    count = points.size * several
    controllers = signs.size
    c = np.empty((controllers, 9), np.complex128)
    squares = np.empty((controllers, 9))
    largest = np.empty(controllers)
    places = _places(m)
    form = np.empty(above.shape[2:], np.complex128)
    for point in range(points.size):
        size = 1.0
        for i in range(controllers):
            own = slice(2 * i, 2 * i + 2)
            _ends(low[own], high[own], points[point], signs[i], c[i], squares[i])
            largest[i] = high[2 * i] + high[2 * i + 1] / abs(points[point])
            size += largest[i] * reach[point]
        for turn in range(several):
            k = several * point + turn
            length = sizes[point, turn, 0]
            for i in range(controllers):
                length += sizes[point, turn, 1 + i] * largest[i]
            unit = p[point] * _middle(norm[point, turn], c)
            if not unit > 0.0:
                a[k], b[k], bends[k] = 0.0, NEVER, NEVER
                continue
            for i in range(form.shape[0]):
                for j in range(form.shape[0]):
                    form[i, j] = above[point, turn, i, j] - p[point] * norm[point, turn, i, j]
            _coefficients(form, c, squares, bends[k])
            margin = MARGIN * (size * size + p[point]) * length * length
            for i in range(bends.shape[1]):
                bends[k, i] = (bends[k, i] + margin) / unit
            b[k] = _slopes(bends[k], places, a[k])
            if not abs(b[k]) < NEVER:
                a[k], b[k], bends[k] = 0.0, NEVER, NEVER
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
def least_length(low, high, at, norm, sizes, signs):
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
            squares[3 * i + j] = k2 + 2.0 * k * m * inverse.real + m2 * square(inverse)


@compiled
def _coefficients(form, c, squares, out):
    """Bernstein coefficients of psi^H form psi."""
    if form.shape[0] == 2:
        for i in range(9):
            mixed = 2.0 * (form[0, 1] * c[0, i]).real
            out[i] = form[0, 0].real + mixed + form[1, 1].real * squares[0, i]
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
