"""Compiled: one evaluation of the search in one call, its followed peaks included."""

import math

import numpy as np

from solver.mu.kernel import FINE
from solver.mu.workspace import TINY, compiled
from solver.tuning.goal_levels import all_demands, judged
from solver.tuning.loop_levels import ends_at_rest, loop_levels, winds_as_stable
from solver.tuning.loop_samples import joined, samples

__all__ = ["BESIDE", "FORBIDDEN", "judged_loop", "judged_loops", "judged_with_peaks"]

FORBIDDEN = -50.0  # stands for a level of minus infinity where a curve is refined
BESIDE = 0.1  # log omega within which a peak is followed
FAR = BESIDE * np.array([-1, -0.3, 0, 0.3, 1])  # where it is looked for at first,
NEAR = BESIDE * np.array([-0.03, 0, 0.03])  # and then


@compiled
def judged_loop(theta, signs, lead, here, layout, terms, fixed, nu, cold, y):
    """Levels, gradients and demands of all frequencies, and whether the loop seems stable.

    Parameters
    ----------
    theta, signs, lead, layout, nu, cold, y
        As for `loop_levels`.
    here : Samples
        The frequencies.
    terms : Terms
        The goal.
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
        theta, signs, lead, here.omega, here.G, here.u, here.b, layout, not terms.skewed, nu, cold,
        y,
    )  # fmt: skip
    value, s, demand, slope, missing = judged(level, here.omega, here.saturated, terms)
    det = det[:fixed]
    winds = winds_as_stable(det, here.omega[:fixed])
    return level, gradient, demand, slope, value, s, missing, winds, ends_at_rest(det)


@compiled
def judged_with_peaks(
    theta, signs, lead, grid, sources, layout, terms, nu, cold, y, peaks, s, follows
):
    """Judge a loop on a grid and at its followed peaks.

    Parameters
    ----------
    theta, signs, lead, layout, terms, nu, cold, y
        As for `judged_loop`; the rows of `y` that belong to the peaks are the last ones.
    grid : Samples
        Of the fixed frequencies.
    sources : Sources
        Where those of the peaks come from.
    peaks : (p,)
        Where a neighbour saw them, rad per time unit.
    s : float
        The neighbour's value, whose demand they exceed most.
    follows : bool
        Whether the peaks have moved since; else they stay.

    Returns
    -------
    peaks : (p,)
        Where they are.
    judged : tuple
        As of `judged_loop`.

    """
    if follows:
        log_peaks, scales = np.log(peaks), y[y.shape[0] - peaks.size :]
        log_peaks = _vertices(theta, signs, lead, sources, layout, terms, s, log_peaks, FAR, scales)
        log_peaks = _vertices(
            theta, signs, lead, sources, layout, terms, s, log_peaks, NEAR, scales
        )
        peaks = np.exp(log_peaks)
    here = joined(grid, samples(sources, peaks))
    fixed = grid.omega.size
    return peaks, judged_loop(theta, signs, lead, here, layout, terms, fixed, nu, cold, y)


@compiled
def judged_loops(thetas, signs, lead, here, layout, terms, nu, scales):
    """Judge several settings at the same frequencies, each from scales of its own.

    Parameters
    ----------
    thetas : (t, m)
        The settings.
    signs, lead, here, layout, terms, nu
        As for `judged_loop`.
    scales : int
        Number of scales.

    Returns
    -------
    level, gradient, value, winds, rests : (t, k), (t, k, m), (t,), (t,), (t,)
        Of each settings, as of `judged_loop`.

    """
    settings, count, cold = thetas.shape[0], here.omega.size, True
    level, gradient = np.empty((settings, count)), np.empty((settings, count, thetas.shape[1]))
    value = np.empty(settings)
    winds, rests = np.empty(settings, np.bool_), np.empty(settings, np.bool_)
    for i in range(settings):
        y = np.zeros((count, scales))
        own, slopes, _, _, least, _, _, turns, ends = judged_loop(
            thetas[i], signs, lead, here, layout, terms, count, nu, cold, y
        )
        level[i], gradient[i], value[i], winds[i], rests[i] = own, slopes, least, turns, ends
    return level, gradient, value, winds, rests


@compiled
def _vertices(theta, signs, lead, sources, layout, terms, s, log_peaks, around, scales):
    """Return the peaks (p,) of the demand's excess, each at the vertex of a parabola.

    It goes through the highest of the points around and its neighbours: another peak may be as
    near as the farthest point.

    Parameters
    ----------
    theta, signs, lead, layout
        As for `loop_levels`.
    sources : Sources
        Where the samples come from.
    terms, s : Terms, float
        The goal, and the value whose demand it is.
    log_peaks, around : (p,), (a,)
        Where the peaks are, and the distances at which to look.
    scales : (p, scales)
        Log of the squared scales at the peaks.

    """
    peaks, points = log_peaks.size, around.size
    omega = np.empty(points * peaks)  # all peaks beside each other first
    for k in range(omega.size):
        omega[k] = math.exp(log_peaks[k % peaks] + around[k // peaks])
    here = samples(sources, omega)
    y, cold = np.empty((omega.size, scales.shape[1])), False
    for k in range(omega.size):
        y[k] = scales[k % peaks]
    level, _, _ = loop_levels(
        theta, signs, lead, omega, here.G, here.u, here.b, layout, not terms.skewed, FINE, cold, y
    )
    demand, _ = all_demands(s, omega, terms)
    found = np.empty(peaks)
    for p in range(peaks):
        top, highest = 0, -math.inf
        for i in range(points):
            k = i * peaks + p
            level[k] = max(level[k], FORBIDDEN)
            if demand[k] - level[k] > highest:
                top, highest = i, demand[k] - level[k]
        top = min(max(top, 1), points - 2)
        k = top * peaks + p
        left, top_value, right = (
            demand[k - peaks] - level[k - peaks],
            demand[k] - level[k],
            demand[k + peaks] - level[k + peaks],
        )
        low, middle, high = (
            log_peaks[p] + around[top - 1],
            log_peaks[p] + around[top],
            log_peaks[p] + around[top + 1],
        )
        rise, fall = (top_value - left) / (middle - low), (top_value - right) / (high - middle)
        share = rise / max(rise + fall, TINY)
        place = 0.5 * (low + middle) + 0.5 * (high - low) * share
        found[p] = min(max(place, low), high)
    return found
