"""Linear systems in state space, x' = A x + B u, y = C x + D u: multivariable controllers."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.validation import read_only, real_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["MAX_STATES", "StateSpace"]

MAX_STATES = 400


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A rational system G(s) = C (s I - A)^-1 B + D.

    Parameters
    ----------
    A, B, C, D : array_like
        (r, r), (r, m), (p, r), (p, m), finite; r may be 0.

    Raises
    ------
    InvalidInputError
        Shapes that do not fit together, a number that is not finite, above `MAX_STATES` states.

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
        if states > MAX_STATES:
            message = f"at most {MAX_STATES} states"
            raise InvalidInputError(message, "/A")
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

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, (r,) complex: the poles, and what cannot be seen or steered."""
        return np.linalg.eigvals(self.A).astype(complex)

    def __call__(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Value at the complex points `s` (k,), none of them a pole, (k, p, m) complex."""
        points = np.asarray(s, dtype=complex)
        if not self.states:
            return np.broadcast_to(self.D.astype(complex), (points.size, *self.D.shape)).copy()
        resolvent = points[:, None, None] * np.eye(self.states) - self.A
        states = np.linalg.solve(resolvent, np.broadcast_to(self.B, (points.size, *self.B.shape)))
        return np.asarray(self.C @ states + self.D)

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
