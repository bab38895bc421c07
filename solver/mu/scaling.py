"""Upper bound of mu by the fast path: one compiled barrier solve a frequency.

Two callers of the same kernel: `upper_bound` for a given matrix N, and `sweep` for a loop in its
factored form, which also returns how the level changes with the controllers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.mu import one_scale, side_by_side
from solver.mu.batch import batch
from solver.mu.kernel import FINE, balance, sensitivities, solve
from solver.mu.large_batch import large_batch
from solver.mu.structure import BlockStructure, Bound, bound_of_scales
from solver.mu.workspace import Factors, compiled, inner, square, workspace

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["sweep", "upper_bound"]

FAR = 3.0  # log of squared scales that balanced ones rarely differ by from the best
FEW = 2  # frequencies that are not worth eight lanes
WIDEST = 12  # rows of a block whose matrices, eight of each, fit into a fast cache


def upper_bound(N: NDArray[np.complex128], structure: BlockStructure) -> Bound:
    """Upper bound of mu(N), min over D of sigma_max(D N D^-1).

    It is mu itself for three full complex blocks or fewer.

    Parameters
    ----------
    N : (k, p, p) complex
        Frequency is axis 0.
    structure : BlockStructure
        The perturbation's blocks.

    Returns
    -------
    Bound
        mu (k,), recomputed from the scales returned with it. For N = 0 the bound is 0.

    Raises
    ------
    InvalidInputError
        N has another shape, or an entry that is not finite.

    """
    N = np.asarray(N, dtype=complex)
    structure.check(N)
    # One number per matrix takes out its size, so that no product can overflow.
    size = np.abs(N).max(axis=(1, 2))
    unit = N / np.where(size > 0, size, 1)[:, None, None]
    y = np.zeros((N.shape[0], structure.n_scales))
    if structure.n_scales:
        channels = np.array(structure.scales)
        rows = np.append(channels, np.full(structure.performance, -1))
        _scale_matrices(unit, channels, rows, all_free=True, y=y)
    return bound_of_scales(N, np.exp(0.5 * y), structure)


class _Scratch(NamedTuple):
    """Scratch arrays of one sweep.

    Attributes
    ----------
    SG, S : (rows, widest block) complex
        S G and S = (I + G C)^-1, block below block.
    elimination : (widest block, 2 widest block) complex
        I + G C of one block, and what becomes its inverse.
    exact : (rows, widest block) complex
        Columns of S G whose inputs do not err.
    p, b, b_small : (rows,)
        |w_I c|^2, the weight of the performance rows, and one so small that mu is that of the
        uncertain rows.
    A, mixed : (rows,), (rows,) complex
        As of `sensitivities`.
    trial, balanced : (scales,)
        Log of the squared scales best for mu, and of balanced ones.
    done : (k,) bool
        Frequencies that were solved side by side.

    """

    SG: NDArray[np.complex128]
    S: NDArray[np.complex128]
    elimination: NDArray[np.complex128]
    exact: NDArray[np.complex128]
    p: NDArray[np.float64]
    b: NDArray[np.float64]
    b_small: NDArray[np.float64]
    A: NDArray[np.float64]
    mixed: NDArray[np.complex128]
    trial: NDArray[np.float64]
    balanced: NDArray[np.float64]
    done: NDArray[np.bool_]


@compiled
def _scale_matrices(N, scales, row_scale, all_free, y):
    """Optimal log squared scales of each N, with L = I and R = N as its factors.

    `all_free` is True, and an argument so that `solve` is compiled once for this and for `sweep`:
    a constant would be of another type.
    """
    rows, channels = row_scale.size, scales.size
    p, rest_p = np.empty(rows), np.empty(rows)
    for i in range(rows):
        p[i] = 1.0 if i < channels else 0.0
        rest_p[i] = 1.0 - p[i]
    cols = np.empty((rows, channels), np.complex128)
    rest = np.empty((rows, rows - channels), np.complex128)
    row0, col0 = np.empty(2, np.int64), np.empty(2, np.int64)
    row0[0], row0[1] = 0, rows
    col0[0], col0[1] = 0, channels
    ws = workspace(rows, channels, y.shape[1])
    factors = Factors(cols, rest, p, rest_p, row_scale, scales, row0, col0, all_free)
    for k in range(N.shape[0]):
        for i in range(rows):
            for j in range(channels):
                cols[i, j] = N[k, i, j]
            for j in range(channels, rows):
                rest[i, j - channels] = N[k, i, j]
        balance(factors, y[k], ws)
        solve(factors, y[k], FINE, ws)


@compiled
def sweep(G, c, u, b, layout, all_free, nu, cold, y):
    """Level of every frequency and its slope in the controllers.

    Parameters
    ----------
    G : (k, rows, widest) complex
        `LoopBlocks.packed`.
    c : (k, controllers) complex
        Controller responses.
    u : (k, rows)
        |w_I|^2 of each row's input; 0 where it does not err.
    b : (k,)
        Weight of the performance rows: |w_P|^2, or 1 where that is sought.
    layout : Layout
        `LoopBlocks.layout`.
    all_free : bool
        Whether the level scales all of N (mu) or its performance rows only (skewed mu).
    nu : float
        Last barrier parameter of the kernel.
    cold : bool
        Start each frequency at its neighbour's scales instead of at `y`.
    y : (k, scales)
        Log of the squared scales, updated in place.

    Returns
    -------
    t : (k,)
        Log of the level: -2 log mu, or log of the largest |w_P|^2. -inf where the uncertainty
        alone forbids any (robust stability violated at this frequency).
    slope : (k, controllers) complex
        dt = Re sum slope dc; zero where t is not finite.
    det : (k, blocks) complex
        det(I + G C) of each block.

    """
    rows, widest, blocks = G.shape[1], G.shape[2], layout.first.size - 1
    t = np.empty(G.shape[0])
    slope = np.zeros(c.shape, np.complex128)
    det = np.empty((G.shape[0], blocks), np.complex128)
    scratch = _Scratch(
        SG=np.zeros((rows, widest), np.complex128),
        S=np.zeros((rows, widest), np.complex128),
        elimination=np.empty((widest, 2 * widest), np.complex128),
        exact=np.empty((rows, widest), np.complex128),
        p=np.empty(rows),
        b=np.empty(rows),
        b_small=np.empty(rows),
        A=np.empty(rows),
        mixed=np.empty(rows, np.complex128),
        trial=np.empty(y.shape[1]),
        balanced=np.empty(y.shape[1]),
        done=np.zeros(G.shape[0], np.bool_),
    )
    done, left = scratch.done, np.empty(t.size, np.int64)
    if _is_side_by_side(layout, widest, y.shape[1]) and t.size > FEW:
        large = large_batch(rows, widest, blocks, c.shape[1], y.shape[1])
        if widest <= 2 and y.shape[1] <= 2:
            small = batch(rows, blocks, c.shape[1], y.shape[1])
            side_by_side.sweep(
                G, c, u, b, layout, all_free, nu, cold, y, small, t, slope, det, done
            )
        else:
            side_by_side.sweep_large(
                G, c, u, b, layout, all_free, nu, cold, y, large, t, slope, det, done
            )
        if done.size - done.sum() > FEW:
            side_by_side.sweep_again(
                G, c, u, b, layout, all_free, nu, y, large, t, slope, det, done, left
            )
    ws = workspace(rows, widest, y.shape[1])
    _sweep(G, c, u, b, layout, all_free, nu, cold, y, scratch, ws, t, slope, det)
    return t, slope, det


@inner
def _sweep(G, c, u, b, layout, all_free, nu, cold, y, scratch, ws, t, slope, det):
    """Fill in `t`, `slope` and `det`, with arrays that are there already."""
    channels, scales, first = layout.channels, layout.scales, layout.first
    S, SG, p, A, mixed = scratch.S, scratch.SG, scratch.p, scratch.A, scratch.mixed
    rows, x = p.size, ws.x
    factors = Factors(SG, S, p, scratch.b, scales, scales, first, first, all_free)
    closed_form = _is_closed_form(layout, x.size)
    for k in range(t.size):
        if scratch.done[k]:
            continue
        for block in range(first.size - 1):
            lo = first[block]
            size = first[block + 1] - lo
            det[k, block] = _sensitivity(G[k], c[k], channels, lo, size, scratch.elimination, S, SG)
            for j in range(size):  # columns of what no demand is made of
                if channels[lo + j] < 0 or not b[k] > 0.0:
                    for i in range(lo, lo + size):
                        S[i, j] = 0j
                if size > 2 and u[k, lo + j] == 0.0:  # does not err; slopes need the column
                    for i in range(lo, lo + size):
                        scratch.exact[i, j] = SG[i, j]
                        SG[i, j] = 0j
        for i in range(rows):
            p[i] = u[k, i] * square(_acting(c[k], channels[i]))
            scratch.b[i] = b[k] if channels[i] >= 0 else 0.0
            scratch.b_small[i] = 1e-6 * scratch.b[i]
        if closed_form:
            barrier = nu if nu > FINE else 0.0
            t[k], x[0], total = one_scale.solve(SG, S, p[0], b[k], all_free, barrier, A, mixed)
            y[k, 0] = math.log(x[0])
        else:
            if cold and k > 0:
                for i in range(x.size):
                    y[k, i] = y[k - 1, i]
            elif cold:
                balance(factors, y[k], ws)
            t[k], centre = _solve_from(factors, scratch, y[k], nu, ws)
            if cold and k > 0:
                t[k], centre = _solve_again(factors, scratch, y[k], t[k], centre, nu, ws)
            total = sensitivities(factors, centre, ws, A, mixed) if abs(t[k]) < math.inf else 1.0
        if not abs(t[k]) < math.inf:
            continue
        p_level = math.exp(t[k]) if all_free else 1.0
        for block in range(first.size - 1):
            lo = first[block]
            size = first[block + 1] - lo
            for j in range(size):
                if size > 2 and u[k, lo + j] == 0.0:
                    mixed[lo + j] = 0j
                    for i in range(size):
                        mixed[lo + j] += ws.W_gap[lo + j, i] * scratch.exact[lo + i, j]
        for i in range(rows):
            if channels[i] < 0:
                continue
            ci = c[k, channels[i]]
            own = p_level * u[k, i] * x[scales[i]] * A[i] * np.conj(ci)
            slope[k, channels[i]] -= 2.0 * (own - mixed[i]) * (1.0 / total)


@inner
def _is_closed_form(layout, n_scales):
    """Whether all blocks are single rows of one controller: `solver.mu.one_scale`."""
    channels = layout.channels
    closed_form = channels.size <= 2 and layout.first.size - 1 == channels.size and n_scales == 1
    for i in range(channels.size):
        closed_form = closed_form and channels[i] == channels[0]
    return closed_form


@inner
def _is_side_by_side(layout, widest, n_scales):
    """Whether `solver.mu.side_by_side` can solve it: every row is an input with its error."""
    possible = widest <= WIDEST and not _is_closed_form(layout, n_scales)
    for channel in layout.channels:
        possible = possible and channel >= 0
    return possible


@inner
def _solve_from(factors, scratch, y, nu, ws):
    """Solve; where the uncertain part alone exceeds 1 at `y`, from the scales best for mu."""
    scales, first, trial = factors.row_scale, factors.row0, scratch.trial
    task, place, end = factors, y, nu
    for attempt in range(3):
        t, centre = solve(task, place, end, ws)
        if attempt == 0 and t == -math.inf:
            for i in range(y.size):
                trial[i] = y[i]
            task = Factors(
                scratch.SG, scratch.S, scratch.p, scratch.b_small, scales, scales, first, first,
                not factors.all_free,  # true: only the level of some rows can be forbidden
            )  # fmt: skip
            balance(task, trial, ws)
            place, end = trial, 1e-4
        elif attempt == 1:
            if not t > 0.0:
                return -math.inf, centre
            for i in range(y.size):
                y[i] = trial[i]
            task, place, end = factors, y, nu
        else:
            break
    return t, centre


@inner
def _solve_again(factors, scratch, y, t, centre, nu, ws):
    """Solve from balanced scales too where a solution is far from them; the better one stays.

    From the scales of a neighbour that is far off, as of the last frequency of one part of the
    axis for the first of another, rounding may stop the descent before it has begun.
    """
    balanced = scratch.balanced
    balanced[:] = 0.0
    balance(factors, balanced, ws)
    for i in range(y.size):  # which the search for them has overwritten
        ws.x[i] = math.exp(y[i])
        ws.x_inverse[i] = 1.0 / ws.x[i]
    demanded = False
    for i in range(factors.b.size):
        demanded |= factors.b[i] > 0.0
    least, most = math.inf, -math.inf
    for i in range(y.size):
        least, most = min(least, y[i] - balanced[i]), max(most, y[i] - balanced[i])
    # Without a demand a common factor of the scales is free.
    if most - least < FAR and (not demanded or max(abs(least), abs(most)) < FAR):
        return t, centre
    other, its_centre = _solve_from(factors, scratch, balanced, nu, ws)
    if other > t:
        for i in range(y.size):
            y[i] = balanced[i]
        return other, its_centre
    return _solve_from(factors, scratch, y, nu, ws)


@inner
def _acting(c, channel):
    """Return the controller of a channel; 1 in the channel of an output's error."""
    return c[channel] if channel >= 0 else 1.0 + 0j


@inner
def _sensitivity(G, c, channels, lo, size, E, S, SG):
    """det(I + G C), and S = (I + G C)^-1 and S G of the block whose first row is `lo`."""
    if size == 2:
        c1, c2 = _acting(c, channels[lo]), _acting(c, channels[lo + 1])
        g11, g12, g21, g22 = G[lo, 0], G[lo, 1], G[lo + 1, 0], G[lo + 1, 1]
        e11, e12, e21, e22 = 1.0 + g11 * c1, g12 * c2, g21 * c1, 1.0 + g22 * c2
        det = e11 * e22 - e12 * e21
        over = 1.0 / det
        S[lo, 0], S[lo, 1] = e22 * over, -e12 * over
        S[lo + 1, 0], S[lo + 1, 1] = -e21 * over, e11 * over
        strength = g11 * g22 - g12 * g21
        SG[lo, 0], SG[lo, 1] = (g11 + c2 * strength) * over, g12 * over
        SG[lo + 1, 0], SG[lo + 1, 1] = g21 * over, (g22 + c1 * strength) * over
        return det
    det = 1.0 + 0j
    for i in range(size):
        for j in range(size):
            E[i, j] = G[lo + i, j] * _acting(c, channels[lo + j])
            E[i, size + j] = 0j
        E[i, i] += 1.0
        E[i, size + i] = 1.0 + 0j
    for column in range(size):
        pivot = column
        largest = E[column, column].real ** 2 + E[column, column].imag ** 2
        for i in range(column + 1, size):
            size_here = E[i, column].real ** 2 + E[i, column].imag ** 2
            if size_here > largest:
                largest, pivot = size_here, i
        if pivot != column:
            for j in range(2 * size):
                E[column, j], E[pivot, j] = E[pivot, j], E[column, j]
            det = -det
        det *= E[column, column]
        scale = 1.0 / E[column, column]
        for j in range(column, 2 * size):
            E[column, j] *= scale
        for i in range(size):
            if i != column:
                factor = E[i, column]
                for j in range(column, 2 * size):
                    E[i, j] -= factor * E[column, j]
    for i in range(size):
        for j in range(size):
            S[lo + i, j] = E[i, size + j]
    for i in range(size):
        for j in range(size):
            v = 0j
            for m in range(size):
                v += E[i, size + m] * G[lo + m, j]
            SG[lo + i, j] = v
    return det
