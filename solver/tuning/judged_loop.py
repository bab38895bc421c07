"""Compiled: one evaluation of the search in one call, and where followed peaks have gone."""

import math

import numpy as np

from solver.mu.workspace import TINY, compiled
from solver.tuning.goal_levels import all_demands, judged
from solver.tuning.loop_levels import ends_at_rest, loop_levels, winds_as_stable

__all__ = ["judged_loop", "judged_loops", "vertices"]


@compiled
def judged_loop(theta, signs, lead, omega, G, u, b, saturated, layout, terms, fixed, nu, cold, y):
    """Levels, gradients and demands of all frequencies, and whether the loop seems stable.

    Parameters
    ----------
    theta, signs, lead, omega, G, u, b, layout, nu, cold, y
        As for `loop_levels`.
    saturated, terms
        As for `judged`.
    fixed : int
        How many of the frequencies are those of the grid, which come first and tell stability.

    Returns
    -------
    level, gradient : (k,), (k, m)
        As of `loop_levels`.
    demand, slope, value, s, missing : (k,), (k,), float, float, float
        As of `judged`.
    winds, rests : bool
        Whether det turns on the grid as that of a stable loop, and whether it ends there.

    """
    level, gradient, det = loop_levels(
        theta, signs, lead, omega, G, u, b, layout, not terms.skewed, nu, cold, y
    )
    value, s, demand, slope, missing = judged(level, omega, saturated, terms)
    det = det[:fixed]
    winds = winds_as_stable(det, omega[:fixed])
    return level, gradient, demand, slope, value, s, missing, winds, ends_at_rest(det)


@compiled
def judged_loops(thetas, signs, lead, omega, G, u, b, saturated, layout, terms, nu, scales):
    """Judge several settings at the same frequencies, each from scales of its own.

    Parameters
    ----------
    thetas : (t, m)
        The settings.
    signs, lead, omega, G, u, b, saturated, layout, terms, nu
        As for `judged_loop`.
    scales : int
        Number of scales.

    Returns
    -------
    level, gradient, value, winds, rests : (t, k), (t, k, m), (t,), (t,), (t,)
        Of each settings, as of `judged_loop`.

    """
    settings, cold = thetas.shape[0], True
    level, gradient = (
        np.empty((settings, omega.size)),
        np.empty((settings, omega.size, thetas.shape[1])),
    )
    value = np.empty(settings)
    winds, rests = np.empty(settings, np.bool_), np.empty(settings, np.bool_)
    for i in range(settings):
        y = np.zeros((omega.size, scales))
        own, slopes, _, _, least, _, _, turns, ends = judged_loop(
            thetas[i],
            signs,
            lead,
            omega,
            G,
            u,
            b,
            saturated,
            layout,
            terms,
            omega.size,
            nu,
            cold,
            y,
        )
        level[i], gradient[i], value[i], winds[i], rests[i] = own, slopes, least, turns, ends
    return level, gradient, value, winds, rests


@compiled
def vertices(
    theta, signs, lead, omega, G, u, b, layout, terms, nu, s, log_peaks, around, scales, least
):
    """Return the peaks (p,) of the demand's excess, each at the vertex of a parabola.

    It goes through the highest of the points around and its neighbours: another peak may be as
    near as the farthest point.

    Parameters
    ----------
    theta, signs, lead, G, u, b, layout, nu
        As for `loop_levels`.
    omega : (a p,)
        The frequencies exp(`log_peaks` + `around`), all peaks beside each other first.
    terms, s : Terms, float
        The goal, and the value whose demand it is.
    log_peaks, around : (p,), (a,)
        Where the peaks are, and the distances at which to look.
    scales : (p, scales)
        Log of the squared scales at the peaks.
    least : float
        Stands for a level of minus infinity.

    """
    peaks, points = log_peaks.size, around.size
    y, cold = np.empty((omega.size, scales.shape[1])), False
    for k in range(omega.size):
        y[k] = scales[k % peaks]
    level, _, _ = loop_levels(
        theta, signs, lead, omega, G, u, b, layout, not terms.skewed, nu, cold, y
    )
    demand, _ = all_demands(s, omega, terms)
    found = np.empty(peaks)
    for p in range(peaks):
        top, highest = 0, -math.inf
        for i in range(points):
            k = i * peaks + p
            level[k] = max(level[k], least)
            if demand[k] - level[k] > highest:
                top, highest = i, demand[k] - level[k]
        top = min(max(top, 1), points - 2)
        k = top * peaks + p
        left, here, right = (
            demand[k - peaks] - level[k - peaks],
            demand[k] - level[k],
            demand[k + peaks] - level[k + peaks],
        )
        low, middle, high = (
            log_peaks[p] + around[top - 1],
            log_peaks[p] + around[top],
            log_peaks[p] + around[top + 1],
        )
        rise, fall = (here - left) / (middle - low), (here - right) / (high - middle)
        share = rise / max(rise + fall, TINY)
        vertex = 0.5 * (low + middle) + 0.5 * (high - low) * share
        found[p] = min(max(vertex, low), high)
    return found
