"""A plant given in state space, x' = A x + B u, y = C x + D u, as a matrix of transfer functions.

Each element c (s I - A)^-1 b + d has the eigenvalues of A as poles and the finite generalised
eigenvalues of its system pencil as zeros (Emami-Naeini and Van Dooren 1982). What input or output
does not see shows as a pole with a zero upon it, to rounding; as many of such pairs are cancelled
as leave the frequency response unchanged. That is checked element by element: what comes out has
the frequency response of what was given, or is refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, ParallelPlant, Plant
from solver.model.state_space import StateSpace
from solver.model.transfer_function import LARGEST, MAX_ORDER, TransferFunction
from solver.model.validation import real

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["from_state_space"]

SAME = 1e-9  # greatest error of an element's response, relative to it or to a millionth of its peak
SMALL = 1e-6
# Relative distances at which a pole and a zero may be one, the most generous first: a double pole
# is known to sqrt(machine epsilon), a triple one to its cube root.
NEAR = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 0.0)
AT_ZERO = 1e-11  # of the largest eigenvalue: an integrator
INFINITE = 1e9  # times the largest rate: a zero at infinity
PER_DECADE, MARGIN = 12, 1e3
ZERO = 1e-13  # of the plant's peak: an element that is not there


def from_state_space(
    A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, *, dead_time: float = 0.0
) -> Plant:
    """Return the plant with this state-space model.

    Parameters
    ----------
    A, B, C, D : array_like
        (r, r), (r, n), (n, r), (n, n), n <= `MAX_MATRIX_SIZE`, finite.
    dead_time : float
        In every element, time unit of A, >= 0.

    Returns
    -------
    Plant
        A `ParallelPlant` where all units are alike, else a `MatrixPlant`.

    Raises
    ------
    InvalidInputError
        Shapes that do not fit, too many inputs, or an element that no ratio of polynomials of
        degree `MAX_ORDER` has to nine digits.
    UnsupportedPlantError
        A mode in the right half plane, whether inputs and outputs see it or not.

    Examples
    --------
    >>> from_state_space([[-0.5]], [[1.0]], [[2.0]], [[0.0]]).element(0, 0).static_gain
    4.0

    """
    system = StateSpace(A, B, C, D)
    system.require_few("/A")
    n = len(system.D)
    if system.D.shape != (n, n):
        message = f"a plant is square; this one has {n} outputs and {system.D.shape[1]} inputs"
        raise InvalidInputError(message, "/D")
    if n > MAX_MATRIX_SIZE:
        message = f"a plant in state space has at most {MAX_MATRIX_SIZE} inputs"
        raise InvalidInputError(message, "/D")
    delay = real(dead_time, "/dead_time")
    poles = _poles(system)
    rates = np.abs(poles[poles != 0])
    low, high = (rates.min(), rates.max()) if rates.size else (1.0, 1.0)
    decades = np.log10(high / low) + 2 * np.log10(MARGIN)
    omega = np.geomspace(low / MARGIN, high * MARGIN, int(PER_DECADE * decades) + 1)
    G = system.response(omega)
    negligible = ZERO * float(np.abs(G).max())
    rows = [
        [
            _element(
                system,
                omega,
                G[:, r, c],
                place=(r, c),
                negligible=negligible,
                dead_time=delay,
            )
            for c in range(n)
        ]
        for r in range(n)
    ]
    return _recognised(rows)


def _recognised(rows: list[list[TransferFunction]]) -> Plant:
    """Return a parallel plant where all units are alike."""
    n = len(rows)
    places = [(r, c) for r in range(n) for c in range(n)]
    own = all(_alike(rows[r][r], rows[0][0]) for r in range(n))
    other = n > 1 and all(_alike(rows[r][c], rows[0][1]) for r, c in places if r != c)
    return ParallelPlant(n, rows[0][0], rows[0][1]) if own and other else MatrixPlant(rows)


def _alike(one: TransferFunction, other: TransferFunction) -> bool:
    """Whether two elements differ by rounding alone."""
    pairs = (one.num, other.num), (one.den, other.den)
    return all(
        len(mine) == len(its)
        and all(abs(a - b) <= SAME * max(abs(a), abs(b)) for a, b in zip(mine, its, strict=True))
        for mine, its in pairs
    )


def _poles(system: StateSpace) -> NDArray[np.complex128]:
    """Return the eigenvalues of A, those at zero exactly so."""
    if not system.states:
        return np.zeros(0, dtype=complex)
    balanced, _ = scipy.linalg.matrix_balance(system.A)
    poles = np.linalg.eigvals(balanced).astype(complex)
    poles[np.abs(poles) <= AT_ZERO * np.abs(poles).max(initial=0.0)] = 0
    unstable = poles[(poles != 0) & (poles.real > -SAME * np.abs(poles))]
    if unstable.size:
        message = (
            f"the plant is open-loop unstable (eigenvalue {unstable[0]:.6g} of A); stabilise it "
            "with an inner loop first"
        )
        raise UnsupportedPlantError(message, "/A")
    return poles


def _element(
    system: StateSpace,
    omega: NDArray[np.float64],
    response: NDArray[np.complex128],
    *,
    place: tuple[int, int],
    negligible: float,
    dead_time: float,
) -> TransferFunction:
    """Return one element with the response that the system has."""
    if float(np.abs(response).max()) <= negligible:
        return TransferFunction((0.0,), (1.0,))
    row, column = place
    system = _between(system, row, column)
    poles = _poles(system)
    if not poles.size:
        return TransferFunction((system.D[row, column],), (1.0,), dead_time)
    zeros = _zeros(system, row, column, poles)
    allowed = SAME * np.maximum(np.abs(response), SMALL * float(np.abs(response).max()))
    for near in NEAR:
        left_zeros, left_poles = _cancelled(zeros, poles, near)
        if left_poles.size > MAX_ORDER or left_zeros.size > left_poles.size:
            continue
        found = _ratio(left_zeros, left_poles, omega, response)
        if found is None:
            continue
        if (np.abs(np.asarray(found.response(omega)) - response) <= allowed).all():
            return TransferFunction(found.num, found.den, dead_time)
    message = (
        f"from input {column + 1} to output {row + 1} the model is no ratio of polynomials of "
        f"degree {MAX_ORDER} or less to nine digits; reduce its order, or give transfer functions"
    )
    raise InvalidInputError(message, "/A")


def _between(system: StateSpace, row: int, column: int) -> StateSpace:
    """Return the system with those states alone that an input reaches and an output sees.

    Told by what is zero in A, B and C: other states need no cancelling, and fast ones among them
    do not blur slow ones that are kept.
    """
    linked = system.A != 0
    reached, seen = system.B[:, column] != 0, system.C[row] != 0
    for _ in range(system.states):
        reached, seen = reached | (linked @ reached), seen | (linked.T @ seen)
    kept = reached & seen
    return StateSpace(
        system.A[np.ix_(kept, kept)], system.B[kept], system.C[:, kept], system.D
    )  # fmt: skip


def _zeros(
    system: StateSpace, row: int, column: int, poles: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return the finite zeros of one element."""
    r = system.states
    # Balancing A by a diagonal transformation leaves the element as it is.
    balanced, transform = scipy.linalg.matrix_balance(system.A, permute=False)
    scale = np.diag(transform)
    pencil = np.zeros((r + 1, r + 1))
    pencil[:r, :r] = balanced
    pencil[:r, r] = system.B[:, column] / scale
    pencil[r, :r] = system.C[row] * scale
    pencil[r, r] = system.D[row, column]
    E = np.diag([*np.ones(r), 0.0])
    with np.errstate(all="ignore"):
        found = np.asarray(scipy.linalg.eigvals(pencil, E))
    largest = max(float(np.abs(poles).max()), float(np.abs(balanced).max()))
    finite = found[np.isfinite(found) & (np.abs(found) < INFINITE * largest)]
    finite[np.abs(finite) <= AT_ZERO * largest] = 0
    return np.asarray(finite, dtype=complex)


def _cancelled(
    zeros: NDArray[np.complex128], poles: NDArray[np.complex128], near: float
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return zeros and poles without the pairs that are nearer than a share of their size."""
    left_zeros, left_poles = list(zeros), list(poles)
    while left_zeros and left_poles:
        z, p = np.array(left_zeros), np.array(left_poles)
        with np.errstate(over="ignore"):  # of a pole at zero: far
            distance = np.abs(z[:, None] - p) / np.maximum(np.abs(p), np.finfo(float).tiny)
        i, j = np.unravel_index(int(distance.argmin()), distance.shape)
        if distance[i, j] > near:
            break
        del left_zeros[int(i)], left_poles[int(j)]
    return np.array(left_zeros, dtype=complex), np.array(left_poles, dtype=complex)


def _ratio(
    zeros: NDArray[np.complex128],
    poles: NDArray[np.complex128],
    omega: NDArray[np.float64],
    response: NDArray[np.complex128],
) -> TransferFunction | None:
    """Return the real ratio with these roots whose gain fits the response; None: it is not real."""
    num, den = np.atleast_1d(np.poly(zeros)), np.atleast_1d(np.poly(poles))
    for polynomial in (num, den):
        if np.abs(polynomial.imag).max() > SAME * np.abs(polynomial).max():
            return None  # one of a complex pair was cancelled without the other
    shape = np.polyval(num.real, 1j * omega) / np.polyval(den.real, 1j * omega)
    weight = 1 / np.abs(shape)
    gain = float(np.mean((response * np.conj(shape)).real * weight**2))
    num, den = gain * num.real, den.real
    sizes = np.abs(np.concatenate([num[num != 0], den[den != 0]]))
    if sizes.max() > LARGEST:  # fast dynamics in a slow unit: into the middle of the range
        middle = np.sqrt(sizes.max()) * np.sqrt(sizes.min())
        num, den = num / middle, den / middle
    try:
        return TransferFunction(num.tolist(), den.tolist())
    except InvalidInputError:  # still out of range
        return None
