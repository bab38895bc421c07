r"""Compiled: conditions that every robust setting meets, one a point s of the right half plane.

At one point let E = I + G C with C = diag(c), u = |w_I|^2, p = |w_P|^2 and X = diag(x) > 0 the
squared D-scales. Robust performance with these scales says, for all v and all zeta (as
w = E zeta - G v, so that zeta = (I + G C)^-1 (G v + w)),

    u |X^(1/2) C zeta|^2 + p |zeta|^2  <=  |X^(1/2) v|^2 + |E zeta - G v|^2.

Choose v with |v_s| <= sqrt(u) |(C zeta)_s| on the rows of each scale s. Then the terms in X cancel
or help, whatever X > 0 is, and

    p |zeta|^2  <=  |E zeta - G v|^2

is left: a condition that no choice of scales can evade. With v_s = sqrt(u) h_s <q_s, (C zeta)_s>,
|h_s| <= 1 and |q_s| <= 1 fixed, v is linear in c, so the right side is a convex quadratic
function of c. Where h, q and zeta come from the dual solution at some c_0, the condition is as
sharp as the best scales are there. The same holds for several zeta at once, the columns of Z, with
Frobenius norms; a block of the loop (`solver.blocks`) has its own columns. It holds to the right of
the imaginary axis too, by the maximum principle, if the loop is stable: docs/optimality.md.
"""

import math

import numpy as np

from solver.mu.kernel import centred_level
from solver.mu.workspace import compiled, square

__all__ = ["NEVER", "NU", "cuts"]

NU = 1e-5  # barrier parameter: a cut is that much less sharp than the best scales
SHORT = 1.0 - 1e-12  # h and q stay shorter than 1 whatever the rounding
NEVER = 1e300  # constant of a cut that says nothing


@compiled
def cuts(c, G, u, p, layout, x):
    """Conditions p constant <= constant + 2 Re(linear c) + c^H quadratic c, sharp near `c`.

    Parameters
    ----------
    c : (k, controllers) complex
        Where they are to be sharp.
    G : (k, rows, widest) complex
        `LoopBlocks.packed_at`, blocks of at most two rows.
    u, p : (k,)
        |w_I|^2, and |w_P|^2 that is demanded.
    layout : tuple
        `LoopBlocks.layout`.
    x : (k, scales)
        Squared scales near the best ones for mu.

    Returns
    -------
    constant : (k,)
        Near 1; `NEVER` where no condition was found.
    linear : (k, controllers) complex
    quadratic : (k, controllers, controllers) complex
        Hermitian, not negative.

    """
    size, controllers = c.shape
    rows = G.shape[1]
    constant = np.full(size, NEVER)
    linear = np.zeros((size, controllers), np.complex128)
    quadratic = np.zeros((size, controllers, controllers), np.complex128)
    Z = np.empty((rows, 2), np.complex128)
    V = np.empty((rows, 2), np.complex128)
    share = np.empty((x.shape[1], controllers), np.complex128)
    B = np.empty((controllers, rows, 2), np.complex128)
    for k in range(size):
        if _directions(c[k], G[k], u[k], p[k], layout, x[k], Z, V) and _normalise(
            c[k], layout, Z, V, share
        ):
            part = _part(c[k], G[k], math.sqrt(u[k]), layout, Z, V, share)
            constant[k] = _expand(
                G[k], part * math.sqrt(u[k]), layout, Z, V, share, B, linear[k], quadratic[k]
            )
    return constant, linear, quadratic


@compiled
def _directions(c, G, u, p, layout, x, Z, V):
    """Fill in the dual solution: Z Z^H = (A - l Q)^-1 block by block, and its V; False if none.

    A = E^H P E with P = (I + G X^-1 G^H)^-1, Q = u C^H X C + p I, and the level l is that of the
    barrier: sum over all levels l_i of the pencil 1/(l_i/l - 1) = 1/nu.
    """
    channels, scales, first = layout
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
def _normalise(c, layout, Z, V, share):
    """Make |Z| = 1 and |V_s| < 1 for each scale; share[s, j] makes <q_s, (C Z)_s> of c_j."""
    channels, scales, _ = layout
    total = 0.0
    for r in range(channels.size):
        total += square(Z[r, 0]) + square(Z[r, 1])
    if not 0.0 < total < math.inf:
        return False
    share[:, :] = 0j
    for r in range(channels.size):
        for j in range(2):
            Z[r, j] /= math.sqrt(total)
            V[r, j] /= math.sqrt(total)
    for s in range(share.shape[0]):
        length, needed = 0.0, 0.0
        for r in range(channels.size):
            if scales[r] == s:
                own = square(Z[r, 0]) + square(Z[r, 1])
                length += square(V[r, 0]) + square(V[r, 1])
                needed += square(c[channels[r]]) * own
                share[s, channels[r]] += np.conj(c[channels[r]]) * own
        usable = 0.0 < length < math.inf and 0.0 < needed < math.inf
        for r in range(channels.size):
            if scales[r] == s:
                for j in range(2):
                    V[r, j] = V[r, j] * (SHORT / math.sqrt(length)) if usable else 0j
        for j in range(share.shape[1]):
            share[s, j] = share[s, j] * (SHORT / math.sqrt(needed)) if usable else 0j
    return True


@compiled
def _part(c, G, root_u, layout, Z, V, share):
    """Share t in 0..1 of the permitted v for which |E Z - t G v| is least."""
    channels, scales, first = layout
    overlap, length = 0.0, 0.0
    for block in range(first.size - 1):
        lo, end = first[block], first[block + 1]
        for r in range(lo, end):
            for j in range(end - lo):
                whole, pushed = Z[r, j], 0j
                for i in range(lo, end):
                    whole += G[r, i - lo] * c[channels[i]] * Z[i, j]
                    total = 0j
                    for m in range(share.shape[1]):
                        total += share[scales[i], m] * c[m]
                    pushed += G[r, i - lo] * V[i, j] * (root_u * total)
                overlap += (np.conj(pushed) * whole).real
                length += square(pushed)
    return min(max(overlap / length, 0.0), 1.0) if length > 0.0 else 0.0


@compiled
def _expand(G, reach, layout, Z, V, share, B, linear, quadratic):
    """Coefficients of |E Z - G v|^2 in c, v = reach V share c; returns the constant |Z|^2."""
    channels, scales, first = layout
    constant = 0.0
    for j in range(linear.size):
        linear[j] = 0j
        for block in range(first.size - 1):
            lo, end = first[block], first[block + 1]
            for r in range(lo, end):
                for column in range(end - lo):
                    total = 0j
                    for i in range(lo, end):
                        own = Z[i, column] if channels[i] == j else 0j
                        total += G[r, i - lo] * (own - reach * V[i, column] * share[scales[i], j])
                    B[j, r, column] = total
                    linear[j] += np.conj(Z[r, column]) * total
                    if j == 0:
                        constant += square(Z[r, column])
    for i in range(linear.size):
        for j in range(linear.size):
            total = 0j
            for block in range(first.size - 1):
                lo, end = first[block], first[block + 1]
                for r in range(lo, end):
                    for column in range(end - lo):
                        total += np.conj(B[i, r, column]) * B[j, r, column]
            quadratic[i, j] = total
    return constant
