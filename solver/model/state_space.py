"""Linear systems in state space, x' = A x + B u, y = C x + D u: multivariable controllers."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError
from solver.model.validation import read_only, real_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from solver.model.plants import MatrixPlant

__all__ = ["MAX_STATES", "StateSpace", "from_polynomials", "from_transfer_matrix"]

MAX_STATES = 400  # of a system that is given; what is made of one on the way may have more
# Up to so many, each value solves for the states: that keeps the digits of coefficients, of which
# multiple poles lose half in triangular form.
FEW = 40


@dataclass(frozen=True, eq=False)
class StateSpace(ByValue):
    """A rational system G(s) = C (s I - A)^-1 B + D.

    Parameters
    ----------
    A, B, C, D : array_like
        (r, r), (r, m), (p, r), (p, m), finite; r may be 0.

    Raises
    ------
    InvalidInputError
        Shapes that do not fit together, a number that is not finite.

    Examples
    --------
    >>> StateSpace([[-1.0]], [[1.0]], [[2.0]], [[0.0]]).response([1.0])
    array([[[1.-1.j]]])

    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]

    def __init__(self, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike) -> None:
        through = _matrix(D, "/D")
        outputs, inputs = through.shape
        dynamics = _matrix(A, "/A", empty=True)
        states = len(dynamics) if dynamics.size else 0
        shapes = {"A": (states, states), "B": (states, inputs), "C": (outputs, states)}
        for (name, shape), value in zip(shapes.items(), (A, B, C), strict=True):
            given = _matrix(value, f"/{name}", empty=True)
            if not given.size and 0 in shape:
                given = read_only(np.zeros(shape))
            if given.shape != shape:
                message = f"{name} must be {shape[0]} x {shape[1]}, not {_size(given)}"
                raise InvalidInputError(message, f"/{name}")
            object.__setattr__(self, name, given)
        object.__setattr__(self, "D", through)

    @property
    def states(self) -> int:
        """Number of states r."""
        return len(self.A)

    def require_few(self, field: str) -> None:
        """Raise `InvalidInputError`, naming `field`, above `MAX_STATES` states."""
        if self.states > MAX_STATES:
            message = f"at most {MAX_STATES} states"
            raise InvalidInputError(message, field)

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, (r,) complex: the poles, and what cannot be seen or steered."""
        return np.linalg.eigvals(self.A).astype(complex)

    @cached_property
    def _triangular(
        self,
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
        """A, B and C in coordinates where A is triangular: a value then costs r^2, not r^3."""
        from scipy import linalg  # noqa: PLC0415 - what reads requests does not need it

        balanced, (scale, _) = linalg.matrix_balance(self.A, permute=False, separate=True)
        T, Z = linalg.schur(balanced, output="complex")
        return T, Z.conj().T @ (self.B / scale[:, None]), (self.C * scale) @ Z

    def __call__(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Value at the complex points `s` (k,), none of them a pole, (k, p, m) complex."""
        points = np.asarray(s, dtype=complex)
        if not self.states:
            return np.broadcast_to(self.D.astype(complex), (points.size, *self.D.shape)).copy()
        if self.states <= FEW:
            resolvent = points[:, None, None] * np.eye(self.states) - self.A
            steered = np.broadcast_to(self.B, (points.size, *self.B.shape))
            return np.asarray(self.C @ np.linalg.solve(resolvent, steered) + self.D)
        T, B, C = self._triangular
        distance = points[:, None] - np.diag(T)
        states = np.empty((self.states, points.size * B.shape[1]), dtype=complex)
        for row in reversed(range(self.states)):
            others = T[row, row + 1 :] @ states[row + 1 :]
            right = B[row] + others.reshape(points.size, -1)
            states[row] = (right / distance[:, [row]]).ravel()
        value = (C @ states).reshape(len(C), points.size, -1)
        return np.asarray(value.swapaxes(0, 1) + self.D)

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` > 0 (rad per time unit), (k, p, m) complex."""
        return self(1j * np.atleast_1d(np.asarray(omega, dtype=float)))

    def beside(self, other: StateSpace) -> StateSpace:
        """Return the sum of both: the same inputs, outputs added."""
        zeros = np.zeros((self.states, other.states))
        return StateSpace(
            np.block([[self.A, zeros], [zeros.T, other.A]]),
            np.vstack([self.B, other.B]),
            np.hstack([self.C, other.C]),
            self.D + other.D,
        )

    def times(self, factor: float | NDArray[np.float64]) -> StateSpace:
        """Return the system with its outputs multiplied by a number or a matrix (q, p)."""
        if isinstance(factor, np.ndarray):
            return StateSpace(self.A, self.B, factor @ self.C, factor @ self.D)
        return StateSpace(self.A, self.B, factor * self.C, factor * self.D)

    def after(self, other: StateSpace) -> StateSpace:
        """Return self(s) other(s): `other` acts first."""
        return StateSpace(
            np.block(
                [[other.A, np.zeros((other.states, self.states))], [self.B @ other.C, self.A]]
            ),
            np.vstack([other.B, self.B @ other.D]),
            np.hstack([self.D @ other.C, self.C]),
            self.D @ other.D,
        )


def from_polynomials(num: NDArray[np.float64], den: NDArray[np.float64]) -> StateSpace:
    """Return num(s)/den(s), descending powers, in its canonical form.

    Time is scaled so that its coefficients are near each other; the degree of `num` is at most
    that of `den`.
    """
    order = len(den) - 1
    num = np.concatenate([np.zeros(order + 1 - len(num)), num]) / den[0]
    den = den / den[0]
    if not order:
        return StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[num[0]]])
    sizes = np.abs(den[1:]) ** (1 / np.arange(1, order + 1))
    unit = float(sizes.max()) or 1.0
    power = unit ** np.arange(order + 1)
    den, num = den / power, num / power
    A = np.zeros((order, order))
    A[0] = -den[1:]
    A[1:, :-1] = np.eye(order - 1)
    B = np.eye(order)[:, :1]
    C = (num[1:] - num[0] * den[1:])[None]
    return StateSpace(unit * A, unit * B, C, [[num[0]]])


def from_transfer_matrix(matrix: MatrixPlant) -> StateSpace:
    """Return a matrix of transfer functions in state space, a column's states apart by element.

    Raises
    ------
    InvalidInputError
        An element with dead time.

    """
    each = np.eye(matrix.n)
    whole = StateSpace(np.zeros((0, 0)), np.zeros((0, matrix.n)), np.zeros((matrix.n, 0)), 0 * each)
    for row in range(matrix.n):
        for column in range(matrix.n):
            element = matrix.element(row, column)
            if element.dead_time:
                message = "an element with dead time has no state space"
                raise InvalidInputError(message, f"/elements/{row}/{column}/dead_time")
            if element.is_zero:
                continue
            one = from_polynomials(np.array(element.num), np.array(element.den))
            placed = StateSpace(one.A, one.B @ each[[column]], one.C, one.D @ each[[column]]).times(
                each[:, [row]]
            )
            whole = whole.beside(placed)
    return whole


def _matrix(value: ArrayLike, field: str, *, empty: bool = False) -> NDArray[np.float64]:
    with contextlib.suppress(ValueError):  # ragged rows, refused below
        if empty and not np.size(value):
            return np.zeros((0, 0))
    matrix = real_array(value, field, ndim=2)
    if not matrix.size:
        message = "a matrix is a list of rows of equal length"
        raise InvalidInputError(message, field)
    if not np.isfinite(matrix).all():
        message = "the numbers must be finite"
        raise InvalidInputError(message, field)
    return matrix


def _size(matrix: NDArray[np.float64]) -> str:
    return f"{matrix.shape[0]} x {matrix.shape[1]}"
