"""What must be positive on an interval of frequencies, and what must not vanish there.

With E = I + G C, X = diag(d_i^2) and the diagonal M, all in the coordinates of
`solver.certificate.reduction` and with rows multiplied by powers of s,

    F = gamma^2 E M^-1 E^H - G X^-1 G^H - I,      M = |w_I|^2 C^H X C + |w_P|^2 I

is positive definite iff sigma_max(D N_RP D^-1) < gamma (`solver.certificate.enclosed_loop`).
Without the last term and w_P it says the same of w_I C S G, without the middle one and w_I of
w_P S. Where outputs err, the second half of them is not demanded anything of: w_P and the 1 of the
last term are 0 there. A column of E takes as many powers of s as its controller has poles at
s = 0, M in its own right those of w_P; where the demand has fewer than the column, w_P alone would
let M vanish at s = 0: on the interval from there a trifle is added, which only raises the bound. In
place of rows, columns of G may be multiplied by powers of s (`solver.robustness.tables`). What
loops move that share inputs does not err: w_I and the columns of G are 0 there, or a trifle where M
would vanish. The loop comes from the certificate's exact numbers, each rounded once.
"""

import math

import numpy as np

from solver.mu.recomputed import NOMINAL, STABILITY
from solver.mu.workspace import inner
from solver.robustness.rounded_models import (
    DEGREE,
    ROUNDING,
    add_product,
    copy_scaled,
    disc,
    finish,
    multiply,
    norm,
    phasor,
    polynomial,
    reciprocal,
    set_zero,
    shift,
)

__all__ = ["TURN", "holds"]

# Robust performance, robust stability, nominal performance, and the argument of det E.
TURN = 3  # beside the curves of `solver.mu.recomputed`: the winding
ON_AXIS, IN_DISK = 0, 1
LONGEST_TURN = 1.5  # rad of exp(-theta s) to either side of the middle; beyond, any phase stands
SLIGHT = 1e-8  # of what shared inputs err by, or of w_P: a larger M is a stronger claim
CLEAR_OF_CUT = 3.0  # rad: an argument nearer to pi than this leaves could be taken for its negative
TRIFLE = 1e-6  # of M over what makes a column of F as large as the demand
LEAST_DETERMINANT = 1e-2  # relative to the identity's; smaller ones have no sure argument
LARGEST_LOSS = 1e-4  # of a determinant's entries, for the same reason


@inner
def _variable(low, high, where):
    """Variant 0 (s) or 1 (1/s), its power of two, z0 and z1, and middle and half of omega.

    `where` IN_DISK: all of |1/s| <= 1/low in place of the axis.
    """
    if high == math.inf:
        reach = 1.0 / low
        power = math.frexp(reach)[1]
        scaled = math.ldexp(reach, -power)
        if where == IN_DISK:
            return 1, power, 0j, complex(0.0, -scaled * (1 + ROUNDING)), 0.0, math.inf
        half = 0.5 * scaled
        return 1, power, complex(0.0, -half), complex(0.0, -half * (1 + ROUNDING)), 0.0, math.inf
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if high > low:
        half += ROUNDING * high
    power = math.frexp(high)[1]
    z0, z1 = math.ldexp(middle, -power), math.ldexp(half, -power)
    return 0, power, complex(0.0, z0), complex(0.0, z1), middle, half


@inner
def _ratio(T, models, term, factors, var, spare, out):
    """Set `out` to sigma^factors times a term without its dead time; False at a possible pole."""
    variant, power, z0, z1, _, _ = var
    up = polynomial(
        models, T.num[variant, term], T.num_power[variant, term], T.num_count[variant, term],
        power, z0, z1, spare,
    )  # fmt: skip
    down = polynomial(
        models, T.den[variant, term], T.den_power[variant, term], T.den_count[variant, term],
        power, z0, z1, spare + 1,
    )  # fmt: skip
    if not reciprocal(models, spare + 1, spare + 2):
        return False
    multiply(models, spare, spare + 2, out)
    exponent = up - down
    if variant == 0:
        exponent -= power * T.integrators[term]
        P = models[0]
        set_zero(models, spare + 1)
        P[spare + 1, 0], P[spare + 1, 1] = z0, z1
        finish(models, spare + 1)
        for _ in range(factors - T.integrators[term]):
            multiply(models, out, spare + 1, spare)
            copy_scaled(models, spare, 1.0, out)
    copy_scaled(models, out, math.ldexp(1.0, min(max(exponent, -1000), 1000)), out)
    return -1000 < exponent < 1000


@inner
def _enclose(T, S, var):
    """Models of the controllers, of |w_P|^2 and |w_I|^2, and of the plant's responses."""
    models, spare = (S.P, S.sizes, S.radius), S.spare
    _, _, _, _, middle, half = var
    for k in range(T.job_out.size):
        term, out = T.job_term[k], T.job_out[k]
        if not _ratio(T, models, term, T.job_factors[k], var, spare, spare + 3):
            return False
        if T.job_first[k]:
            set_zero(models, out)
        if T.dead_time[term] > 0.0:
            if T.dead_time[term] * half > LONGEST_TURN:
                disc(models, spare)
            else:
                phasor(models, T.dead_time[term], middle, half, spare)
            multiply(models, spare + 3, spare, spare + 4)
            copy_scaled(models, spare + 4, 1.0, spare + 3)
        shift(models, out, 1.0, spare + 3)
        finish(models, out)
    for out in range(T.controllers, S.uses):
        set_zero(models, spare)
        add_product(models, out, out, 1.0, spare)
        finish(models, spare)
        copy_scaled(models, spare, 1.0, out)
    return True


@inner
def _powers(models, var, count, spare, out):
    """Set `out` to sigma^count."""
    variant, _, z0, z1, _, _ = var
    P = models[0]
    set_zero(models, out)
    P[out, 0] = 1.0
    finish(models, out)
    if variant == 0:
        set_zero(models, spare)
        P[spare, 0], P[spare, 1] = z0, z1
        finish(models, spare)
        for _ in range(count):
            multiply(models, out, spare, spare + 1)
            copy_scaled(models, spare + 1, 1.0, out)


@inner
def _enclose_matrices(T, S, var, block):
    """Models of T G and T (I + G C) of a block, rows and columns multiplied by powers of sigma."""
    models, spare = (S.P, S.sizes, S.radius), S.spare
    row, entry = T.row0[block], T.entry0[block]
    size = T.row0[block + 1] - row
    powers = 0
    for r in range(size):
        for i in range(size):
            own = T.row_integrators[row + r] + T.columns[row + i] + T.powers[T.settings[row + i]]
            if i == 0 or own != powers:
                powers = own
                _powers(models, var, powers, spare, spare + 3)
            at = r * size + i
            copy_scaled(models, S.uses + T.use[entry + at], T.factor[entry + at], S.G + at)
            multiply(models, S.G + at, T.settings[row + i], S.E + at)
            shift(models, S.E + at, T.combination[entry + at], spare + 3)
            finish(models, S.E + at)


@inner
def _squares(models, a, count, square, spare):
    """Multiply a by |sigma|^2 `count` times, if at all."""
    for _ in range(count):
        multiply(models, a, square, spare)
        copy_scaled(models, spare, 1.0, a)


@inner
def _form(T, S, var, block, x, level2, kind):
    """Models of the lower triangle of F by rows, from S.F on; False where M may be singular."""
    models, spare = (S.P, S.sizes, S.radius), S.spare
    row, entry = T.row0[block], T.entry0[block]
    size = T.row0[block + 1] - row
    square = spare + 5  # |sigma|^2
    _powers(models, var, 1, spare, spare + 3)
    set_zero(models, square)
    add_product(models, spare + 3, spare + 3, 1.0, square)
    finish(models, square)
    for i in range(size):
        setting = T.settings[row + i]
        demanded = kind != STABILITY and T.demanded[row + i]
        powers = T.powers[setting] + T.columns[row + i]
        lacking = T.wanted - powers if demanded else 0
        set_zero(models, spare)
        errs = T.scales[row + i] >= 0
        scale = 0.0
        if errs:
            scale = x[T.scales[row + i]]
        elif kind == STABILITY:
            for r in range(size):
                if T.scales[row + r] >= 0:
                    moved = T.factor[entry + r * size + i]
                    scale += SLIGHT * x[T.scales[row + r]] * moved * moved
        if kind != NOMINAL and scale > 0.0:
            set_zero(models, spare + 1)
            add_product(models, setting, setting, scale, spare + 1)
            finish(models, spare + 1)
            own = setting if T.uncertainties > 1 else 0
            multiply(models, spare + 1, T.controllers + 1 + own, spare)
            _squares(models, spare, lacking, square, spare + 1)
        if demanded:
            copy_scaled(models, T.controllers, 1.0, spare + 2)
            _squares(models, spare + 2, -lacking, square, spare + 1)
            shift(models, spare, 1.0, spare + 2)
            if lacking < 0 and not errs:
                shift(models, spare, SLIGHT, T.controllers)
            if kind == NOMINAL and lacking < 0 and var[0] == 0 and var[5] >= var[4]:
                largest = 0.0
                for r in range(size):
                    largest = max(largest, norm(models, S.E + r * size + i))
                models[0][spare, 0] += max(
                    norm(models, T.controllers), TRIFLE * level2 * largest**2
                )
            finish(models, spare)
        if not reciprocal(models, spare, S.M + i):
            return False
        _squares(models, S.M + i, lacking, square, spare + 1)
        for r in range(size):
            multiply(models, S.E + r * size + i, S.M + i, S.R + r * size + i)
    for r in range(size):
        for c in range(r + 1):
            out = S.F + r * size + c
            set_zero(models, out)
            if kind != STABILITY:
                constant = 0.0
                for i in range(size):
                    if not T.demanded[row + i]:
                        continue
                    constant += (
                        T.weights[row + i]
                        * T.combination[entry + r * size + i]
                        * T.combination[entry + c * size + i]
                    )
                _powers(models, var, T.row_integrators[row + r], spare, spare + 3)
                _powers(models, var, T.row_integrators[row + c], spare, spare + 4)
                # The sum's terms cancel between different rows: their rounding counts, not its.
                lost = 0.0
                for i in range(size):
                    lost += abs(
                        T.weights[row + i]
                        * T.combination[entry + r * size + i]
                        * T.combination[entry + c * size + i]
                    )
                add_product(models, spare + 3, spare + 4, -constant, out)
                models[2][out] += (
                    ROUNDING * lost * norm(models, spare + 3) * norm(models, spare + 4)
                )
            for i in range(size):
                weight = T.weights[row + i]
                add_product(models, S.R + r * size + i, S.E + c * size + i, level2 * weight, out)
                if kind != NOMINAL and T.scales[row + i] >= 0:
                    add_product(
                        models, S.G + r * size + i, S.G + c * size + i,
                        -weight / x[T.scales[row + i]], out,
                    )  # fmt: skip
            finish(models, out)
            models[2][out] += 8.0 * ROUNDING * norm(models, out)
    return True


@inner
def _is_positive(S, size):
    """Whether the Hermitian F is positive definite for every t: at its control points it is."""
    P, radius, root, A = S.P, S.radius, S.root, S.point
    for k in range(DEGREE):
        for r in range(size):
            for c in range(r + 1):
                value = 0j
                for j in range(DEGREE):
                    value += S.bernstein[k, j] * P[S.F + r * size + c, j]
                A[r, c] = value
            if not A[r, r].real > 0.0:
                return False
            root[r] = math.sqrt(A[r, r].real)
        for r in range(size):
            # F - A is Hermitian with entries below the radii: above -diag(sum_j e_rj s_r/s_j).
            lost = 0.0
            for c in range(size):
                at = S.F + r * size + c if c <= r else S.F + c * size + r
                lost += radius[at] / root[c]
            # Cholesky's own rounding: S. M. Rump, BIT 46 (2006), theorem 2.3.
            own = A[r, r].real * (1.0 - (size + 2.0) * ROUNDING) - lost * root[r] * (1 + ROUNDING)
            A[r, r] = complex(own, 0.0)
        for r in range(size):
            for c in range(r + 1):
                value = A[r, c]
                for j in range(c):
                    value -= A[r, j] * np.conj(A[c, j])
                if c < r:
                    A[r, c] = value / A[c, c]
                elif value.real > 0.0:
                    A[r, r] = complex(math.sqrt(value.real), 0.0)
                else:
                    return False
    return True


@inner
def _inverse(A, size, work, out):
    """Approximate inverse by Gauss-Jordan; False where there is none. Returns det too."""
    det = 1.0 + 0j
    for i in range(size):
        for j in range(size):
            work[i, j] = A[i, j]
            work[i, size + j] = 1.0 + 0j if i == j else 0j
    for column in range(size):
        pivot = column
        for i in range(column + 1, size):
            if abs(work[i, column]) > abs(work[pivot, column]):
                pivot = i
        if not abs(work[pivot, column]) > 0.0:
            return False, 0j
        if pivot != column:
            det = -det
            for j in range(2 * size):
                work[column, j], work[pivot, j] = work[pivot, j], work[column, j]
        det *= work[column, column]
        over = 1.0 / work[column, column]
        for j in range(2 * size):
            work[column, j] *= over
        for i in range(size):
            if i != column:
                factor = work[i, column]
                for j in range(2 * size):
                    work[i, j] -= factor * work[column, j]
    for i in range(size):
        for j in range(size):
            out[i, j] = work[i, size + j]
    return True, det


@inner
def _is_near_identity(S, block, size, disk):
    """Whether max_r sum_c |(A E)_rc - (r = c)| < sin(pi/k), or 1 for k = 1, for every t."""
    P, radius, A = S.P, S.radius, S.inverse[block]
    reach = math.sin(math.pi / max(size, 2)) * (1 - 1e-9)
    for k in range(1 if disk else DEGREE):
        for r in range(size):
            total = 0.0
            for c in range(size):
                value, size_here, rest = 0j, 0.0, 0.0
                for i in range(size):
                    at = S.E + i * size + c
                    entry, whole = 0j, 0.0
                    if disk:
                        entry = P[at, 0]
                        for j in range(1, DEGREE):
                            rest += abs(A[r, i]) * S.sizes[at, j]
                        whole = S.sizes[at, 0]
                    else:
                        for j in range(DEGREE):
                            entry += S.bernstein[k, j] * P[at, j]
                            whole += S.sizes[at, j]
                    value += A[r, i] * entry
                    size_here += abs(A[r, i]) * whole
                    rest += abs(A[r, i]) * radius[at]
                if r == c:
                    value -= 1.0
                total += abs(value) + rest + ROUNDING * size * size_here
            if not total < reach:
                return False
    return True


@inner
def _argument(S, block, size):
    """Argument of det(A E) at one frequency, and whether it is sure."""
    for r in range(size):
        lost = 0.0
        for c in range(size):
            value = 0j
            for i in range(size):
                value += S.inverse[block, r, i] * S.P[S.E + i * size + c, 0]
                lost += abs(S.inverse[block, r, i]) * (
                    S.radius[S.E + i * size + c] + ROUNDING * S.sizes[S.E + i * size + c, 0]
                )
            S.point[r, c] = value
        if not lost < LARGEST_LOSS:
            return 0.0, False
    regular, det = _inverse(S.point, size, S.work, S.point)
    angle = math.atan2(det.imag, det.real)
    return angle, regular and abs(det) > LEAST_DETERMINANT and abs(angle) < CLEAR_OF_CUT


@inner
def _invert_middle(S, block, size, tail):
    """Approximate inverse of E in the middle of an interval; real where it is to reach infinity."""
    for r in range(size):
        for c in range(size):
            value = S.P[S.E + r * size + c, 0]
            S.point[r, c] = complex(value.real, 0.0) if tail else value
    return _inverse(S.point, size, S.work, S.inverse[block])[0]


@inner
def holds(T, S, low, high, x, level2, kind, angles):
    """Whether a statement is proven on [low, high].

    Parameters
    ----------
    T, S : Tables, Scratch
        The loop.
    low, high : float
        Frequencies, rad per time unit; high may be infinite.
    x : (scales,)
        Squared D-scales.
    level2 : float
        The level's square.
    kind : int
        ROBUST, STABILITY, NOMINAL: the curve stays below the level. TURN: det E can be followed;
        its turn, in units of pi, is then added to `angles` (blocks,).

    On a finite interval E, times a fixed matrix, stays so close to the identity that the principal
    arguments at the ends tell the turn; an interval that reaches infinity goes on along the arc
    that closes the contour to the real axis (`solver.certificate.proof`).
    """
    tail = high == math.inf
    frames = 1
    if kind == TURN:
        frames = 2 if tail else 3
        for block in range(angles.size):
            S.found[block] = 0.0
    var = _variable(low, high, IN_DISK if tail and kind == TURN else ON_AXIS)
    variant, power = var[0], var[1]
    for frame in range(frames):
        if frame > 0:  # an end of the interval, in its powers of sigma
            omega = low if frame == 1 else high
            z0 = -math.ldexp(1.0 / omega, -power) if tail else math.ldexp(omega, -power)
            var = variant, power, complex(0.0, z0), 0j, omega, 0.0
        if not _enclose(T, S, var):
            return False
        for block in range(angles.size):
            size = T.row0[block + 1] - T.row0[block]
            _enclose_matrices(T, S, var, block)
            if kind != TURN:
                if not _form(T, S, var, block, x, level2 * (1 - ROUNDING), kind):
                    return False
                if not _is_positive(S, size):
                    return False
            elif frame == 0:
                if not _invert_middle(S, block, size, tail):
                    return False
                if not _is_near_identity(S, block, size, tail):
                    return False
            else:
                angle, sure = _argument(S, block, size)
                if not sure:
                    return False
                S.found[block] += angle / math.pi if frame == 2 else -angle / math.pi
    if kind == TURN:
        for block in range(angles.size):
            angles[block] += S.found[block]
            if tail:  # there rows and columns lack their powers of s, which turn by a quarter each
                powers = 0
                for row in range(T.row0[block], T.row0[block + 1]):
                    powers += T.row_integrators[row]
                    powers += T.powers[T.settings[row]]
                angles[block] -= 0.5 * powers
    return True
