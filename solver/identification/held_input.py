r"""Exact response of lags to an input that is held between its changes.

Between two changes of the input the state moves by a matrix exponential in closed form, so neither
the distance of the samples nor the dead time leaves an error beyond rounding. The lags are

    1/(b s + 1)   and   1, s over a s^2 + b s + 1,

the second one real or complex: with sigma = b/(2 a) and w^2 = sigma^2 - 1/a,
z(t) = e^(-sigma t) (z0 C + (v0 + sigma z0) S), C = cosh w t, S = sinh(w t)/w.
"""

import math

from solver.compiled import compiled

__all__ = ["free", "integral", "lag", "pair"]


@compiled(nogil=True)
def lag(time, at, level, b, delay, out):
    """Response of 1/(b s + 1) exp(-delay s) from rest.

    Parameters
    ----------
    time : (k,)
        Increasing, from 0 on.
    at, level : (c,)
        Times at which the input changes and its values from then on; 0 before.
    b, delay : float
        Lag > 0 and dead time >= 0.
    out : (k,)
        Filled with the response.

    """
    x = 0.0
    u = 0.0
    now = 0.0
    k = 0
    for index in range(time.size):
        then = time[index]
        while k < at.size and at[k] + delay <= then:
            change = at[k] + delay
            x = u + (x - u) * math.exp(-(change - now) / b)
            u = level[k]
            now = change
            k += 1
        x = u + (x - u) * math.exp(-(then - now) / b)
        now = then
        out[index] = x


@compiled(nogil=True)
def integral(time, at, level, delay, out):
    """Response of exp(-delay s)/s from rest; arguments as of `lag`."""
    x = 0.0
    u = 0.0
    now = 0.0
    k = 0
    for index in range(time.size):
        then = time[index]
        while k < at.size and at[k] + delay <= then:
            change = at[k] + delay
            x += u * (change - now)
            u = level[k]
            now = change
            k += 1
        x += u * (then - now)
        now = then
        out[index] = x


@compiled(nogil=True)
def _advance(z, v, a, b, t):
    """Move a z'' + b z' + z = 0 by t."""
    sigma = 0.5 * b / a
    square = sigma * sigma - 1.0 / a
    if square > 0.0:
        w = math.sqrt(square)
        slow = 1.0 / (a * (sigma + w))  # sigma - w, without its cancellation
        decay = math.exp(-slow * t)
        C = 0.5 * decay * (1.0 + math.exp(-2.0 * w * t))
        S = 0.5 * decay * -math.expm1(-2.0 * w * t) / w if w * t > 1e-8 else decay * t
    else:
        w = math.sqrt(-square)
        decay = math.exp(-sigma * t)
        C = decay * math.cos(w * t)
        S = decay * math.sin(w * t) / w if w * t > 1e-8 else decay * t
    return z * C + (v + sigma * z) * S, v * C - (sigma * v + z / a) * S


@compiled(nogil=True)
def pair(time, at, level, a, b, delay, out, slope):
    """Responses of 1 and of s over a s^2 + b s + 1, times exp(-delay s), from rest.

    Arguments as of `lag`; `out` and `slope` are filled.
    """
    y = 0.0
    v = 0.0
    u = 0.0
    now = 0.0
    k = 0
    for index in range(time.size):
        then = time[index]
        while k < at.size and at[k] + delay <= then:
            change = at[k] + delay
            z, v = _advance(y - u, v, a, b, change - now)
            y = z + u
            u = level[k]
            now = change
            k += 1
        z, v = _advance(y - u, v, a, b, then - now)
        y = z + u
        now = then
        out[index] = y
        slope[index] = v


@compiled(nogil=True)
def free(time, a, b, first, second):
    """Free motions of a y'' + b y' + y = 0: from y = 1 at rest, and from y = 0 at slope 1/b."""
    for index in range(time.size):
        z, _ = _advance(1.0, 0.0, a, b, time[index])
        first[index] = z
        z, _ = _advance(0.0, 1.0 / b, a, b, time[index])
        second[index] = z
