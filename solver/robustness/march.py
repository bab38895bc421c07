"""Marches along the frequency axis, each step an interval on which a statement is proven."""

import math

import numpy as np

from solver.mu.workspace import compiled, inner
from solver.robustness.enclosed_forms import holds

__all__ = ["march"]

WIDER, NARROWER = 1.3, 0.6  # change of log(ratio) after an interval was proven, or not
REST = 0.2  # of a step: a remainder shorter than that goes with it


@inner
def _scales_at(log_omega, y, at, x):
    """Squared D-scales at a frequency, interpolated in logarithms."""
    above = min(max(np.searchsorted(log_omega, at), 1), log_omega.size - 1)
    left, right = log_omega[above - 1], log_omega[above]
    share = min(max((at - left) / (right - left), 0.0), 1.0)
    for i in range(x.size):
        x[i] = math.exp((1 - share) * y[above - 1, i] + share * y[above, i])


@compiled
def march(
    T, S, log_omega, y, low, high, log_ratio, shortest, attempts, level2, kind, angles, trail
):
    """Prove a statement from `low` to `high`, in steps as long as can be proven.

    An interval that reaches 0 or infinity is one step; `log_omega` counts as its middle.

    Parameters
    ----------
    T, S : Tables, Scratch
        The loop.
    log_omega, y : (k,), (k, scales)
        Log of frequencies, ascending, at least two, and of the squared D-scales best there.
    low, high : float
        Where to begin and to end, rad per time unit.
    log_ratio, shortest : float
        Log of the ratio of the ends of the first step, and where to give up.
    attempts : int
        Steps that may be tried.
    level2, kind, angles
        As for `solver.robustness.enclosed_forms.holds`.
    trail : (k,)
        The ends of the first k steps are left here.

    Returns
    -------
    reached : float
        The statement is proven from `low` to here.
    log_ratio : float
        Of the next step.
    attempts : int
        What is left.

    """
    x = np.empty(y.shape[1])
    step = 0
    open_ended = low == 0.0 or high == math.inf
    while low < high and attempts > 0 and log_ratio > shortest:
        attempts -= 1
        end, middle = high, log_omega[0]
        if not open_ended:
            end = low * math.exp(log_ratio)
            if end * math.exp(REST * log_ratio) >= high:
                end = high
            if not end > low:
                break
            middle = 0.5 * (math.log(low) + math.log(end))
        _scales_at(log_omega, y, middle, x)
        if holds(T, S, low, end, x, level2, kind, angles):
            low = end
            if step < trail.size:
                trail[step] = end
                step += 1
            log_ratio *= WIDER
        elif open_ended:
            break
        else:
            log_ratio = NARROWER * math.log(end / low)
    return low, log_ratio, attempts
