"""Compiled: what frequencies demand of the loop for the objective's value s, and permit."""

import math
from typing import NamedTuple

import numpy as np

from solver.mu.workspace import compiled, inner

__all__ = ["Terms", "all_attained", "all_demands", "judged"]

MOST = 500.0  # log p*, beyond which its square would be no number
# Far above the bandwidth a descent ends right on its limit. What the level lacks there by rounding,
# half as much in mu, is none; nor does less room than this stand for a tau_P.
LACKING, LEAST_ROOM = 1e-8, 1e-9


class Terms(NamedTuple):
    """A goal as compiled code takes it: M, A and log target^2; `skewed`: the objective is tau_P."""

    skewed: bool
    max_peak: float
    offset: float
    margin: float


@compiled
def judged(level, omega, saturated, terms):
    """Judge the levels of all frequencies.

    Parameters
    ----------
    level, omega, saturated : (k,)
        Levels, frequencies in rad per time unit, and the values of s from which they saturate.
    terms : Terms
        The goal.

    Returns
    -------
    value, s : float
        The least s of all frequencies, and that of those below saturation.
    demand, slope : (k,)
        Level that s demands of each frequency, and its slope in s.
    missing : float
        The most by which a level misses that, >= 0.

    """
    value = s = -np.inf
    for k in range(omega.size):
        here = _attained(level[k], omega[k], terms)
        value = max(value, here)
        s = max(s, min(here, saturated[k]))
    demand, slope = all_demands(s, omega, terms)
    missing = 0.0
    for k in range(omega.size):
        missing = max(missing, demand[k] - level[k])
    return value, s, demand, slope, missing


@inner
def _attained(level, omega, terms):
    """Least s that one frequency permits."""
    if not terms.skewed:
        return -level
    p = math.exp(min(level + terms.margin, MOST))
    # tau_P^2 = (1 - p A^2)/(p M^2 - 1)/omega^2, theory of the skewed form.
    room = p * terms.max_peak**2 - 1.0
    if not room > -LACKING:
        return np.inf
    room = max(room, LEAST_ROOM)
    rest = 1.0 - p * terms.offset**2
    return 0.5 * math.log(rest / room) - math.log(omega) if rest > 0.0 else -np.inf


@compiled
def all_attained(level, omega, terms):
    """Least s that each frequency (k,) permits, (k,)."""
    found = np.empty(omega.size)
    for k in range(omega.size):
        found[k] = _attained(level[k], omega[k], terms)
    return found


@compiled
def all_demands(s, omega, terms):
    """Level that s demands of each frequency (k,), and its slope in s, (k,) each."""
    level, slope = np.empty(omega.size), np.empty(omega.size)
    if not terms.skewed:
        level[:] = -s
        slope[:] = -1.0
        return level, slope
    M, A, square = terms.max_peak**2, terms.offset**2, math.exp(2.0 * s)
    for k in range(omega.size):
        here = square * omega[k] ** 2
        level[k] = math.log((here + 1.0) / (here * M + A)) - terms.margin
        slope[k] = 2.0 * here * (1.0 / (here + 1.0) - M / (here * M + A))
    return level, slope
