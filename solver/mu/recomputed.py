"""Compiled: the three curves of a loop, recomputed from D-scales, whatever found these.

With L = [w_I C; w_P] and R = [S G, S], N_RP = L R (Skogestad, Lundstrom and Hovd 1989, eq. 31), so
that sigma_max(D N_RP D^-1)^2 is the largest eigenvalue of

    Q^(1/2) (S G X^-1 (S G)^H + S S^H) Q^(1/2),   Q = |w_I|^2 C^H X C + |w_P|^2,   X = D^2,

which is half as wide as N_RP. Robust stability has neither S S^H nor |w_P|^2, nominal performance
nothing else. Outputs that err are channels without a demand: S there is left out, and |w_P|^2. Of
what does not err, w_I = 0, the columns of S G are left out.
"""

import math

import numpy as np

from solver.mu.workspace import compiled, inner, square

__all__ = ["NOMINAL", "ROBUST", "STABILITY", "recomputed"]

ROBUST, STABILITY, NOMINAL = 0, 1, 2  # curves


@compiled
def recomputed(curve, G, c, u, b, layout, y):
    """Return one of the three curves, (k,): the greatest value of the blocks.

    Parameters
    ----------
    curve : int
        `ROBUST` performance, robust `STABILITY` or `NOMINAL` performance.
    G, c, u, layout
        As for `solver.mu.scaling.sweep`.
    b : (k,)
        |w_P|^2.
    y : (k, scales)
        Log of the squared scales; any are good for `NOMINAL`.

    Returns
    -------
    (k,)
        Not a number where a return difference is singular, or anything else is no number.

    """
    blocks, widest = layout.first.size - 1, G.shape[2]
    E = np.empty((widest, 2 * widest), np.complex128)
    S, SG = np.empty((widest, widest), np.complex128), np.empty((widest, widest), np.complex128)
    values = np.empty(c.shape[0])
    for k in range(values.size):
        values[k] = 0.0
        for block in range(blocks):
            lo = layout.first[block]
            size = layout.first[block + 1] - lo
            regular = _sensitivities(G[k], c[k], layout.channels, lo, size, E, S, SG)
            wide = _scaled(curve, c[k], u[k], b[k], layout, y[k], lo, size, S, SG, E)
            value = _norm(E[:size, :wide]) if regular else math.nan
            if not value <= values[k]:
                values[k] = value  # nothing exceeds what is no number
            if math.isnan(value):
                break
    return values


@inner
def _sensitivities(G, c, channels, lo, size, E, S, SG):
    """Fill in S = (I + G C)^-1 and S G of one block; returns whether it is regular."""
    for i in range(size):
        for j in range(size):
            E[i, j] = G[lo + i, j]
            E[i, size + j] = 0j
        E[i, i] += 1.0 / _acting(c, channels[lo + i])
        E[i, size + i] = 1.0 + 0j
    # C S = (C^-1 + G)^-1 keeps its digits under integral action, where C and G C are huge.
    if not _inverted(E, size):
        return False
    for i in range(size):
        for j in range(size):
            S[i, j] = E[i, size + j] / _acting(c, channels[lo + i])
    # S G = C^-1 - C^-1 C S C^-1. Off the diagonal that is no difference of products, which grow
    # without bound towards zero where one input acts through integrators and another does not.
    for i in range(size):
        for j in range(size):
            SG[i, j] = -S[i, j] / _acting(c, channels[lo + j])
        own = 0j
        for j in range(size):
            own += S[i, j] * G[lo + j, i]
        SG[i, i] = own
    return True


@inner
def _acting(c, channel):
    """Return the controller of a channel; 1 in the channel of an output's error."""
    return c[channel] if channel >= 0 else 1.0 + 0j


@inner
def _inverted(E, size):
    """Replace [A, I] by [I, A^-1], rows exchanged for the largest pivot; whether A is regular."""
    for column in range(size):
        pivot, largest = column, -1.0
        for i in range(column, size):
            here = abs(E[i, column])
            if here > largest:
                pivot, largest = i, here
        if not largest > 0.0:
            return False
        if pivot != column:
            for j in range(2 * size):
                E[column, j], E[pivot, j] = E[pivot, j], E[column, j]
        scale = 1.0 / E[column, column]
        for j in range(column, 2 * size):
            E[column, j] *= scale
        for i in range(size):
            if i != column:
                factor = E[i, column]
                for j in range(column, 2 * size):
                    E[i, j] -= factor * E[column, j]
    return True


@inner
def _scaled(curve, c, u, b, layout, y, lo, size, S, SG, E):
    """Write Q^(1/2) [S G D^-1, S] into E, or the half of it that counts; returns its width."""
    channels, scales = layout.channels, layout.scales
    wide = 0
    for i in range(size):
        demanded = b if channels[lo + i] >= 0 and curve != STABILITY else 0.0
        Q = demanded
        if curve != NOMINAL:
            Q += u[lo + i] * square(_acting(c, channels[lo + i])) * math.exp(y[scales[lo + i]])
        root, wide = math.sqrt(Q), 0
        if curve != NOMINAL:
            for j in range(size):
                errs = u[lo + j] > 0.0  # else nothing comes in there
                E[i, j] = root * math.exp(-0.5 * y[scales[lo + j]]) * SG[i, j] if errs else 0j
            wide = size
        if curve != STABILITY:
            for j in range(size):
                if channels[lo + j] >= 0:
                    E[i, wide] = root * S[i, j]
                    wide += 1
    return wide


@compiled
def _norm(A):
    """Largest singular value of A (m, r), right to rounding; not a number if any entry is none."""
    size = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            here = abs(A[i, j])
            if not here < math.inf:
                return math.nan
            size = max(size, here)
    if size == 0.0:
        return 0.0
    H = np.zeros((A.shape[0], A.shape[0]), np.complex128)
    for i in range(A.shape[0]):
        for m in range(i + 1):
            v = 0j
            for j in range(A.shape[1]):
                # No square of an entry can overflow.
                v += (A[i, j] / size) * np.conj(A[m, j] / size)
            H[i, m] = v
            H[m, i] = np.conj(v)
    if A.shape[0] == 1:
        return size * math.sqrt(H[0, 0].real)
    if A.shape[0] == 2:
        middle = 0.5 * (H[0, 0].real + H[1, 1].real)
        apart = 0.5 * (H[0, 0].real - H[1, 1].real)
        return size * math.sqrt(middle + math.hypot(apart, abs(H[1, 0])))
    return size * math.sqrt(max(np.linalg.eigvalsh(H)[-1], 0.0))
