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

zeta itself may depend on c in any way. With one controller it is kept; with several it follows the
response of the worst plant, each row linear in each other row's controller (`_follow`), which keeps
the condition sharp over a far wider range. It is a Hermitian form in the products of different
controllers: with two in 1, c_1, c_2, c_1 c_2.
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
    size : (k, size of psi)
        Bound |Z|: the sum of these, each times the modulus of its product.

    """

    above: NDArray[np.complex128]
    norm: NDArray[np.complex128]
    size: NDArray[np.float64]


@compiled
def cuts(c, G, u, p, layout, x):
    """Conditions p psi^H norm psi <= psi^H above psi, sharp near `c`.

    psi holds the products of different controllers, bit j of the place standing for c_j: (1, c) or
    (1, c_1, c_2, c_1 c_2) and so on.

    Parameters
    ----------
    c : (k, controllers) complex
        Where they are to be sharp. With several, each row of the first block has its own.
    G : (k, rows, widest) complex
        `LoopBlocks.packed_at`; with several controllers blocks but the first have one row.
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
    rows, widest, products = G.shape[1], G.shape[2], 2**controllers
    above = np.zeros((count, products, products), np.complex128)
    norm = np.zeros((count, products, products), np.complex128)
    size = np.zeros((count, products))
    A = np.empty((rows, widest), np.complex128)
    F = np.empty((rows, widest), np.complex128)
    Z = np.zeros((rows, widest), np.complex128)
    V = np.zeros((rows, widest), np.complex128)
    Q = np.empty((rows, widest), np.complex128)
    work = np.empty((widest, widest), np.complex128)
    form = np.zeros((rows, widest, products), np.complex128)
    for k in range(count):
        if _directions(c[k], G[k], u[k], p[k], layout, x[k], A, F, Z, V, work) and _normalise(
            c[k], layout, Z, V, Q
        ):
            reach = math.sqrt(u[k]) * _part(c[k], G[k], math.sqrt(u[k]), layout, Z, V, Q)
            form[:, :, :] = 0j
            if controllers == 1 or not _follow(c[k], G[k], reach, layout, Z, V, Q, form):
                form[:, :, 0] = Z
                form[:, :, 1:] = 0j
            _expand(G[k], reach, layout, V, Q, form, above[k], norm[k], size[k])
    return Cuts(above, norm, size)


@compiled
def _directions(c, G, u, p, layout, x, A, F, Z, V, work):
    """Fill in the dual solution: Z Z^H = (A - l Q)^-1 block by block, and its V; False if none.

    A = E^H P E with P = (I + G X^-1 G^H)^-1, Q = u C^H X C + p I, and the level l is that of the
    barrier: sum over all levels l_i of the pencil 1/(l_i/l - 1) = 1/nu.
    """
    channels, scales, first = layout.channels, layout.scales, layout.first
    if not (x.min() > LEAST and x.max() < 1.0 / LEAST):
        return False
    levels = np.empty(channels.size)
    weight = np.empty(channels.size)
    for r in range(channels.size):
        weight[r] = u * square(c[channels[r]]) * x[scales[r]] + p
    for block in range(first.size - 1):
        lo, n = first[block], first[block + 1] - first[block]
        for i in range(n):
            for j in range(n):
                v = 1.0 + 0j if i == j else 0j
                for m in range(n):
                    v += G[lo + i, m] * np.conj(G[lo + j, m]) / x[scales[lo + m]]
                work[i, j] = v
                F[lo + i, j] = G[lo + i, j] * c[channels[lo + j]]
            F[lo + i, i] += 1.0
        if not _factorise(work, n):  # lost to rounding: scales and directions too far apart
            return False
        for j in range(n):  # F = P E, A = E^H F: half of it the square of the triangular solution
            for i in range(n):
                v = F[lo + i, j]
                for m in range(i):
                    v -= work[i, m] * F[lo + m, j]
                F[lo + i, j] = v / work[i, i].real
        for i in range(n):
            for j in range(n):
                v = 0j
                for m in range(n):
                    v += np.conj(F[lo + m, i]) * F[lo + m, j]
                A[lo + i, j] = v
        for j in range(n):
            for i in range(n - 1, -1, -1):
                v = F[lo + i, j]
                for m in range(i + 1, n):
                    v -= np.conj(work[m, i]) * F[lo + m, j]
                F[lo + i, j] = v / work[i, i].real
        _levels(A, weight, lo, n, levels)
    lowest = levels.min()
    if not 0.0 < lowest < math.inf:
        return False
    level = lowest / centred_level(lowest / levels, 1.0, NU)
    for block in range(first.size - 1):
        lo, n = first[block], first[block + 1] - first[block]
        for i in range(n):
            for j in range(n):
                work[i, j] = A[lo + i, j]
            work[i, i] -= level * weight[lo + i]
        if not _factorise(work, n):
            return False
        for j in range(n):  # Z = L^-H where A - l Q = L L^H, its conjugate column by column
            for i in range(n):
                v = 1.0 + 0j if i == j else 0j
                for m in range(j, i):
                    v -= work[i, m] * np.conj(Z[lo + j, m])
                Z[lo + j, i] = np.conj(v) / work[i, i].real if i >= j else 0j
        for i in range(n):
            for j in range(n):
                v = 0j
                for m in range(n):
                    v += F[lo + i, m] * Z[lo + m, j]
                work[i, j] = v
        for i in range(n):
            for j in range(n):
                v = 0j
                for m in range(n):
                    v += np.conj(G[lo + m, i]) * work[m, j]
                V[lo + i, j] = v / x[scales[lo + i]]
    return True


@compiled
def _factorise(M, n):
    """Put the triangular factor of a Hermitian matrix in its place; False if not positive."""
    for i in range(n):
        for j in range(i + 1):
            v = M[i, j]
            for m in range(j):
                v -= M[i, m] * np.conj(M[j, m])
            if i > j:
                M[i, j] = v / M[j, j].real
            elif v.real > 0.0:
                M[i, i] = math.sqrt(v.real)
            else:
                return False
    return True


@compiled
def _levels(A, weight, lo, n, levels):
    """Fill in the eigenvalues of the pencil of a block of A and its weights."""
    if n <= 2:
        l1 = A[lo, 0].real / weight[lo]
        levels[lo] = l1
        if n == 2:
            l2 = A[lo + 1, 1].real / weight[lo + 1]
            off = square(A[lo, 1]) / (weight[lo] * weight[lo + 1])
            half = 0.5 * (l1 - l2)
            levels[lo + 1] = 0.5 * (l1 + l2) + math.sqrt(half * half + off)
            levels[lo] = (l1 * l2 - off) / levels[lo + 1]
        return
    pencil = np.empty((n, n), np.complex128)
    for i in range(n):
        for j in range(n):
            pencil[i, j] = A[lo + i, j] / math.sqrt(weight[lo + i] * weight[lo + j])
    levels[lo : lo + n] = np.linalg.eigvalsh(pencil)


@compiled
def _normalise(c, layout, Z, V, Q):
    """Make |Z| = 1 and of each scale |V_s| < 1; fill in Q_s with |Q_s| < 1, along (C Z)_s."""
    channels, scales, columns = layout.channels, layout.scales, Z.shape[1]
    total = 0.0
    for r in range(channels.size):
        for j in range(columns):
            total += square(Z[r, j])
    if not LEAST < total < math.inf:
        return False
    for r in range(channels.size):
        for j in range(columns):
            Z[r, j] /= math.sqrt(total)
            V[r, j] /= math.sqrt(total)
            Q[r, j] = c[channels[r]] * Z[r, j]
    for s in range(scales.max() + 1):
        length, needed = 0.0, 0.0
        for r in range(channels.size):
            if scales[r] == s:
                for j in range(columns):
                    length += square(V[r, j])
                    needed += square(Q[r, j])
        usable = LEAST < length < math.inf and LEAST < needed < math.inf
        for r in range(channels.size):
            if scales[r] == s:
                for j in range(columns):
                    V[r, j] = V[r, j] * (SHORT / math.sqrt(length)) if usable else 0j
                    Q[r, j] = Q[r, j] * (SHORT / math.sqrt(needed)) if usable else 0j
    return True


@compiled
def _drive(c, layout, Z, Q):
    """<q_s, (C Z)_s> for each scale, which v follows."""
    channels, scales = layout.channels, layout.scales
    drive = np.zeros(scales.max() + 1, np.complex128)
    for r in range(channels.size):
        for j in range(Z.shape[1]):
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
def _follow(c, G, reach, layout, Z, V, Q, form):
    """Fill in Z as a function of the products of the controllers; False where it is lost.

    Z then follows the worst plant's zeta. The first block has a row for each controller. With
    v = rho C zeta row by row its worst plant has H = G (I - rho) in place of G, and zeta = (I + H
    C)^-1 w for a fixed w. Let d be the differences of the controllers from `c`, K = (I + H C)^-1 H
    at `c`: det(I + K d) (I + K d)^-1 Z is a multiple of it, whose row i has, by Cramer's rule, the
    determinants of the rows and columns i and S of K, column i replaced by Z, as coefficients of
    the products S of the d. Other blocks follow det(I + K d) without their own d.
    """
    channels, scales = layout.channels, layout.scales
    controllers, columns, products = c.size, Z.shape[1], form.shape[2]
    if layout.first[1] != controllers:
        return False
    drive = _drive(c, layout, Z, Q)
    H = np.zeros((controllers, controllers), np.complex128)
    E = np.zeros((controllers, controllers), np.complex128)
    K = np.zeros((controllers, controllers), np.complex128)  # by controller
    seen = np.zeros((controllers, controllers), np.complex128)  # I - rho
    for r in range(controllers):
        needed = 0.0
        for i in range(controllers):
            if scales[i] == scales[r]:
                for j in range(columns):
                    own = c[channels[i]] * Z[i, j]
                    needed += square(own)
                    seen[r, i] -= reach * V[r, j] * drive[scales[r]] * np.conj(own)
        for i in range(controllers):
            seen[r, i] = seen[r, i] / needed if needed > 0.0 else 0j
        seen[r, r] += 1.0
    for r in range(controllers):
        for i in range(controllers):
            for m in range(controllers):
                H[r, i] += G[r, m] * seen[m, i]
            E[r, i] = H[r, i] * c[channels[i]]
        E[r, r] += 1.0
    if not _divide(E, H):
        return False
    for r in range(controllers):
        for i in range(controllers):
            K[channels[r], channels[i]] = H[r, i]
    column = np.empty(controllers, np.complex128)
    for chosen in range(products):
        for r in range(controllers, channels.size):
            if not chosen >> channels[r] & 1:
                form[r, 0, chosen] = Z[r, 0] * _minor(K, chosen, -1, column, E)
        for j in range(columns):
            for r in range(controllers):
                column[channels[r]] = Z[r, j]
            for r in range(controllers):
                own = channels[r]
                if not chosen >> own & 1:
                    form[r, j, chosen] = _minor(K, chosen | 1 << own, own, column, E)
    # From products of the differences to those of the controllers themselves.
    for i in range(controllers):
        for chosen in range(products):
            if chosen >> i & 1:
                for r in range(channels.size):
                    for j in range(columns):
                        form[r, j, chosen - (1 << i)] -= c[i] * form[r, j, chosen]
    return True


@compiled
def _divide(E, H):
    """Put E^-1 H in the place of H; False where E is singular. E is lost."""
    n = E.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if square(E[i, k]) > square(E[pivot, k]):
                pivot = i
        if not square(E[pivot, k]) > 0.0:
            return False
        for j in range(n):
            E[k, j], E[pivot, j] = E[pivot, j], E[k, j]
            H[k, j], H[pivot, j] = H[pivot, j], H[k, j]
        for i in range(n):
            if i != k:
                factor = E[i, k] / E[k, k]
                for j in range(n):
                    E[i, j] -= factor * E[k, j]
                    H[i, j] -= factor * H[k, j]
    for k in range(n):
        for j in range(n):
            H[k, j] /= E[k, k]
    return True


@compiled
def _minor(K, chosen, replaced, column, work):
    """Return the determinant of the rows and columns of K in `chosen`, one replaced."""
    n = 0
    for i in range(K.shape[0]):
        if chosen >> i & 1:
            m = 0
            for j in range(K.shape[0]):
                if chosen >> j & 1:
                    work[n, m] = column[i] if j == replaced else K[i, j]
                    m += 1
            n += 1
    det = 1.0 + 0j
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if square(work[i, k]) > square(work[pivot, k]):
                pivot = i
        if not square(work[pivot, k]) > 0.0:
            return 0j
        if pivot != k:
            det = -det
            for j in range(n):
                work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
        det *= work[k, k]
        for i in range(k + 1, n):
            factor = work[i, k] / work[k, k]
            for j in range(k + 1, n):
                work[i, j] -= factor * work[k, j]
    return det


@compiled
def _expand(G, reach, layout, V, Q, form, above, norm, size):
    """Coefficients of |E Z - G v|^2 and |Z|^2 in the products, from those of Z."""
    channels, scales, first = layout.channels, layout.scales, layout.first
    rows, columns, products = form.shape
    drive = np.zeros((scales.max() + 1, products), np.complex128)
    for r in range(rows):
        own = 1 << channels[r]
        for j in range(columns):
            for i in range(products):
                size[i] += square(form[r, j, i])
                if i & own:  # C Z, without own c in Z
                    drive[scales[r], i] += np.conj(Q[r, j]) * form[r, j, i - own]
    for i in range(products):
        size[i] = math.sqrt(size[i])
    left = np.empty(products, np.complex128)
    for block in range(first.size - 1):
        lo, end = first[block], first[block + 1]
        for r in range(lo, end):
            for j in range(end - lo):
                for i in range(products):
                    left[i] = form[r, j, i]
                    for b in range(lo, end):
                        own = 1 << channels[b]
                        moved = form[b, j, i - own] if i & own else 0j
                        pushed = reach * V[b, j] * drive[scales[b], i]
                        left[i] += G[r, b - lo] * (moved - pushed)
                for i in range(products):
                    for b in range(products):
                        above[i, b] += np.conj(left[i]) * left[b]
                        norm[i, b] += np.conj(form[r, j, i]) * form[r, j, b]
