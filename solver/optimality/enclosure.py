r"""Compiled: what the conditions on the controllers are over a box of PI settings.

The variables are k and m = k/tau_I of each controller, in which c(s) = k + m/s is linear. A
condition (`solver.optimality.cuts`) is a polynomial in them, at least 0, of degree 2 in each: a
Hermitian form in (1, c_1) x (1, c_2) and so on. Over a box it is the mean, with positive weights
that depend on the place, of its 3^m Bernstein coefficients, so it is at most the greatest of them;
they exceed it by the square of the width of the box at most (Garloff 1993). Each coefficient
belongs to a place, low, middle or high in each variable.
"""

import math

import numpy as np

from solver.model.controllers import DERIVATIVE_FILTER
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
    own = m // controllers
    c = np.empty((controllers, 3**own), np.complex128)
    squares = np.empty((controllers, 3**own))
    ones = np.empty(3**own)
    moduli, psi = np.empty(2**controllers), np.empty(2**controllers, np.complex128)
    places = _places(m)
    form = np.empty(above.shape[2:], np.complex128)
    for point in range(points.size):
        size = _all_ends(low, high, points[point], signs, c, squares, ones, moduli, psi)
        for i in range(controllers):
            size += moduli[1 << i] * reach[point]
        for turn in range(several):
            k = several * point + turn
            length = 0.0
            for i in range(moduli.size):
                length += sizes[point, turn, i] * moduli[i]
            unit = p[point] * _middle(norm[point, turn], psi)
            if not unit > 0.0:
                a[k], b[k], bends[k] = 0.0, NEVER, NEVER
                continue
            for i in range(form.shape[0]):
                for j in range(form.shape[0]):
                    form[i, j] = above[point, turn, i, j] - p[point] * norm[point, turn, i, j]
            _coefficients(form, c, squares, ones, bends[k])
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
    controllers = signs.size
    own = low.size // controllers
    c = np.empty((controllers, 3**own), np.complex128)
    squares = np.empty((controllers, 3**own))
    ones = np.empty(3**own)
    lengths = np.empty(3**low.size)
    moduli, psi = np.empty(2**controllers), np.empty(2**controllers, np.complex128)
    _all_ends(low, high, at, signs, c, squares, ones, moduli, psi)
    length = 0.0
    for i in range(moduli.size):
        length += sizes[i] * moduli[i]
    _coefficients(norm, c, squares, ones, lengths)
    return max(lengths.min() - MARGIN * length * length, 0.0) / _middle(norm, psi)


@compiled
def _all_ends(low, high, at, signs, c, squares, ones, moduli, psi):
    """Fill in Bernstein coefficients of degree 2 in each setting; returns the largest |d|.

    A controller is n/d, d = 1 with PI: of conj(d) n `c`, of |n|^2 `squares`, of |d|^2 `ones`, which
    with several controllers is 1. Also, of the products (d, n) or (1, n_1, n_2, n_1 n_2) and so on,
    the largest moduli (`moduli`), and what they are in the middle of the box (`psi`).
    """
    own = low.size // signs.size
    ones[:] = 1.0
    moduli[0] = psi[0] = 1.0
    inverse = 1.0 / at
    for i in range(signs.size):
        first = own * i
        kl, kh, ml, mh = low[first], high[first], low[first + 1], high[first + 1]
        moduli[1 << i] = kh + mh / abs(at)
        psi[1 << i] = signs[i] * (0.5 * (kl + kh) + 0.5 * (ml + mh) * inverse)
        _ends(kl, kh, ml, mh, inverse, signs[i], c[i], squares[i])
        if own == 3:
            t = 0.5 * (low[first + 2] + high[first + 2])
            psi[0] = 1.0 + DERIVATIVE_FILTER * t * at
            psi[1 << i] *= 1.0 + t * at
            moduli[0] = 1.0 + DERIVATIVE_FILTER * high[first + 2] * abs(at)
            moduli[1 << i] *= 1.0 + high[first + 2] * abs(at)
            _lead(low[first + 2], high[first + 2], at, c[i], squares[i], ones)
    for i in range(signs.size):
        for others in range(1, 1 << i):
            moduli[others + (1 << i)] = moduli[others] * moduli[1 << i]
            psi[others + (1 << i)] = psi[others] * psi[1 << i]
    return moduli[0]


@compiled
def _ends(kl, kh, ml, mh, inverse, sign, c, squares):
    """Those of c = sign (k + m/s) and |c|^2 over k and m, the first nine."""
    for i in range(3):
        k = 0.5 * ((2 - i) * kl + i * kh)
        k2 = kl * kh if i == 1 else k * k
        for j in range(3):
            m = 0.5 * ((2 - j) * ml + j * mh)
            m2 = ml * mh if j == 1 else m * m
            c[3 * i + j] = sign * (k + m * inverse)
            squares[3 * i + j] = k2 + 2.0 * k * m * inverse.real + m2 * square(inverse)


@compiled
def _lead(low, high, at, c, squares, ones):
    """Multiply by those of the derivative over its time t: n has 1 + t s, d has 1 + t s/10."""
    size = square(at)
    for i in range(8, -1, -1):
        for j in range(2, -1, -1):
            t = 0.5 * ((2 - j) * low + j * high)
            t2 = low * high if j == 1 else t * t
            mixed = 1.0 + t * (at + DERIVATIVE_FILTER * np.conj(at)) + DERIVATIVE_FILTER * t2 * size
            c[3 * i + j] = c[i] * mixed
            squares[3 * i + j] = squares[i] * (1.0 + 2.0 * t * at.real + t2 * size)
            ones[3 * i + j] = (
                1.0 + 2.0 * DERIVATIVE_FILTER * t * at.real + DERIVATIVE_FILTER**2 * t2 * size
            )


@compiled
def _coefficients(form, c, squares, ones, out):
    """Bernstein coefficients of psi^H form psi."""
    if form.shape[0] == 2:
        _last_coefficients(form, c, squares, ones, out)
        return
    # Controllers but the first are put in, the last one first: places of the first one come first.
    others = out.reshape(9, out.size // 9)
    if form.shape[0] == 4:
        smaller = np.empty((2, 2), np.complex128)
        for j in range(9):
            _put_in(form, c[1, j], squares[1, j], smaller)
            _last_coefficients(smaller, c, squares, ones, others[:, j])
        return
    small, smaller = np.empty((4, 4), np.complex128), np.empty((2, 2), np.complex128)
    for j in range(9):
        _put_in(form, c[2, j], squares[2, j], small)
        for i in range(9):
            _put_in(small, c[1, i], squares[1, i], smaller)
            _last_coefficients(smaller, c, squares, ones, others[:, 9 * i + j])


@compiled
def _put_in(form, c, size, out):
    """Make of a form in (1, c) x others one in the others; `size` in the place of |c|^2."""
    half = out.shape[0]
    for i in range(half):
        for j in range(half):
            mixed = form[i, half + j] * c + form[half + i, j] * np.conj(c)
            out[i, j] = form[i, j] + mixed + form[half + i, half + j] * size


@compiled
def _last_coefficients(form, c, squares, ones, out):
    """Bernstein coefficients of a form in (d, n) of the first controller."""
    for i in range(ones.size):
        mixed = 2.0 * (form[0, 1] * c[0, i]).real
        out[i] = form[0, 0].real * ones[i] + mixed + form[1, 1].real * squares[0, i]


@compiled
def _middle(form, psi):
    """psi^H form psi."""
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
