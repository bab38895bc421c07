"""Taylor models in double precision, rounded outwards: cheap enclosures that are still proofs.

A function of t, -1 <= t <= 1, is a polynomial of degree below `DEGREE` and a radius that holds the
rest and all rounding: |f(t) - p(t)| <= radius. A pool holds many of them, one a row: coefficients,
their magnitudes and the radii. Every operation adds `ROUNDING` times the magnitudes that went into
it, more than any of its sums of products can lose.

K. Makino and M. Berz, "Taylor models and other validated functional inclusion methods", Int. J.
Pure Appl. Math. 4 (2003); N. Revol, K. Makino and M. Berz, "Taylor models and floating-point
arithmetic: proof that arithmetic operations are validated in COSY", J. Log. Algebr. Program. 64
(2005), for the rounding.
"""

import math

import numpy as np

from solver.mu.workspace import compiled, inner

__all__ = [
    "DEGREE",
    "ROUNDING",
    "add_product",
    "copy_scaled",
    "disc",
    "finish",
    "multiply",
    "norm",
    "phasor",
    "polynomial",
    "pool",
    "reciprocal",
    "set_zero",
    "shift",
]

DEGREE = 8
# A sum of 8 complex products errs by at most 12 units of rounding, 1.4e-15, of its magnitudes.
ROUNDING = 4e-15
OUTWARD = 1 + ROUNDING  # on a radius: a sum of positive numbers, each right to a few units


@compiled
def pool(size):
    """Room for `size` models."""
    return np.zeros((size, DEGREE), np.complex128), np.zeros((size, DEGREE)), np.zeros(size)


@inner
def norm(models, a):
    """Sum of the magnitudes of the coefficients."""
    sizes = models[1]
    total = 0.0
    for k in range(DEGREE):
        total += sizes[a, k]
    return total


@inner
def finish(models, a):
    """Magnitudes of the coefficients, after they were written."""
    P, sizes, _ = models
    for k in range(DEGREE):
        z = P[a, k]
        sizes[a, k] = math.sqrt(z.real * z.real + z.imag * z.imag) * OUTWARD


@inner
def set_zero(models, a):
    """Set a model to zero."""
    P, sizes, radius = models
    for k in range(DEGREE):
        P[a, k] = 0j
        sizes[a, k] = 0.0
    radius[a] = 0.0


@inner
def disc(models, a):
    """Let a model hold every number of modulus at most one."""
    set_zero(models, a)
    models[2][a] = 1.0


@inner
def copy_scaled(models, a, factor, out):
    """Set `out` to factor a, for a real factor that is right to one unit of rounding."""
    P, sizes, radius = models
    size = abs(factor)
    radius[out] = (radius[a] + ROUNDING * norm(models, a)) * size * OUTWARD
    for k in range(DEGREE):
        P[out, k] = factor * P[a, k]
        sizes[out, k] = sizes[a, k] * size


@inner
def shift(models, a, factor, b):
    """Add factor b to a, for a real factor right to one unit of rounding; `finish` is due."""
    P, sizes, radius = models
    size, loss = abs(factor), 0.0
    for k in range(DEGREE):
        loss += sizes[a, k] + size * sizes[b, k]
        P[a, k] += factor * P[b, k]
    radius[a] = (radius[a] + size * radius[b] + ROUNDING * loss) * OUTWARD


@inner
def multiply(models, a, b, out):
    """Set `out`, another row, to a b."""
    P, sizes, radius = models
    tail, suffix = 0.0, 0.0
    for k in range(DEGREE):
        value = 0j
        for i in range(k + 1):
            value += P[a, i] * P[b, k - i]
        P[out, k] = value
        if k > 0:
            suffix += sizes[b, DEGREE - k]
            tail += sizes[a, k] * suffix
    na, nb = norm(models, a), norm(models, b)
    ra, rb = radius[a], radius[b]
    radius[out] = (tail + ra * (nb + rb) + rb * na + ROUNDING * na * nb) * OUTWARD
    finish(models, out)


@inner
def add_product(models, a, b, factor, out):
    """Add factor a conj(b) to `out`, for a real factor; `finish` is due.

    The factor is right to one unit of rounding.
    """
    P, sizes, radius = models
    tail, suffix = 0.0, 0.0
    for k in range(DEGREE):
        value = 0j
        for i in range(k + 1):
            value += P[a, i] * np.conj(P[b, k - i])
        P[out, k] += factor * value
        if k > 0:
            suffix += sizes[b, DEGREE - k]
            tail += sizes[a, k] * suffix
    na, nb = norm(models, a), norm(models, b)
    ra, rb = radius[a], radius[b]
    rest = tail + ra * (nb + rb) + rb * na
    # Twice the products' share: what is in `out` is a sum of such products and loses as much.
    radius[out] += (rest + 2.0 * ROUNDING * (na * nb + rest)) * abs(factor) * OUTWARD


@inner
def reciprocal(models, a, out):
    """Set `out` to 1/a; False where a may vanish."""
    P, sizes, radius = models
    na = norm(models, a)
    least = 2.0 * sizes[a, 0] - na * OUTWARD - radius[a]
    if not least > 0.0:
        return False
    first = 1.0 / P[a, 0]
    P[out, 0] = first
    for k in range(1, DEGREE):
        value = 0j
        for i in range(1, k + 1):
            value += P[a, i] * P[out, k - i]
        P[out, k] = -first * value
    finish(models, out)
    tail, suffix = 0.0, 0.0
    for k in range(1, DEGREE):
        suffix += sizes[out, DEGREE - k]
        tail += sizes[a, k] * suffix
    nq = norm(models, out)
    # p q = 1 + excess, hence |1/f - q| <= (|excess| + r |q|)/|f|.
    radius[out] = (tail + radius[a] * nq + 2.0 * ROUNDING * na * nq) / least * OUTWARD
    return True


@inner
def polynomial(models, mantissa, exponent, count, power, z0, z1, out):
    """Set out 2^shift to sum mantissa_k 2^(exponent_k + power k) (z0 + z1 t)^k; return the shift.

    The variable is 2^power (z0 + z1 t), so that |z0| + |z1| is about one.
    """
    P, _, radius = models
    top = -(1 << 30)
    for k in range(count):
        if mantissa[k] != 0.0:
            top = max(top, exponent[k] + power * k)
    set_zero(models, out)
    reach = abs(z0) + abs(z1)
    rest, size = 0.0, 0.0
    for k in range(count - 1, -1, -1):
        rest = rest * reach + abs(P[out, DEGREE - 1]) * abs(z1)
        for i in range(DEGREE - 1, 0, -1):
            P[out, i] = z0 * P[out, i] + z1 * P[out, i - 1]
        P[out, 0] = z0 * P[out, 0]
        value = 0.0
        if mantissa[k] != 0.0:
            # Terms 300 decades below the largest one vanish; 1e-290 stands for them.
            value = math.ldexp(mantissa[k], max(exponent[k] + power * k - top, -1000))
        P[out, 0] += value
        size = size * reach + abs(value)
    radius[out] = (rest + ROUNDING * (count + 1) * size + 1e-290) * OUTWARD
    finish(models, out)
    return top


@inner
def phasor(models, dead_time, middle, half, out):
    """Set `out` to exp(-j dead_time (middle + half t))."""
    P, _, radius = models
    phase, turn = dead_time * middle, dead_time * half
    start = complex(math.cos(phase), -math.sin(phase))
    step = complex(0.0, -turn)
    term = 1.0 + 0j
    rest = 1.0
    for k in range(DEGREE):
        P[out, k] = start * term
        term = term * step / (k + 1.0)
        rest = rest * turn / (k + 1.0)
    # The derivatives have modulus turn^k; a phase and a turn are right to one unit of rounding.
    lost = ROUNDING * (1.0 + abs(phase)) + ROUNDING * turn
    radius[out] = (abs(rest) + lost * math.exp(turn)) * OUTWARD
    finish(models, out)
