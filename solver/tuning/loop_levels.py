"""Compiled: levels of a loop, their gradients in the settings, and its winding."""

import math

import numpy as np

from solver.model.controllers import DERIVATIVE_FILTER
from solver.mu.scaling import sweep
from solver.mu.workspace import compiled

__all__ = ["ends_at_rest", "loop_levels", "responses", "winds_as_stable"]

AT_REST = 0.2  # relative change of det over the last step, a loop gain of about 1/2 by then
SMALL_GAIN = 0.5  # of a loop at the last frequencies: it does not reach -1 beyond them


@compiled
def loop_levels(theta, signs, lead, omega, G, u, b, layout, all_free, nu, cold, y):
    """Level of every frequency at the settings `theta`, and what `solver.tuning.objective` needs.

    Parameters
    ----------
    theta : (m,)
        Logarithms of the magnitudes of the settings, controller by controller.
    signs : (controllers,)
        Sign of each gain.
    lead : bool
        Whether the third setting is a derivative time; what is left then is a filter time.
    omega : (k,)
        Frequencies, rad per time unit, ascending.
    G, u, b, layout, all_free, nu, cold, y
        As for `sweep`.

    Returns
    -------
    level : (k,)
        As for `sweep`.
    gradient : (k, m)
        Of the level in `theta`.
    det : (k, blocks) complex
        det(I + G C) of each block.

    """
    controllers = signs.size
    per = theta.size // controllers
    c, dc = responses(theta, signs, lead, omega)
    level, slope, det = sweep(G, c, u, b, layout, all_free, nu, cold, y)
    gradient = np.empty((omega.size, theta.size))
    for k in range(omega.size):
        for j in range(controllers):
            for i in range(per):
                gradient[k, j * per + i] = (slope[k, j] * dc[k, j, i]).real
    return level, gradient, det


@compiled
def winds_as_stable(det, omega):
    """Whether det (k, blocks) turns on the grid `omega` (k,) as those of a stable loop do.

    A quick test for the search; `solver.stability.closed_loop` decides on the result.
    """
    stable = True
    for block in range(det.shape[1]):
        stable &= _turns_to_zero(det[:, block], omega)
    return stable


@compiled
def ends_at_rest(det):
    """Whether det (k, blocks) changes no more at the last frequency: the loop ends below it.

    Or whether it stays near 1 there: a lead whose filter ends far higher keeps a small loop gain
    that dead time turns without end, and that turns round nothing.
    """
    last = det.shape[0] - 1
    rest = True
    for block in range(det.shape[1]):
        before, end = det[last - 1, block], det[last, block]
        small = max(abs(before - 1.0), abs(end - 1.0)) < SMALL_GAIN
        rest &= small or abs(end / before - 1.0) < AT_REST
    return rest


@compiled
def responses(theta, signs, lead, omega):
    """Responses (k, controllers), and derivatives in the logarithms of the settings."""
    controllers = signs.size
    per = theta.size // controllers
    lag = per - 1 if per == (4 if lead else 3) else 0  # place of the filter time
    c = np.empty((omega.size, controllers), np.complex128)
    dc = np.empty((omega.size, controllers, per), np.complex128)
    for j in range(controllers):
        own = theta[j * per : (j + 1) * per]
        gain = signs[j] * math.exp(own[0])
        integral_time = math.exp(own[1])
        derivative_time = math.exp(own[2]) if lead else 0.0
        filter_time = math.exp(own[lag]) if lag else DERIVATIVE_FILTER * derivative_time
        for k in range(omega.size):
            integral = gain / complex(0.0, omega[k] * integral_time)
            leading = complex(0.0, omega[k] * derivative_time)
            lagging = complex(0.0, omega[k] * filter_time)
            factor = (1.0 + leading) / (1.0 + lagging)
            c[k, j] = (gain + integral) * factor
            dc[k, j, 0] = c[k, j]
            dc[k, j, 1] = -integral * factor
            if lead:
                bend = leading / (1.0 + lagging)
                if not lag:  # the filter moves with the derivative time
                    bend -= lagging * (1.0 + leading) / ((1.0 + lagging) * (1.0 + lagging))
                dc[k, j, 2] = (gain + integral) * bend
            if lag:
                dc[k, j, lag] = -c[k, j] * lagging / (1.0 + lagging)
    return c, dc


@compiled
def _turns_to_zero(det, omega):
    """Whether det, s^-order times a positive number at first, ends without a turn."""
    last = omega.size - 1
    # Far enough from the first point for the slope there; peaks may lie beside it.
    other = min(np.searchsorted(omega, 1.2 * omega[0]), last)
    slope = math.log(abs(det[0]) / abs(det[other])) / math.log(omega[other] / omega[0])
    order = round(slope)
    start = det[0] * complex(0.0, 1.0) ** order
    start = start if start.real > 0.0 else -start
    turned = math.atan2(start.imag, start.real) - math.atan2(det[last].imag, det[last].real)
    for k in range(last):
        step = det[k + 1] * np.conj(det[k])
        turned += math.atan2(step.imag, step.real)
    return abs(turned - order * math.pi / 2) < 1.0
