r"""Compiled: conditions that every robust setting meets, one a point s of the right half plane.

At one point let E = I + G C with C = diag(c), u = |w_I|^2, p = |w_P|^2 and X = diag(x) > 0 the
squared D-scales. Robust performance with these scales says, for all v and all zeta (as
w = E zeta - G v, so that zeta = (I + G C)^-1 (G v + w)),

    u |X^(1/2) C zeta|^2 + p |zeta|^2  <=  |X^(1/2) v|^2 + |E zeta - G v|^2.

Choose v with |v_s| <= sqrt(u) |(C zeta)_s| on the rows of each scale s. Then the terms in X cancel
or help, whatever X > 0 is, and

    p |zeta|^2  <=  |E zeta - G v|^2

is left: a condition that no choice of scales can evade. With v_s = sqrt(u) h_s <q_s, (C zeta)_s>,
|h_s| <= 1 and |q_s| <= 1 fixed, v is linear in C zeta. Where h, q and zeta come from the dual
solution at some c_0, the condition is as sharp as the best scales are there. The same holds for
several zeta at once, the columns of Z, with Frobenius norms; a block of the loop
(`solver.model.blocks`) has its own columns. It holds to the right of the imaginary axis too, by the
maximum principle, if the loop is stable: docs/optimality.md.

zeta itself may depend on c in any way. With one controller it is kept; with two it follows the
response of the worst plant, each row linear in the other one's controller (`_follow`), which keeps
the condition sharp over a far wider range. It is a Hermitian form in 1, c_1, c_2, c_1 c_2.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.mu.kernel import centred_level
from solver.mu.workspace import compiled, square

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["NU", "Cuts", "cuts"]

NU = 1e-5  # barrier parameter: a cut is that much less sharp than the best scales
SHORT = 1.0 - 1e-12  # h and q stay shorter than 1 whatever the rounding
LEAST = 1e-250  # squared lengths below this have lost digits


class Cuts(NamedTuple):
    """Conditions p psi^H norm psi <= psi^H above psi, psi the products of the controllers.

    Attributes
    ----------
    above, norm : (k, size of psi, size of psi) complex
        Hermitian, not negative; 0 where no condition was found.
    size : (k, 1 + controllers)
        Bound |Z|: size_0 + sum_j size_j |c_j|.

    """

    above: NDArray[np.complex128]
    norm: NDArray[np.complex128]
    size: NDArray[np.float64]


@compiled
def cuts(c, G, u, p, layout, x):
    """Conditions p psi^H norm psi <= psi^H above psi, sharp near `c`.

    psi holds the products of the controllers: (1, c) or (1, c_1, c_2, c_1 c_2).

    Parameters
    ----------
    c : (k, controllers) complex
        Where they are to be sharp; at most two.
    G : (k, rows, widest) complex
        `LoopBlocks.packed_at`, blocks of at most two rows.
    u, p : (k,)
        |w_I|^2, and |w_P|^2 that is demanded.
    layout : Layout
        `LoopBlocks.layout`.
    x : (k, scales)
        Squared scales near the best ones for mu.

    Returns
    -------
    Cuts
        One a point.

    """
    count, controllers = c.shape
    rows, products = G.shape[1], 2**controllers
    above = np.zeros((count, products, products), np.complex128)
    norm = np.zeros((count, products, products), np.complex128)
    size = np.zeros((count, 1 + controllers))
    Z = np.empty((rows, 2), np.complex128)
    V = np.empty((rows, 2), np.complex128)
    Q = np.empty((rows, 2), np.complex128)
    slope = np.zeros((rows, 2), np.complex128)
    for k in range(count):
        if _directions(c[k], G[k], u[k], p[k], layout, x[k], Z, V) and _normalise(
            c[k], layout, Z, V, Q
        ):
            reach = math.sqrt(u[k]) * _part(c[k], G[k], math.sqrt(u[k]), layout, Z, V, Q)
            if controllers == 2:
                _follow(c[k], G[k], reach, layout, Z, V, Q, slope)
            _expand(c[k], G[k], reach, layout, Z, V, Q, slope, above[k], norm[k], size[k])
    return Cuts(above, norm, size)


@compiled
def _directions(c, G, u, p, layout, x, Z, V):
    """Fill in the dual solution: Z Z^H = (A - l Q)^-1 block by block, and its V; False if none.

    A = E^H P E with P = (I + G X^-1 G^H)^-1, Q = u C^H X C + p I, and the level l is that of the
    barrier: sum over all levels l_i of the pencil 1/(l_i/l - 1) = 1/nu.
    """
    channels, scales, first = layout.channels, layout.scales, layout.first
    if not (x.min() > LEAST and x.max() < 1.0 / LEAST):
        return False
    lowest = math.inf
    levels = np.empty(channels.size)
    A = np.empty((channels.size, 2), np.complex128)
    F = np.empty((channels.size, 2), np.complex128)
    for block in range(first.size - 1):
        lo = first[block]
        c1, x1, g11 = c[channels[lo]], x[scales[lo]], G[lo, 0]
        q1 = u * square(c1) * x1 + p
        if first[block + 1] - lo == 1:
            E = 1.0 + g11 * c1
            F[lo, 0] = E * (x1 / (x1 + square(g11)))
            A[lo, 0] = (np.conj(E) * F[lo, 0]).real
            levels[lo] = A[lo, 0].real / q1
        else:
            c2, x2 = c[channels[lo + 1]], x[scales[lo + 1]]
            g12, g21, g22 = G[lo, 1], G[lo + 1, 0], G[lo + 1, 1]
            q2 = u * square(c2) * x2 + p
            y1 = 1.0 + square(g11) / x1 + square(g12) / x2
            y2 = 1.0 + square(g21) / x1 + square(g22) / x2
            y12 = g11 * np.conj(g21) / x1 + g12 * np.conj(g22) / x2
            det = y1 * y2 - square(y12)
            if not det > 0.0:  # lost to rounding: scales and directions too far apart
                return False
            e11, e12, e21, e22 = 1.0 + g11 * c1, g12 * c2, g21 * c1, 1.0 + g22 * c2
            F[lo, 0] = (y2 * e11 - y12 * e21) / det
            F[lo, 1] = (y2 * e12 - y12 * e22) / det
            F[lo + 1, 0] = (y1 * e21 - np.conj(y12) * e11) / det
            F[lo + 1, 1] = (y1 * e22 - np.conj(y12) * e12) / det
            A[lo, 0] = (np.conj(e11) * F[lo, 0] + np.conj(e21) * F[lo + 1, 0]).real
            A[lo, 1] = np.conj(e11) * F[lo, 1] + np.conj(e21) * F[lo + 1, 1]
            A[lo + 1, 1] = (np.conj(e12) * F[lo, 1] + np.conj(e22) * F[lo + 1, 1]).real
            l1, l2 = A[lo, 0].real / q1, A[lo + 1, 1].real / q2
            off = square(A[lo, 1]) / (q1 * q2)
            half = 0.5 * (l1 - l2)
            levels[lo + 1] = 0.5 * (l1 + l2) + math.sqrt(half * half + off)
            levels[lo] = (l1 * l2 - off) / levels[lo + 1]
        lowest = min(lowest, levels[lo])
    if not 0.0 < lowest < math.inf:
        return False
    level = lowest / centred_level(lowest / levels, 1.0, NU)
    for block in range(first.size - 1):
        lo = first[block]
        c1, x1 = c[channels[lo]], x[scales[lo]]
        d1 = A[lo, 0].real - level * (u * square(c1) * x1 + p)
        Z[lo, 1] = 0j
        if first[block + 1] - lo == 1:
            if not d1 > 0.0:
                return False
            Z[lo, 0] = 1.0 / math.sqrt(d1)
            V[lo, 0] = np.conj(G[lo, 0]) * F[lo, 0] * Z[lo, 0] / x1
            V[lo, 1] = 0j
            continue
        c2, x2 = c[channels[lo + 1]], x[scales[lo + 1]]
        d2 = A[lo + 1, 1].real - level * (u * square(c2) * x2 + p)
        det = d1 * d2 - square(A[lo, 1])
        if not (det > 0.0 and d2 > 0.0):
            return False
        # Cholesky factor of the inverse
        Z[lo, 0] = math.sqrt(d2 / det)
        Z[lo + 1, 0] = -np.conj(A[lo, 1]) / math.sqrt(d2 * det)
        Z[lo + 1, 1] = 1.0 / math.sqrt(d2)
        for j in range(2):
            f1 = F[lo, 0] * Z[lo, j] + F[lo, 1] * Z[lo + 1, j]
            f2 = F[lo + 1, 0] * Z[lo, j] + F[lo + 1, 1] * Z[lo + 1, j]
            V[lo, j] = (np.conj(G[lo, 0]) * f1 + np.conj(G[lo + 1, 0]) * f2) / x1
            V[lo + 1, j] = (np.conj(G[lo, 1]) * f1 + np.conj(G[lo + 1, 1]) * f2) / x2
    return True


@compiled
def _normalise(c, layout, Z, V, Q):
    """Make |Z| = 1 and of each scale |V_s| < 1; fill in Q_s with |Q_s| < 1, along (C Z)_s."""
    channels, scales = layout.channels, layout.scales
    total = 0.0
    for r in range(channels.size):
        total += square(Z[r, 0]) + square(Z[r, 1])
    if not LEAST < total < math.inf:
        return False
    for r in range(channels.size):
        for j in range(2):
            Z[r, j] /= math.sqrt(total)
            V[r, j] /= math.sqrt(total)
            Q[r, j] = c[channels[r]] * Z[r, j]
    for s in range(scales.max() + 1):
        length, needed = 0.0, 0.0
        for r in range(channels.size):
            if scales[r] == s:
                length += square(V[r, 0]) + square(V[r, 1])
                needed += square(Q[r, 0]) + square(Q[r, 1])
        usable = LEAST < length < math.inf and LEAST < needed < math.inf
        for r in range(channels.size):
            if scales[r] == s:
                for j in range(2):
                    V[r, j] = V[r, j] * (SHORT / math.sqrt(length)) if usable else 0j
                    Q[r, j] = Q[r, j] * (SHORT / math.sqrt(needed)) if usable else 0j
    return True


@compiled
def _drive(c, layout, Z, Q):
    """<q_s, (C Z)_s> for each scale, which v follows."""
    channels, scales = layout.channels, layout.scales
    drive = np.zeros(scales.max() + 1, np.complex128)
    for r in range(channels.size):
        for j in range(2):
            drive[scales[r]] += np.conj(Q[r, j]) * c[channels[r]] * Z[r, j]
    return drive


@compiled
def _part(c, G, root_u, layout, Z, V, Q):
    """Share t in 0..1 of the permitted v for which |E Z - t G v| is least."""
    channels, scales, first = layout.channels, layout.scales, layout.first
    overlap, length = 0.0, 0.0
    drive = _drive(c, layout, Z, Q)
    for block in range(first.size - 1):
        lo, end = first[block], first[block + 1]
        for r in range(lo, end):
            for j in range(end - lo):
                whole, pushed = Z[r, j], 0j
                for i in range(lo, end):
                    whole += G[r, i - lo] * c[channels[i]] * Z[i, j]
                    pushed += G[r, i - lo] * V[i, j] * (root_u * drive[scales[i]])
                overlap += (np.conj(pushed) * whole).real
                length += square(pushed)
    return min(max(overlap / length, 0.0), 1.0) if length > 0.0 else 0.0


@compiled
def _follow(c, G, reach, layout, Z, V, Q, slope):
    """Slope of each row of Z in the other controller: Z then follows the worst plant's zeta.

    The first block is the 2 x 2 one. With v = rho C zeta row by row its worst plant has G (I - rho)
    in place of G, and zeta = (I + G (I - rho) C)^-1 w for a fixed w. Its multiple by det(I + G (I -
    rho) C) is linear in the other row's controller alone. Other blocks follow the determinant.
    """
    channels, scales = layout.channels, layout.scales
    slope[:, :] = 0j
    drive = _drive(c, layout, Z, Q)
    seen = np.zeros((2, 2), np.complex128)  # I - Delta
    for r in range(2):
        needed = 0.0
        for i in range(2):
            if scales[i] == scales[r]:
                for j in range(2):
                    own = c[channels[i]] * Z[i, j]
                    needed += square(own)
                    seen[r, i] -= reach * V[r, j] * drive[scales[r]] * np.conj(own)
        for i in range(2):
            seen[r, i] = seen[r, i] / needed if needed > 0.0 else 0j
        seen[r, r] += 1.0
    g11 = G[0, 0] * seen[0, 0] + G[0, 1] * seen[1, 0]
    g12 = G[0, 0] * seen[0, 1] + G[0, 1] * seen[1, 1]
    g21 = G[1, 0] * seen[0, 0] + G[1, 1] * seen[1, 0]
    g22 = G[1, 0] * seen[0, 1] + G[1, 1] * seen[1, 1]
    c1, c2 = c[channels[0]], c[channels[1]]
    both = g11 * g22 - g12 * g21
    det = 1.0 + g11 * c1 + g22 * c2 + both * c1 * c2
    if not square(det) > 0.0:
        return
    for j in range(2):
        w1 = Z[0, j] * (1.0 + g11 * c1) + g12 * c2 * Z[1, j]
        w2 = Z[1, j] * (1.0 + g22 * c2) + g21 * c1 * Z[0, j]
        slope[0, j] = (w1 * g22 - w2 * g12) / det
        slope[1, j] = (w2 * g11 - w1 * g21) / det
    growth = np.empty(2, np.complex128)
    growth[channels[0]] = (g11 + both * c2) / det
    growth[channels[1]] = (g22 + both * c1) / det
    for r in range(2, channels.size):
        slope[r, 0] = Z[r, 0] * growth[1 - channels[r]]


@compiled
def _expand(c, G, reach, layout, Z, V, Q, slope, above, norm, size):
    """Coefficients of |E Z - G v|^2 and |Z|^2 in the products of the controllers."""
    channels, scales, first = layout.channels, layout.scales, layout.first
    controllers = c.size
    products = above.shape[0]
    rows = channels.size
    form = np.zeros((rows, 2, products), np.complex128)  # Z
    moved = np.zeros((rows, 2, products), np.complex128)  # C Z
    drive = np.zeros((scales.max() + 1, products), np.complex128)
    for r in range(rows):
        own = channels[r]
        other = 1 - own
        for j in range(2):
            form[r, j, 0] = Z[r, j]
            moved[r, j, 1 << own] = Z[r, j]
            if controllers == 2:
                constant = Z[r, j] - slope[r, j] * c[other]
                form[r, j, 0] = moved[r, j, 1 << own] = constant
                form[r, j, 1 << other] = moved[r, j, 3] = slope[r, j]
                size[1 + other] += square(slope[r, j])
            size[0] += square(form[r, j, 0])
            for i in range(1, products):
                drive[scales[r], i] += np.conj(Q[r, j]) * moved[r, j, i]
    for i in range(size.size):
        size[i] = math.sqrt(size[i])
    left = np.empty(products, np.complex128)
    for block in range(first.size - 1):
        lo, end = first[block], first[block + 1]
        for r in range(lo, end):
            for j in range(end - lo):
                for i in range(products):
                    left[i] = form[r, j, i]
                    for b in range(lo, end):
                        pushed = reach * V[b, j] * drive[scales[b], i]
                        left[i] += G[r, b - lo] * (moved[b, j, i] - pushed)
                for i in range(products):
                    for b in range(products):
                        above[i, b] += np.conj(left[i]) * left[b]
                        norm[i, b] += np.conj(form[r, j, i]) * form[r, j, b]
