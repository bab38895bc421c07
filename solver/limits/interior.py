"""Newton's method inside a set of matrix inequalities that are coupled by few coefficients.

At each frequency and for each block of the plant, with Y = sum_j b_j X_j and A = A_0 + U Y L,

    W = (1 - f slack) I - T diag(c) T^H - A^H diag(1/(1 + c), I/(1 - h slack)) A > 0,

-1 < c < most, f >= 0 and 0 <= h <= 1, is convex in (X, c, slack): a Schur complement of a linear
matrix inequality. The slack is made as large as possible along the central path of -log det W
(Nesterov and Nemirovskii 1994; Boyd and Vandenberghe, section 11.3). The Hessian is a sum of small
ones, one a frequency, between which X and the slack alone are shared: c is eliminated where it
stands, and what is left has the size of X. A general conic solver factors all frequencies at once:
Clarabel takes 30 to 300 times as long on blocks of two to four channels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy import linalg

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["Inequalities", "Inequality", "largest_slack"]

INSIDE = 0.3  # of the slack below what holds: every W begins with eigenvalues of at least that
FIRST_GAP = 1.0  # of the slack, as far as it can rise
FASTER = 8.0  # by which the path's parameter grows
CENTRED = 0.5  # Newton decrement squared with which the path is followed on
MAX_NEWTON = 60  # of one point of the path: far more than it takes
SHARE = 0.2  # of the slack itself: what is left of the gap when a step is good enough
SMALLEST_GAP = 1e-4  # the same where the slack is small: steps that gain less than twice that end
ENOUGH = 0.1  # of the fall that the slope promises
SHORTEST = 1e-8  # step: rounding
RIDGE = 1e-13  # of the scaled Hessian's diagonal: what rounding leaves of a semidefinite one
HIGHER = 100.0  # times that, where rounding leaves more: few tries reach any


@dataclass(frozen=True, eq=False)
class Inequality:
    """The data of one block of m channels.

    Attributes
    ----------
    A : (k, 2 m, m) complex
        A_0: uncertain channels first.
    U : (k, 2 m, m), L : (k, m, m) complex
        Factors of Y.
    T : (k, s, m, m) complex
        Factor of each scale's change c.
    scales : (s, m)
        1 where a channel has a scale.

    """

    A: NDArray[np.complex128]
    U: NDArray[np.complex128]
    L: NDArray[np.complex128]
    T: NDArray[np.complex128]
    scales: NDArray[np.float64]

    @property
    def size(self) -> int:
        """Number of channels m."""
        return int(self.L.shape[1])


@dataclass(frozen=True, eq=False)
class Inequalities:
    """All blocks, and what they share.

    Attributes
    ----------
    blocks : list of Inequality
        The data of each.
    functions : (k, j) complex
        b_j, of which their Y are made.
    most : float
        The greatest c.
    fall : float
        f.
    rise : (k,)
        h.

    """

    blocks: list[Inequality]
    functions: NDArray[np.complex128]
    most: float
    fall: float
    rise: NDArray[np.float64]

    @cached_property
    def pairs(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Products of the functions (j j, k): real parts, imaginary ones, real with imaginary."""
        parts = self.functions.real, self.functions.imag

        def product(one: int, two: int) -> NDArray[np.float64]:
            each = parts[one].T[:, None, :] * parts[two].T[None, :, :]
            return np.asarray(each.reshape(-1, len(self.functions)))

        return product(0, 0), product(1, 1), product(0, 1)


class _Point(NamedTuple):
    """X (j, entries), entries of all blocks side by side; c (k, s); the slack."""

    X: NDArray[np.float64]
    c: NDArray[np.float64]
    slack: float


class _Matrices(NamedTuple):
    """A (k, 2 m, m) of one block, the diagonal E (k, 2 m) that weighs its rows, and W (k, m, m)."""

    A: NDArray[np.complex128]
    E: NDArray[np.float64]
    W: NDArray[np.complex128]


class _Local(NamedTuple):
    """Gradient (k, p) and Hessian (k, p, p) of the barrier by (Re Y, Im Y, slack, c)."""

    gradient: NDArray[np.float64]
    hessian: NDArray[np.float64]


def largest_slack(
    problem: Inequalities,
    X: list[NDArray[np.float64]],
    tick: Callable[[], None] = lambda: None,
) -> tuple[list[NDArray[np.float64]], float]:
    """Return coefficients X and a slack near the largest one, from the coefficients `X`.

    Parameters
    ----------
    problem : Inequalities
        What must hold.
    X : list of (j, m, m)
        Of each block; where to begin. Anything will do.
    tick : callable
        Called before each step of Newton's method; what it raises passes through.

    """
    functions = problem.functions.shape[1]
    count, scales = problem.blocks[0].T.shape[:2]
    start = np.concatenate([each.reshape(functions, -1) for each in X], axis=1)
    point = _Point(start, np.zeros((count, scales)), 0.0)
    lowest = min(float(np.linalg.eigvalsh(own.W).min()) for own in _matrices(problem, point))
    point = point._replace(slack=(min(lowest, 0.0) - INSIDE) / problem.fall)
    terms = count * (sum(each.size for each in problem.blocks) + 2 * scales + 1)
    weight = terms / (FIRST_GAP + INSIDE - point.slack)
    while True:
        try:
            point = _centred(problem, point, weight, tick)
        except np.linalg.LinAlgError:  # at the end of working accuracy: what is there holds
            break
        if terms / weight < max(SMALLEST_GAP, SHARE * point.slack):
            break
        weight *= FASTER
    return _by_block(problem, point.X), point.slack


def _centred(
    problem: Inequalities, point: _Point, weight: float, tick: Callable[[], None]
) -> _Point:
    """Return the point of the central path at `weight`, near enough."""
    here = _matrices(problem, point)
    value, roots = _barrier(problem, point, here, weight)
    for _ in range(MAX_NEWTON):
        tick()
        change, decrement = _newton(problem, point, here, roots, weight)
        length = 1.0
        while True:
            trial = _Point(
                point.X + length * change.X,
                point.c + length * change.c,
                point.slack + length * change.slack,
            )
            there = _matrices(problem, trial)
            reached, roots = _barrier(problem, trial, there, weight)
            if reached <= value - ENOUGH * length * decrement:
                break
            length /= 2
            if length < SHORTEST:
                return point
        point, value, here = trial, reached, there
        if decrement < CENTRED:
            break
    return point


def _by_block(problem: Inequalities, X: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    sizes = [each.size for each in problem.blocks]
    parts = np.split(X, np.cumsum([size**2 for size in sizes])[:-1], axis=1)
    return [part.reshape(-1, size, size) for part, size in zip(parts, sizes, strict=True)]


def _matrices(problem: Inequalities, point: _Point) -> list[_Matrices]:
    """Return A, the diagonal of diag(1/(1 + c), I/(1 - h slack)) and W of each block."""
    found = []
    for own, X in zip(problem.blocks, _by_block(problem, point.X), strict=True):
        Y = (problem.functions @ X.reshape(len(X), -1)).reshape(-1, own.size, own.size)
        A = own.A + own.U @ Y @ own.L
        performing = np.repeat(1 / (1 - problem.rise * point.slack)[:, None], own.size, axis=1)
        E = np.concatenate([1 / (1 + point.c @ own.scales), performing], axis=1)
        W = (1 - problem.fall * point.slack) * np.eye(own.size) - np.einsum(
            "ks,ksab->kab", point.c, own.T
        )
        found.append(_Matrices(A, E, W - _adjoint(A) @ (E[:, :, None] * A)))
    return found


def _barrier(
    problem: Inequalities, point: _Point, matrices: list[_Matrices], weight: float
) -> tuple[float, list[NDArray[np.complex128]]]:
    """-weight slack - sum log det W (1 + c) (1 - c/most) (1 - h slack), and the roots of each W.

    Infinite outside.
    """
    left = 1 - problem.rise * point.slack
    if (point.c <= -1).any() or (point.c >= problem.most).any() or (left <= 0).any():
        return np.inf, []
    value = -weight * point.slack - np.log1p(point.c).sum() - np.log(left).sum()
    value -= np.log1p(-point.c / problem.most).sum()
    roots = []
    for own in matrices:
        try:
            root = np.asarray(np.linalg.cholesky(own.W), dtype=np.complex128)
        except np.linalg.LinAlgError:
            return np.inf, []
        value -= 2 * np.log(np.einsum("kaa->ka", root).real).sum()
        roots.append(root)
    return float(value), roots


def _newton(
    problem: Inequalities,
    point: _Point,
    matrices: list[_Matrices],
    roots: list[NDArray[np.complex128]],
    weight: float,
) -> tuple[_Point, float]:
    """Newton step and its squared decrement."""
    count, scales = point.c.shape
    entries = point.X.shape[1]
    shared = 2 * entries + 1  # Re Y, Im Y, slack
    total = _Local(
        np.zeros((count, shared + scales)), np.zeros((count, shared + scales, shared + scales))
    )
    first = 0
    for own, here, root in zip(problem.blocks, matrices, roots, strict=True):
        each = np.arange(first, first + own.size**2)
        places = np.concatenate([each, entries + each, np.arange(2 * entries, shared + scales)])
        local = _local(problem, own, here, root)
        total.gradient[:, places] += local.gradient
        total.hessian[:, places[:, None], places] += local.hessian
        first += own.size**2
    low, high = 1 / (1 + point.c), 1 / (problem.most - point.c)
    total.gradient[:, shared:] += high - low
    by_slack = problem.rise / (1 - problem.rise * point.slack)
    total.gradient[:, shared - 1] += by_slack
    total.hessian[:, shared - 1, shared - 1] += by_slack**2
    diagonal = np.arange(shared, shared + scales)
    total.hessian[:, diagonal, diagonal] += low**2 + high**2
    # c of each frequency is eliminated there: Schur complement.
    mixed = total.hessian[:, shared:, :shared]
    right = np.concatenate([mixed, total.gradient[:, shared:, None]], axis=2)
    solved = np.linalg.solve(total.hessian[:, shared:, shared:], right)
    reduced = _Local(
        total.gradient[:, :shared] - (_adjoint(mixed) @ solved[:, :, -1:])[:, :, 0],
        total.hessian[:, :shared, :shared] - _adjoint(mixed) @ solved[:, :, :-1],
    )
    gradient, hessian = _assembled(reduced, problem)
    gradient[-1] -= weight
    change = -_solved(hessian, gradient)
    X, slack = change[:-1].reshape(-1, entries), float(change[-1])
    Y = problem.functions @ X
    local_change = np.concatenate([Y.real, Y.imag, np.full((count, 1), slack)], axis=1)
    c = -(solved[:, :, :-1] @ local_change[:, :, None])[:, :, 0] - solved[:, :, -1]
    decrement = -gradient @ change + (total.gradient[:, shared:] * solved[:, :, -1]).sum()
    return _Point(X, c, slack), float(decrement)


def _local(
    problem: Inequalities,
    own: Inequality,
    matrices: _Matrices,
    root: NDArray[np.complex128],
) -> _Local:
    """Gradient and Hessian of -log det W of one block, W = root root^H."""
    A, E, _ = matrices
    m, scales = own.size, len(own.scales)
    count, entries = len(A), m * m
    C = np.linalg.inv(root)  # W^-1 = C^H C
    inverse = _adjoint(C) @ C
    P, R = C @ (_adjoint(A) * E[:, None, :]) @ own.U, own.L @ _adjoint(C)
    # Rows of A that the slack and each scale weigh, and how: 1/(1 - h slack) and 1/(1 + c).
    member = np.zeros((1 + scales, 2 * m))
    member[0, m:] = 1
    member[1:, :m] = own.scales
    weight = (E @ member.T) / np.maximum(member.sum(axis=1), 1)
    slope = -(weight**2)
    slope[:, 0] *= -problem.rise
    curvature = 2 * weight**3
    curvature[:, 0] *= problem.rise**2
    rows = np.einsum("kia,si,kib->ksab", A.conj(), member, A)
    by_rows = rows * slope[:, :, None, None]
    by_rows[:, 0] += problem.fall * np.eye(m)
    by_rows[:, 1:] += own.T
    # -C dW C^H by each variable; of Y it is P dY R and its adjoint.
    Z = np.einsum("kpa,kbq->kabpq", P, R).reshape(count, entries, m, m)
    directions = np.concatenate(
        [Z + _adjoint(Z), 1j * (Z - _adjoint(Z)), C[:, None] @ by_rows @ _adjoint(C)[:, None]],
        axis=1,
    )
    gradient = np.einsum("kdaa->kd", directions).real.copy()
    flat = directions.reshape(count, -1, entries)
    flat = np.concatenate([flat.real, flat.imag], axis=2)
    hessian = flat @ flat.swapaxes(1, 2)
    # -tr W^-1 d^2 W: of dY twice, 2 <dY, M dY S>
    M, S = _adjoint(own.U) @ (E[:, :, None] * own.U), R @ _adjoint(R)
    twice = 2 * np.einsum("kac,kdb->kabcd", M, S).reshape(count, entries, entries)
    real, imaginary = slice(0, entries), slice(entries, 2 * entries)
    hessian[:, real, real] += twice.real
    hessian[:, imaginary, imaginary] += twice.real
    hessian[:, real, imaginary] -= twice.imag
    hessian[:, imaginary, real] += twice.imag
    # of slack and c, each twice, and of each and dY
    diagonal = 2 * entries + np.arange(1 + scales)
    inner = np.einsum("kab,ksba->ks", inverse, rows).real
    hessian[:, diagonal, diagonal] += inner * curvature
    left = own.L @ inverse @ _adjoint(A)
    mixed = np.einsum("kbi,si,kia->ksab", left, member, own.U).reshape(count, -1, entries)
    cross = 2 * np.concatenate([mixed.real, -mixed.imag], axis=2) * slope[:, :, None]
    hessian[:, diagonal, : 2 * entries] += cross
    hessian[:, : 2 * entries, diagonal] += cross.swapaxes(1, 2)
    return _Local(gradient, hessian)


def _assembled(
    local: _Local, problem: Inequalities
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gradient and Hessian by (X, slack) from those by (Re Y, Im Y, slack), Y = sum_j b_j X_j."""
    entries = (local.gradient.shape[1] - 1) // 2
    count = problem.functions.shape[1]
    parts = [problem.functions.real, problem.functions.imag]
    places = [slice(0, entries), slice(entries, 2 * entries)]

    def product(pairs: NDArray[np.float64], one: int, two: int) -> NDArray[np.float64]:
        part = local.hessian[:, places[one], places[two]].reshape(pairs.shape[1], -1)
        return np.asarray((pairs @ part).reshape(count, count, entries, entries))

    real, imaginary, both = problem.pairs
    mixed = product(both, 0, 1)
    by_X = product(real, 0, 0) + product(imaginary, 1, 1) + mixed + mixed.transpose(1, 0, 3, 2)
    size = count * entries
    hessian = np.empty((size + 1, size + 1))
    hessian[:size, :size] = by_X.transpose(0, 2, 1, 3).reshape(size, size)
    border = sum(p.T @ local.hessian[:, at, -1] for p, at in zip(parts, places, strict=True))
    hessian[:size, size] = hessian[size, :size] = np.ravel(border)
    hessian[size, size] = local.hessian[:, -1, -1].sum()
    slope = sum(p.T @ local.gradient[:, at] for p, at in zip(parts, places, strict=True))
    return np.append(np.ravel(slope), local.gradient[:, -1].sum()), hessian


def _solved(hessian: NDArray[np.float64], gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """hessian^-1 gradient, semidefinite but for rounding."""
    diagonal = np.diag(hessian)
    if not (diagonal > 0).all() or not np.isfinite(hessian).all():
        message = "rounding is all that is left of the Hessian"
        raise np.linalg.LinAlgError(message)
    scale = np.sqrt(diagonal)
    scaled = hessian / scale[:, None] / scale
    ridge = RIDGE
    while True:
        try:
            factors = linalg.cho_factor(scaled + ridge * np.eye(len(scale)))
        except np.linalg.LinAlgError:
            ridge *= HIGHER
            continue
        return np.asarray(linalg.cho_solve(factors, gradient / scale) / scale)


def _adjoint(M: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(M.conj().swapaxes(-1, -2))
