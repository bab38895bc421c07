"""From a controller found as a function of frequency to one that can be built.

C = Q (I - G Q)^-1 in state space. Where the plant has dead time, the model of it inside the
controller is a Pade quotient; the plant itself keeps its dead time in every analysis after that.
The integrators are split off and kept exactly. An input that integrates by itself needs none in
the controller for the demand, but a load on it would then leave an error for ever: it gets a slow
one, C (s + slow)/s. The stable rest is reduced by balanced truncation weighted with what it does to
N (Enns 1984): a change of C changes D N D^-1 by

    [D w_I; -w_P G] (I + C G)^-1 dC (I + G C)^-1 [G D^-1, I],

so the Gramians are integrals of frequency responses, the dead time exact.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from solver.limits.search import checking_grid
from solver.model.state_space import StateSpace, from_polynomials

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.limits.search import Found, LimitSearch
    from solver.limits.youla import YoulaBlock
    from solver.model.transfer_function import TransferFunction

__all__ = ["Reducible", "reducible"]

# Order of a Pade quotient by omega times its dead time at the highest frequency that matters: its
# error there is 1e-3 or less, and its roots are right to 1e-6.
PADE_ORDERS, PADE_SLOPE, MOST_PADE = 4, 0.6, 28
# Of the bandwidth that is asked for: costs the phase that the margin of what is built has in hand.
INTEGRAL = 3e-3
NOT_STABLE = 1e-6  # of the bandwidth: poles right of minus this are kept
NEGLIGIBLE = 1e-12  # Hankel singular values below this share of the largest are rounding


@dataclass(frozen=True)
class Reducible:
    """One block's controller: what is kept, and the rest in balanced coordinates.

    Attributes
    ----------
    kept : StateSpace
        Integrators and, where the controller is unstable, its unstable part.
    balanced : StateSpace
        The stable rest; truncating it keeps its first states.
    weights : (r,)
        Weighted Hankel singular values of its states, falling.

    """

    kept: StateSpace
    balanced: StateSpace
    weights: NDArray[np.float64]

    def truncated(self, threshold: float) -> StateSpace:
        """Return the controller without the states whose weights are below `threshold`."""
        order = int(np.count_nonzero(self.weights >= threshold))
        b = self.balanced
        reduced = StateSpace(b.A[:order, :order], b.B[:order], b.C[:, :order], b.D)
        if reduced.poles.real.max(initial=-1.0) >= 0:
            # Weights on both sides can leave an unstable pole beside the zero that cancels it.
            reduced = _split(reduced, 0.0)[1]
        return self.kept.beside(reduced)


def reducible(search: LimitSearch, found: Found) -> list[Reducible]:
    """Return the controller of each block, ready to be truncated."""
    omega = checking_grid(found.omega)
    s = np.asarray(1j * omega, dtype=np.complex128)
    at = np.log(found.omega)
    v = np.exp([np.interp(np.log(omega), at, np.log(each)) for each in found.v.T]).T
    w_I = search.uncertainty.magnitude(omega)[:, None, None]
    w_P = search.performance.with_tau_p(found.tau_p).magnitude(omega)[:, None, None]
    parts = []
    for index, own in enumerate(search.youla):
        block = search.blocks.blocks[index]
        G = search.blocks.response(omega)[index]
        Q = own.parameter(s, found.basis, found.X[index])
        d = v[:, list(block.scales)] ** -0.5
        eye = np.eye(block.size)
        before = (eye - G @ Q) @ np.concatenate(
            [G / d[:, None, :], np.broadcast_to(eye, G.shape)], axis=2
        )
        after = np.concatenate([w_I * d[:, :, None] * eye, -w_P * G], axis=1) @ (eye - Q @ G)
        Y = found.basis.realise(found.X[index])
        mixed = StateSpace(Y.A, Y.B, own.inverse @ Y.C, own.inverse @ Y.D)
        controller = _controller(mixed, _model(search, own, found.basis.end))
        search.ask()
        integrators, others = _integrators(_in_schur_form(controller), own.size)
        search.ask()
        unstable, rest = _split(others, NOT_STABLE * search.bandwidth)
        if own.integrating.any():
            slow = INTEGRAL * min(1 / found.tau_p, search.bandwidth)
            integrators, faster = _lifted(integrators, own, slow)
            lift = _lift(own, slow)
            rest = faster.beside(lift.after(rest))
            if unstable.states:
                unstable = lift.after(unstable)
        parts.append(_balanced(integrators.beside(unstable), rest, omega, before, after))
    return parts


def _model(search: LimitSearch, own: YoulaBlock, high: float) -> StateSpace:
    """G J of one block in state space, dead times as Pade quotients that hold up to `high`."""
    lifted = [own.fast if integrates else None for integrates in own.integrating]
    each = np.eye(own.size)
    places = []
    for row, entries in enumerate(search.blocks.terms(own.index)):
        for column, terms in enumerate(entries):
            for factor, element in terms:
                one = _realised(element, lifted[column], high).times(factor)
                places.append(
                    StateSpace(
                        one.A,
                        one.B @ each[[column]],
                        each[:, [row]] @ one.C,
                        one.D * np.outer(each[row], each[column]),
                    )
                )
    return functools.reduce(StateSpace.beside, places)


def _realised(function: TransferFunction, fast: float | None, high: float) -> StateSpace:
    """Return a transfer function, times s/(1 + s/fast) where `fast` is given, in state space."""
    num, den = np.array(function.num), np.array(function.den)
    if fast is not None and not function.is_zero:
        if den[-1] == 0:
            den = den[:-1]
        else:
            num = np.append(num, 0.0)
        den = np.convolve(den, [1 / fast, 1.0])
    rational = from_polynomials(num, den)
    if not function.dead_time:
        return rational
    return _pade(function.dead_time, high).after(rational)


def _pade(dead_time: float, high: float) -> StateSpace:
    """exp(-dead_time s) as a quotient of polynomials of even degree, in balanced sections.

    Golub and Van Loan, section 9.3.1; factors of first and second order keep it well scaled.
    """
    order = 2 * math.ceil((PADE_ORDERS + PADE_SLOPE * dead_time * high) / 2)
    order = min(order, MOST_PADE)
    roots = np.roots(
        [
            math.factorial(2 * order - j) / (math.factorial(j) * math.factorial(order - j))
            for j in range(order, -1, -1)
        ]
    )
    upper = roots[roots.imag > 0] / dead_time  # an even order has no real root
    sections = [
        from_polynomials(
            np.array([1.0, 2 * root.real, abs(root) ** 2]),
            np.array([1.0, -2 * root.real, abs(root) ** 2]),
        )
        for root in upper
    ]
    return functools.reduce(StateSpace.after, sections)


def _lift(own: YoulaBlock, slow: float) -> StateSpace:
    """J (s + slow)/s = f + f (slow - f)/(s + f) on the inputs that integrate, 1 on the others."""
    inputs = np.eye(own.size)[:, own.integrating]
    return StateSpace(
        -own.fast * np.eye(inputs.shape[1]),
        inputs.T,
        own.fast * (slow - own.fast) * inputs,
        np.diag(np.where(own.integrating, own.fast, 1.0)),
    )


def _lifted(integrators: StateSpace, own: YoulaBlock, slow: float) -> tuple[StateSpace, StateSpace]:
    """`_lift` after the integrators: slow/s and (f - slow)/(s + f) for each 1/s."""
    inputs = np.eye(own.size)[:, own.integrating]
    gain = np.where(own.integrating, slow, 1.0)[:, None]
    kept = StateSpace(integrators.A, integrators.B, gain * integrators.C, integrators.D)
    faster = StateSpace(
        -own.fast * np.eye(inputs.shape[1]),
        inputs.T @ integrators.C @ integrators.B,
        (own.fast - slow) * inputs,
        0 * integrators.D,
    )
    return kept, faster


def _controller(Q: StateSpace, G: StateSpace) -> StateSpace:
    """C = Q (I - G Q)^-1: u = Q (e + G u)."""
    size = Q.D.shape[0]
    Z = np.linalg.inv(np.eye(size) - Q.D @ G.D)
    # u = C_u x + D_u e with x = (x_Q, x_G)
    C_u = Z @ np.hstack([Q.C, Q.D @ G.C])
    D_u = Z @ Q.D
    # e + G u = C_e x + D_e e
    C_e = np.hstack([np.zeros((size, Q.states)), G.C]) + G.D @ C_u
    D_e = np.eye(size) + G.D @ D_u
    A = linalg.block_diag(Q.A, G.A) + np.vstack([Q.B @ C_e, G.B @ C_u])
    return StateSpace(A, np.vstack([Q.B @ D_e, G.B @ D_u]), C_u, D_u)


def _in_schur_form(system: StateSpace) -> StateSpace:
    """Return the system with A in real Schur form: a second decomposition costs little then."""
    T, scale = linalg.matrix_balance(system.A, permute=False)
    diagonal = np.diag(scale)
    A, V = linalg.schur(T)
    B, C = system.B / diagonal[:, None], system.C * diagonal
    return StateSpace(A, V.T @ B, C @ V, system.D)


def _integrators(system: StateSpace, count: int) -> tuple[StateSpace, StateSpace]:
    """Return the `count` integrators, exact ones, and the rest with D.

    T(0) = I by construction: poles that near s = 0 differ from it by rounding alone.
    """
    sizes = np.sort(np.abs(system.poles))
    near = math.sqrt(sizes[count - 1] * sizes[count]) if count < sizes.size else math.inf
    kept, rest = _parted(system, lambda real, imaginary: math.hypot(real, imaginary) <= near)
    return StateSpace(np.zeros_like(kept.A), kept.B, kept.C, kept.D), rest


def _split(system: StateSpace, near: float) -> tuple[StateSpace, StateSpace]:
    """Return the part with poles right of -near, and the stable rest with D."""
    return _parted(system, lambda real, imaginary: real > -near or real > -1e-9 * abs(imaginary))


def _parted(
    system: StateSpace, keep: Callable[[float, float], bool]
) -> tuple[StateSpace, StateSpace]:
    """Return the part whose poles (real, imaginary) are to be kept, and the rest with D."""
    A, V, kept = linalg.schur(system.A, sort=keep)
    B, C = V.T @ system.B, system.C @ V
    X = linalg.solve_sylvester(A[:kept, :kept], -A[kept:, kept:], -A[:kept, kept:])
    # Coordinates in which A is block diagonal.
    first = B[:kept] - X @ B[kept:]
    last = C[:, kept:] + C[:, :kept] @ X
    return (
        StateSpace(A[:kept, :kept], first, C[:, :kept], np.zeros_like(system.D)),
        StateSpace(A[kept:, kept:], B[kept:], last, system.D),
    )


def _balanced(
    kept: StateSpace,
    rest: StateSpace,
    omega: NDArray[np.float64],
    before: NDArray[np.complex128],
    after: NDArray[np.complex128],
) -> Reducible:
    """Weighted balanced coordinates, by the square-root method."""
    eye = np.eye(rest.states)
    steered = StateSpace(rest.A, rest.B, eye, 0 * rest.B).response(omega)
    # Of A in Schur form the transpose is too, its states in reverse.
    back = StateSpace(rest.A.T[::-1, ::-1], rest.C.T[::-1], eye[::-1], 0 * rest.C.T)
    seen = back.response(omega).swapaxes(1, 2)
    # Either weight may be huge at low frequency where their product is not.
    sizes = [np.linalg.norm(part, axis=(1, 2)) for part in (before, after)]
    share = np.sqrt(np.gradient(np.log(omega)))
    middle = np.sqrt(sizes[1] / sizes[0])
    root_P = _root((share * middle)[:, None, None] * steered @ before)
    root_O = _root((share / middle)[:, None, None] * (after @ seen).swapaxes(1, 2))
    U, weights, Vh = np.linalg.svd(root_O.T @ root_P)
    order = int(np.count_nonzero(weights > NEGLIGIBLE * weights[0])) if weights.size else 0
    inverse = weights[:order] ** -0.5
    left = (inverse[:, None] * U[:, :order].T) @ root_O.T
    right = root_P @ (Vh[:order].T * inverse)
    return Reducible(
        kept,
        StateSpace(left @ rest.A @ right, left @ rest.B, rest.C @ right, rest.D),
        weights[:order],
    )


def _root(responses: NDArray[np.complex128]) -> NDArray[np.float64]:
    """L with L L^T the real part of the sum of X X^H over the frequencies, X (k, r, m).

    The sum itself would hold half of the digits.
    """
    columns = np.concatenate([responses.real, responses.imag], axis=2)
    rows = columns.swapaxes(1, 2).reshape(-1, responses.shape[1])
    return np.asarray(np.linalg.qr(rows, mode="r")).T
