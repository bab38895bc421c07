"""The loop in doubles, as compiled enclosures take it: each exact number rounded once."""

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np
from flint import fmpq, fmpq_poly
from numpy.typing import NDArray

from solver.certificate.enclosed_loop import ExactLoop
from solver.certificate.enclosures import Ratio
from solver.certificate.reduction import ExactBlock
from solver.robustness.rounded_models import DEGREE, pool

__all__ = ["Scratch", "Tables", "scratch", "tables"]

# Mantissa and power of two of each coefficient of a polynomial, ascending.
_Coefficients = list[tuple[float, int]]


class Tables(NamedTuple):
    """The loop in doubles.

    Terms are rational functions with dead time: controllers, w_P, those of w_I, the plant's.
    Polynomials in s (0) and in 1/s (1), ascending: `num[0 or 1, term]` is a mantissa, `num_power`
    its power of two. A job is a term times `job_factors` powers of s that goes to the model
    `job_out`, as its first part or one more: controllers, w_P, w_I of each of them or one for all,
    and the uses that the plant's entries make of a response. `powers` of s of each controller, and
    those `wanted` by w_P, are its poles at s = 0; rows take those of the plant, or `columns` do, as
    many as each of the D-scales is `lifted`. `scales`: D-scale of each row, -1 of one that does not
    err.
    """

    num: NDArray[np.float64]
    num_power: NDArray[np.int64]
    num_count: NDArray[np.int64]
    den: NDArray[np.float64]
    den_power: NDArray[np.int64]
    den_count: NDArray[np.int64]
    integrators: NDArray[np.int64]
    dead_time: NDArray[np.float64]
    controllers: int
    uncertainties: int
    job_term: NDArray[np.int64]
    job_factors: NDArray[np.int64]
    job_out: NDArray[np.int64]
    job_first: NDArray[np.bool_]
    uses: int
    row0: NDArray[np.int64]
    entry0: NDArray[np.int64]
    settings: NDArray[np.int64]
    scales: NDArray[np.int64]
    weights: NDArray[np.float64]
    row_integrators: NDArray[np.int64]
    columns: NDArray[np.int64]
    lifted: NDArray[np.int64]
    powers: NDArray[np.int64]
    wanted: int
    demanded: NDArray[np.bool_]
    multiplicity: NDArray[np.int64]
    combination: NDArray[np.float64]
    factor: NDArray[np.float64]
    use: NDArray[np.int64]


def tables(loop: ExactLoop, *, by_columns: bool = False) -> Tables:
    """Return a loop's numbers as compiled code wants them.

    `by_columns`: the plant's poles at s = 0 are taken from the columns of G, not from its rows, so
    that a squared D-scale stands for x/|sigma^k|^2, k that of its column: without bound towards
    s = 0, as it has to be where the plant alone integrates what a demand without offset wants.
    """
    integrating = _integrating(loop)
    columns = [[integrating[setting] for setting in block.settings] for block in loop.blocks]
    terms: list[tuple[fmpq, Ratio]] = [(fmpq(0), ratio) for ratio in loop.controllers]
    terms.append((fmpq(0), loop.performance))
    jobs = [(index, loop.powers(index), index, True) for index in range(len(loop.controllers))]
    jobs.append((len(loop.controllers), loop.performance.integrators, len(loop.controllers), True))
    functions = len(terms)
    for response in loop.uncertainties:
        start = len(terms)
        terms += response.terms
        jobs += [(k, 0, functions, k == start) for k in range(start, len(terms))]
        functions += 1
    ranges: dict[int, tuple[int, int]] = {}
    uses: dict[tuple[int, int], int] = {}
    use = []
    for block, own in zip(loop.blocks, columns, strict=True):
        for row, of_row in zip(block.responses, block.integrators, strict=True):
            for response, of_column in zip(row, own, strict=True):
                count = of_column if by_columns else of_row
                if id(response) not in ranges:
                    ranges[id(response)] = len(terms), len(terms) + len(response.terms)
                    terms += response.terms
                key = id(response), count
                if key not in uses:
                    uses[key] = len(uses)
                use.append(uses[key])
    for (response_id, count), out in uses.items():
        start, end = ranges[response_id]
        jobs += [(k, count, functions + out, k == start) for k in range(start, end)]
    sizes = [len(block.settings) for block in loop.blocks]
    longest = max(
        max(ratio.num.degree(), ratio.den.degree() + ratio.integrators) for _, ratio in terms
    )
    rationals = [ratio for _, ratio in terms]
    num = [
        [
            _coefficients(r.num, 0),
            _coefficients(r.num, r.den.degree() + r.integrators, inverse=True),
        ]
        for r in rationals
    ]
    den = [
        [_coefficients(r.den, 0), _coefficients(r.den, r.den.degree(), inverse=True)]
        for r in rationals
    ]
    num_arrays, den_arrays = _packed(num, longest + 1), _packed(den, longest + 1)
    return Tables(
        *num_arrays,
        *den_arrays,
        integrators=np.array([r.integrators for r in rationals]),
        dead_time=np.array([_double(theta) for theta, _ in terms]),
        controllers=len(loop.controllers),
        uncertainties=len(loop.uncertainties),
        job_term=np.array([job[0] for job in jobs]),
        job_factors=np.array([job[1] for job in jobs]),
        job_out=np.array([job[2] for job in jobs]),
        job_first=np.array([job[3] for job in jobs]),
        uses=len(uses),
        row0=np.cumsum([0, *sizes]),
        entry0=np.cumsum([0, *(size * size for size in sizes)]),
        settings=np.concatenate([np.array(block.settings) for block in loop.blocks]),
        scales=np.concatenate([_scales(loop, block) for block in loop.blocks]),
        weights=np.array([_double(w) for block in loop.blocks for w in block.weights]),
        row_integrators=np.array(
            [0 if by_columns else k for block in loop.blocks for k in block.integrators]
        ),
        columns=np.array([k if by_columns else 0 for own in columns for k in own]),
        lifted=np.array(integrating[loop.blocks[0].exact :]) * by_columns,
        powers=np.array([loop.powers(index) for index in range(len(loop.controllers))]),
        wanted=loop.performance.integrators,
        demanded=np.array([demanded for block in loop.blocks for demanded in block.demanded]),
        multiplicity=np.array([block.multiplicity for block in loop.blocks]),
        combination=_entries([block.combination for block in loop.blocks]),
        factor=_entries([block.factors for block in loop.blocks]),
        use=np.array(use),
    )  # fmt: skip


def _integrating(loop: ExactLoop) -> list[int]:
    """Return the most poles at s = 0 that a column of each of the settings has, in any block.

    Of all settings, where they share one D-scale.
    """
    found = [0] * len(loop.controllers)
    for block in loop.blocks:
        for row in block.responses:
            for setting, response in zip(block.settings, row, strict=True):
                found[setting] = max(found[setting], response.integrators)
    return [max(found)] * len(found) if loop.full else found


def _scales(loop: ExactLoop, block: ExactBlock) -> NDArray[np.int64]:
    """Return the D-scale of each row of a block; -1: it does not err."""
    own = np.array(block.settings) - block.exact
    return np.where(own < 0, -1, 0 if loop.full else own)


def _entries(matrices: Sequence[Sequence[Sequence[fmpq]]]) -> NDArray[np.float64]:
    """Return all entries, matrix by matrix and row by row."""
    return np.array([_double(v) for matrix in matrices for row in matrix for v in row])


def _double(value: fmpq) -> float:
    return int(value.p) / int(value.q)


def _coefficients(polynomial: fmpq_poly, degree: int, *, inverse: bool = False) -> _Coefficients:
    """Mantissa and power of two of each coefficient, ascending, right to one rounding."""
    values = polynomial.coeffs()
    if inverse:
        values = [fmpq(0)] * (degree + 1 - len(values)) + values[::-1]
    found = []
    for value in values:
        p, q = int(value.p), int(value.q)
        power = p.bit_length() - q.bit_length()
        found.append((p / (q << power) if power >= 0 else (p << -power) / q, power))
    return found


def _packed(
    terms: Sequence[Sequence[_Coefficients]], length: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    mantissa = np.zeros((2, len(terms), length))
    power = np.zeros((2, len(terms), length), dtype=np.int64)
    count = np.zeros((2, len(terms)), dtype=np.int64)
    for index, variants in enumerate(terms):
        for variant, values in enumerate(variants):
            count[variant, index] = len(values)
            for k, (m, e) in enumerate(values):
                mantissa[variant, index, k], power[variant, index, k] = m, e
    return mantissa, power, count


@cache
def _bernstein() -> NDArray[np.float64]:
    """Row k: weights of the powers of t in the k-th control point on [-1, 1], all at most one.

    b_k = sum_j C(k, j)/C(degree, j) a_j in powers of u = (1 + t)/2: Farouki (2012), eq. 13.
    """
    degree = DEGREE - 1
    found = np.zeros((DEGREE, DEGREE))
    for power in range(DEGREE):
        in_u = [math.comb(power, j) * 2**j * (-1) ** (power - j) for j in range(power + 1)]
        for k in range(DEGREE):
            terms = (
                Fraction(math.comb(k, j), math.comb(degree, j)) * a for j, a in enumerate(in_u)
            )
            found[k, power] = float(sum(terms))
    return found


class Scratch(NamedTuple):
    """Models and matrices; `E`, `G`, `R`, `F` are the first rows of the matrices' models."""

    P: NDArray[np.complex128]
    sizes: NDArray[np.float64]
    radius: NDArray[np.float64]
    bernstein: NDArray[np.float64]
    point: NDArray[np.complex128]
    inverse: NDArray[np.complex128]
    found: NDArray[np.float64]
    work: NDArray[np.complex128]
    root: NDArray[np.float64]
    uses: int
    E: int
    G: int
    R: int
    M: int
    F: int
    spare: int


def scratch(T: Tables) -> Scratch:
    """Room to work in."""
    size, blocks = int(np.diff(T.row0).max()), T.row0.size - 1
    uses = T.controllers + 1 + T.uncertainties
    E = uses + T.uses
    G, R, M, F = E + size**2, E + 2 * size**2, E + 3 * size**2, E + 3 * size**2 + size
    spare = F + size**2
    P, sizes, radius = pool(spare + 6)
    square = np.zeros((size, size), np.complex128)
    return Scratch(
        P, sizes, radius, _bernstein(), square,
        np.zeros((blocks, size, size), np.complex128), np.zeros(blocks),
        np.zeros((size, 2 * size), np.complex128), np.zeros(size), uses, E, G, R, M, F, spare,
    )  # fmt: skip
