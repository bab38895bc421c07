"""Plant, weights and a full controller on intervals of frequency, as Taylor models.

With integrators in the columns K^-1 of the plant, K = diag(s/(1 + s/f) or 1), and in the
controller, the loop is written in G K and K^-1 C J, J = (s/(1 + s/f))^j, which have no pole at
s = 0:

    N = [[w_I D C S G D^-1, w_I D C S], [w_P S G D^-1, w_P S]],   S = J (J + G K K^-1 C J)^-1,

with D times |K|: what that leaves are phases, which no singular value sees. So one interval may
reach from s = 0, and in 1/s another one to infinity. Where some inputs integrate and others do not,
J has more powers of s than some need, and J + G C J is singular at s = 0. Near it stands

    (I + C G)^-1 = K (F K + F C G K)^-1 F,   S = G K (F K + F C G K)^-1 F K (G K)^-1,

F the integrators of each row of the controller: regular, as G K is.

A controller in state space is a sum over its modes. Eigenvectors from floating point are taken
as they are, and what V^-1 A V then has beside its diagonal, computed with many digits, is a bound
on what they miss.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import acb, acb_mat, fmpq_mat
from scipy import linalg

from solver.certificate.enclosures import exact, is_hurwitz
from solver.model.precision import working_precision
from solver.model.state_space import StateSpace
from solver.robustness.matrix_models import DEGREE, NO_BOUND, OUTWARD, UNIT, Models, rational

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.plants import MatrixPlant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Uncertainty

__all__ = ["FullLoop", "UnprovenError", "Variable", "lifted_element", "lifted_ratio"]

MOST_STATES = 150  # of a controller: its modes in many digits take some seconds then
BITS = 256
NEAR_SINGULAR = 1e-9  # eigenvalues below this share of the largest may be exact zeros
NEAREST = 0.9  # half an interval over the distance of a pole from its middle
LARGEST_MISS = 0.5  # ratio of the geometric series that bounds what eigenvectors miss
LONGEST_TURN = 1.5  # rad of exp(-theta s) to either side of the middle; beyond, any phase stands


def _imaginary(value: NDArray[np.float64]) -> NDArray[np.complex128]:
    return np.asarray(1j * value, dtype=np.complex128)


class UnprovenError(Exception):
    """Why nothing can be proven of a controller."""


@dataclass(frozen=True)
class Variable:
    """s, or 1/s where `inverse`, on c intervals; f is a power of two.

    Attributes
    ----------
    middle, half : (c,) complex
        The variable is middle + half t.
    inverse : bool
        Whether it is 1/s, from the middle of an interval that reaches to infinity.
    corner : float
        f, rad per time unit.

    """

    middle: NDArray[np.complex128]
    half: NDArray[np.complex128]
    inverse: bool
    corner: float

    @classmethod
    def over(cls, low: NDArray[np.float64], high: NDArray[np.float64], corner: float) -> Variable:
        """Return j omega from `low` to `high`, (c,) each; all of `high` finite or none."""
        if np.isinf(high).any():
            half = 0.5 / low * (1 + UNIT)
            return cls(
                _imaginary(-half), _imaginary(-half * (1 + UNIT)), inverse=True, corner=corner
            )
        half = 0.5 * (high - low) + UNIT * high
        return cls(_imaginary(0.5 * (low + high)), _imaginary(half), inverse=False, corner=corner)

    @property
    def line(self) -> Models:
        """The variable itself."""
        return Models.line(self.middle, self.half)

    def quotient(
        self, num: NDArray[np.float64], den: NDArray[np.float64], powers: int, lifts: int
    ) -> tuple[Models, NDArray[np.bool_]]:
        """s^powers num/den (1 + s/f)^-lifts, descending, without a pole at s = 0; where known."""
        lift = np.array([1 / self.corner, 1.0])
        rising = powers + len(num) - 1
        if not self.inverse:
            ascending = np.concatenate([np.zeros(powers), num[::-1]])
            return rational(ascending, [den[::-1], *[lift[::-1]] * lifts], self.line)
        surplus = len(den) - 1 + lifts - rising
        if surplus < 0:
            message = "an element grows without bound towards the frequency infinity"
            raise UnprovenError(message)
        ascending = np.concatenate([np.zeros(surplus), num])
        return rational(ascending, [den, *[lift] * lifts], self.line)

    def delay(self, dead_time: float) -> Models:
        """exp(-dead_time s); a whole disc where it turns too far."""
        count = self.middle.size
        turn = np.full(count, np.inf) if self.inverse else dead_time * np.abs(self.half)
        disc = turn > LONGEST_TURN
        P = np.zeros((DEGREE, count, 1, 1), dtype=complex)
        turn = np.where(disc, 0.0, turn)
        phase = np.where(disc, 0.0, dead_time * np.abs(self.middle))
        term, rest = np.exp(-1j * phase), np.ones(count)
        for k in range(DEGREE):
            P[k, :, 0, 0] = term
            term = term * (-1j * turn) / (k + 1)
            rest = rest * turn / (k + 1)
        # The derivatives have modulus turn^k; phase and turn are right to one unit each.
        radius = (rest + 4 * UNIT * (DEGREE + phase + turn) * np.exp(turn)) * OUTWARD
        P[:, disc] = 0
        return Models(P, np.where(disc, 1.0, radius)[:, None, None])


@dataclass(frozen=True, eq=False)
class _Modal:
    """C = residue/s + D + c (s - poles - Delta)^-1 b."""

    residue: NDArray[np.float64]
    residue_error: NDArray[np.float64]
    through: NDArray[np.float64]
    poles: NDArray[np.complex128]
    c: NDArray[np.complex128]
    c_error: NDArray[np.float64]
    b: NDArray[np.complex128]
    b_error: NDArray[np.float64]
    coupling: NDArray[np.float64]  # |Delta|
    unstable: int

    @classmethod
    def of(cls, system: StateSpace) -> _Modal:
        if system.states > MOST_STATES:
            message = f"controllers of more than {MOST_STATES} states are not proven"
            raise UnprovenError(message)
        A, B, C = system.A, system.B, system.C
        free = ~(A.any(axis=0) | A.any(axis=1))  # plain integrators
        rest = np.flatnonzero(~free)
        with working_precision(BITS):
            own_B, own_C = _exact(B[free]), _exact(C[:, free])
            residue = own_C * own_B if free.any() else _exact(np.zeros(system.D.shape))
            A = A[np.ix_(rest, rest)]
            _, scales = linalg.matrix_balance(A, permute=False, separate=True)
            scale = scales[0]  # powers of two
            A = A / scale[:, None] * scale
            B, C = B[rest] / scale[:, None], C[:, rest] * scale
            dynamics, seen = _exact(A), _exact(C)
            if rest.size:
                sizes = np.abs(np.linalg.eigvals(A))
                if sizes.min() <= NEAR_SINGULAR * sizes.max():
                    dynamics, seen, more = _without_integrators(A, B, C)
                    residue = residue + more
            parts = _modes(dynamics, _exact(B), seen, rest.size)
            values, errors = _enclosed(residue)
        return cls(values.real, errors, np.array(system.D), *parts)


def _exact(matrix: NDArray[np.float64]) -> acb_mat:
    return acb_mat(*matrix.shape, [acb(value) for value in matrix.ravel().tolist()])


def _enclosed(matrix: acb_mat) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return numbers, and how far from them the balls may reach."""
    shape = matrix.nrows(), matrix.ncols()
    values = np.zeros(shape, dtype=complex)
    errors = np.zeros(shape)
    for i in range(shape[0]):
        for j in range(shape[1]):
            entry = matrix[i, j]
            values[i, j] = complex(entry.mid())
            errors[i, j] = float((entry - acb(values[i, j])).abs_upper()) * OUTWARD
    return values, errors


def _without_integrators(
    A: NDArray[np.float64], B: NDArray[np.float64], C: NDArray[np.float64]
) -> tuple[acb_mat, acb_mat, acb_mat]:
    """Split off the zero eigenvalues of an exactly singular A, if they are semisimple.

    With P the projector on the null space along the range, C (s - A)^-1 B = C P B/s +
    C (I - P) (s - A + f P)^-1 B, whatever f > 0.
    """
    n = len(A)
    whole = fmpq_mat(n, n, [exact(value) for value in A.ravel().tolist()])
    right = _null_space(whole)
    if right is None:
        return _exact(A), _exact(C), _exact(np.zeros((len(C), B.shape[1])))
    left = _null_space(whole.transpose())
    assert left is not None  # noqa: S101 - the rank of a matrix is that of its transpose
    pairing = left.transpose() * right
    if pairing.det() == 0:
        message = "the controller has a double pole at s = 0"
        raise UnprovenError(message)
    projector = right * pairing.inv() * left.transpose()
    P = acb_mat(projector)
    shift = acb(float(np.abs(np.linalg.eigvals(A)).max()))
    seen = _exact(C)
    return _exact(A) - P * shift, seen - seen * P, seen * P * _exact(B)


def _null_space(matrix: fmpq_mat) -> fmpq_mat | None:
    """Return a basis of the null space in columns; None if there is none."""
    reduced, rank = matrix.rref()
    n = matrix.ncols()
    if rank == n:
        return None
    pivots = []
    column = 0
    for row in range(rank):
        while reduced[row, column] == 0:
            column += 1
        pivots.append(column)
    others = [column for column in range(n) if column not in pivots]
    basis = fmpq_mat(n, len(others))
    for k, column in enumerate(others):
        basis[column, k] = 1
        for row, pivot in enumerate(pivots):
            basis[pivot, k] = -reduced[row, column]
    return basis


def _modes(
    A: acb_mat, B: acb_mat, C: acb_mat, states: int
) -> tuple[
    NDArray[np.complex128],
    NDArray[np.complex128],
    NDArray[np.float64],
    NDArray[np.complex128],
    NDArray[np.float64],
    NDArray[np.float64],
    int,
]:
    """Poles, c, b with their errors, |Delta|, and the number of unstable poles."""
    if not states:
        none = np.zeros((0, 0))
        c, b = np.zeros((C.nrows(), 0)), np.zeros((0, B.ncols()))
        return np.zeros(0, complex), c + 0j, c, b + 0j, b, none, 0
    poles, V = np.linalg.eig(_enclosed(A)[0].real)
    vectors = acb_mat(states, states, [acb(complex(value)) for value in V.ravel()])
    try:
        whole = vectors.solve(A * vectors)
        b, b_error = _enclosed(vectors.solve(B))
    except ZeroDivisionError:
        message = "the controller's modes are too much alike"
        raise UnprovenError(message) from None
    for k, pole in enumerate(poles):
        whole[k, k] = whole[k, k] - acb(complex(pole))
    values, errors = _enclosed(whole)
    coupling = (np.abs(values) + errors) * OUTWARD
    c, c_error = _enclosed(C * vectors)
    reach = coupling.sum(axis=1) * OUTWARD
    if not (np.abs(poles.real) > reach).all():
        message = "a pole of the controller is too near to the imaginary axis, and not at s = 0"
        raise UnprovenError(message)
    return poles + 0j, c, c_error, b, b_error, coupling, int((poles.real > 0).sum())


class FullLoop:
    """One block of the plant under its part of a full controller.

    Parameters
    ----------
    blocks : LoopBlocks
        As of `solver.robustness.centralised.central_blocks`.
    index : int
        Which block.
    controller : StateSpace or MatrixPlant
        Its controller.
    uncertainty, performance : Uncertainty, Performance
        The weights.

    Raises
    ------
    UnprovenError
        A loop of which nothing can be proven here.

    """

    def __init__(
        self,
        blocks: LoopBlocks,
        index: int,
        controller: StateSpace | MatrixPlant,
        uncertainty: Uncertainty,
        performance: Performance,
    ) -> None:
        self.block = blocks.blocks[index]
        self.terms = blocks.terms(index)
        self.w_I, self.w_P = uncertainty.weight_of(0), performance.weight
        size = self.block.size
        elements = [e for row in self.terms for terms in row for _, e in terms]
        if not all(is_hurwitz(element.den) for element in elements):
            message = "a pole of the plant is not proven to be stable"
            raise UnprovenError(message)
        if self.w_I.den[-1] == 0 or not is_hurwitz(self.w_I.den):
            message = "the uncertainty weight is not proven to be stable"
            raise UnprovenError(message)
        self.lifted = np.array(
            [
                max(e.integrators for row in self.terms for _, e in row[column])
                for column in range(size)
            ]
        )
        if self.lifted.max() > 1:
            message = "the plant has a double integrator"
            raise UnprovenError(message)
        self.modal: _Modal | None = None
        self.elements: tuple[tuple[TransferFunction, ...], ...] = ()
        if isinstance(controller, StateSpace):
            self.modal = _Modal.of(controller)
            moving = (np.abs(self.modal.residue) + self.modal.residue_error > 0).any(axis=1)
            own = moving.astype(int)
            self.unstable = self.modal.unstable
        else:
            if not all(is_hurwitz(element.den) for element in controller.elements):
                message = "of a transfer matrix with unstable poles nothing is proven"
                raise UnprovenError(message)
            own = np.array([[e.integrators for e in row] for row in controller.elements_by_row])
            own = own.max(axis=1)
            self.elements = controller.elements_by_row
            self.unstable = 0
        direct, through = (
            _direct(elements),
            self.modal is not None and bool(self.modal.through.any()),
        )
        ways = _direct([element for row in self.elements for element in row])
        if direct and (through or ways) and any(e.dead_time > 0 for e in direct + ways):
            message = "what dead time feeds through has any phase towards the frequency infinity"
            raise UnprovenError(message)
        self.own = own
        self.rising = own + self.lifted
        self.power = int(self.rising.max())
        if self._grows() > self.rising.min():
            message = "no offset is permitted, but the controller leaves one"
            raise UnprovenError(message)

    def _grows(self) -> int:
        """Return the poles of w_P at s = 0."""
        return int(self.w_P.den[-1] == 0)

    def plant(self, variable: Variable) -> tuple[Models, NDArray[np.bool_]]:
        """G K."""
        count, size = variable.middle.size, self.block.size
        P = np.zeros((DEGREE, count, size, size), dtype=complex)
        radius = np.zeros((count, size, size))
        known: dict[tuple[TransferFunction, int], tuple[Models, NDArray[np.bool_]]] = {}
        sound = np.ones(count, dtype=bool)
        for row, entries in enumerate(self.terms):
            for column, terms in enumerate(entries):
                total = Models.constant(np.zeros((1, 1), dtype=complex), count)
                lifts = int(self.lifted[column])
                for factor, element in terms:
                    if element.is_zero:
                        continue
                    if (element, lifts) not in known:
                        known[element, lifts] = lifted_element(element, variable, lifts)
                    value, here = known[element, lifts]
                    total = total + value.times(factor)
                    sound &= here
                P[:, :, row, column] = total.P[:, :, 0, 0]
                radius[:, row, column] = total.radius[:, 0, 0]
        return Models(P, radius), sound

    @property
    def deficit(self) -> int:
        """Powers of s/(1 + s/f) that det(J + G C J) has more than det(F (I + C G) K)."""
        return int((self.power - self.rising).sum())

    def compensator(self, variable: Variable) -> tuple[Models, NDArray[np.bool_]]:
        """K^-1 C J."""
        return self._rows(variable, self.power - self.lifted)

    def compensator_at_rest(self, variable: Variable) -> tuple[Models, NDArray[np.bool_]]:
        """F C, F = diag(s/(1 + s/f)) on the rows with integrators of their own, 1 on the others."""
        return self._rows(variable, self.own)

    def _rows(self, variable: Variable, left: NDArray[np.int_]) -> tuple[Models, NDArray[np.bool_]]:
        """C, each row times a power of s/(1 + s/f) that takes up its poles at s = 0."""
        if self.modal is not None:
            return _modal_rows(self.modal, variable, left)
        count, size = variable.middle.size, self.block.size
        P = np.zeros((DEGREE, count, size, size), dtype=complex)
        radius = np.zeros((count, size, size))
        sound = np.ones(count, dtype=bool)
        for row, entries in enumerate(self.elements):
            for column, element in enumerate(entries):
                if element.is_zero:
                    continue
                value, here = lifted_element(element, variable, int(left[row]))
                P[:, :, row, column] = value.P[:, :, 0, 0]
                radius[:, row, column] = value.radius[:, 0, 0]
                sound &= here
        return Models(P, radius), sound

    def rises(self, variable: Variable) -> tuple[Models, Models, Models, NDArray[np.bool_]]:
        """J, w_I and w_P J, 1 x 1 each."""
        one = np.ones(1)
        J, sound = variable.quotient(one, one, self.power, self.power)
        w_I, w_P, known = self._weights(variable, self.power)
        return J, w_I, w_P, sound & known

    def rises_at_rest(
        self, variable: Variable
    ) -> tuple[Models, Models, Models, Models, NDArray[np.bool_]]:
        """F K and what it leaves over w_P's pole at s = 0, diagonal; w_I, w_P without that pole."""
        one, poles = np.ones(1), self._grows()
        count, size = variable.middle.size, self.block.size
        found, sound = [], np.ones(count, dtype=bool)
        for powers in (self.rising, self.rising - poles):
            P = np.zeros((DEGREE, count, size, size), dtype=complex)
            radius = np.zeros((count, size, size))
            for row, power in enumerate(powers.tolist()):
                rise, known = variable.quotient(one, one, power, power)
                P[:, :, row, row], radius[:, row, row] = rise.P[:, :, 0, 0], rise.radius[:, 0, 0]
                sound &= known
            found.append(Models(P, radius))
        w_I, w_P, known = self._weights(variable, poles)
        return found[0], found[1], w_I, w_P, sound & known

    def _weights(self, variable: Variable, powers: int) -> tuple[Models, Models, NDArray[np.bool_]]:
        """w_I and w_P (s/(1 + s/f))^powers."""
        w_I, known = variable.quotient(np.array(self.w_I.num), np.array(self.w_I.den), 0, 0)
        poles = self._grows()
        den = np.array(self.w_P.den)
        den = den[:-1] if poles else den
        w_P, also = variable.quotient(np.array(self.w_P.num), den, powers - poles, powers)
        return w_I, w_P, known & also


def _direct(elements: list[TransferFunction]) -> list[TransferFunction]:
    """Return those that feed through."""
    return [element for element in elements if element.feedthrough]


def lifted_ratio(
    num: Sequence[float], den: Sequence[float], variable: Variable, powers: int
) -> tuple[Models, NDArray[np.bool_]]:
    """Return a ratio of polynomials, descending, times (s/(1 + s/f))^powers."""
    above, below = (np.trim_zeros(np.array(each), "b") for each in (num, den))
    rises = (len(num) - above.size) - (len(den) - below.size)  # powers of s, what cancels left out
    return variable.quotient(above, below, powers + rises, powers)


def lifted_element(
    element: TransferFunction, variable: Variable, powers: int
) -> tuple[Models, NDArray[np.bool_]]:
    """Return an element times (s/(1 + s/f))^powers, its dead time included."""
    value, sound = lifted_ratio(element.num, element.den, variable, powers)
    if element.dead_time:
        value = value @ variable.delay(element.dead_time)
    return value, sound


def _modal_rows(
    modal: _Modal, variable: Variable, left: NDArray[np.int_]
) -> tuple[Models, NDArray[np.bool_]]:
    """Each row of residue/s + rest(s), times (s/(1 + s/f))^left."""
    rest, sound = _sum_of_modes(modal, variable)
    one = np.ones(1)
    count = variable.middle.size
    residue = Models.constant(modal.residue.astype(np.complex128), count)
    error = np.broadcast_to(modal.residue_error, residue.radius.shape)
    residue = Models(residue.P, residue.radius + error)
    P, radius = np.empty_like(rest.P), np.empty_like(rest.radius)
    for powers in set(left.tolist()):
        rows = left == powers
        rise, known = variable.quotient(one, one, powers, powers)
        part = rest @ rise
        if powers:
            less, also = variable.quotient(one, one, powers - 1, powers)
            part = part + residue @ less
            sound = sound & also
        P[:, :, rows], radius[:, rows] = part.P[:, :, rows], part.radius[:, rows]
        sound = sound & known
    return Models(P, radius), sound


def _sum_of_modes(modal: _Modal, variable: Variable) -> tuple[Models, NDArray[np.bool_]]:
    """D + c (s - poles - Delta)^-1 b."""
    middle, half = variable.middle[:, None], variable.half[:, None]
    if variable.inverse:  # 1/(s - pole) = z/(1 - pole z), z = 1/s
        base, step = 1 - modal.poles * middle, -modal.poles * half
    else:
        base, step = middle - modal.poles, half + 0 * modal.poles
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = step / base
        share = np.abs(ratio) * OUTWARD
        known = share < 0.9
        sound = np.asarray(known.all(axis=1))
        ratio, share = np.where(known, ratio, 0), np.where(known, share, 0)
        first = np.where(known, 1 / base, 0)
    terms = [first]
    for _ in range(1, DEGREE):
        terms.append(-terms[-1] * ratio)
    sizes = np.abs(first) * OUTWARD
    tail = sizes * share**DEGREE / (1 - share)
    largest = sizes / (1 - share)  # of the resolvent on the interval
    if variable.inverse:
        reach = np.abs(variable.middle) + np.abs(variable.half)
        reach = reach[:, None]
        raised = [middle * terms[0]]
        raised += [middle * terms[k] + half * terms[k - 1] for k in range(1, DEGREE)]
        # The power of t that is one too high goes with the tail.
        tail = (tail + np.abs(terms[-1])) * reach
        largest = largest * reach
        terms = raised
    tail = (tail + 4 * (DEGREE + 2) * UNIT * largest) * OUTWARD
    P = np.stack([(modal.c * term[:, None, :]) @ modal.b for term in terms])
    P[0] += modal.through
    c, b = np.abs(modal.c), np.abs(modal.b)
    states = modal.poles.size
    into = largest[:, :, None] * (b + modal.b_error)
    out = (c + modal.c_error) * largest[:, None, :]
    radius = (
        (c * tail[:, None, :]) @ b
        + modal.c_error @ into
        + out @ modal.b_error
        + UNIT * (states + 8) * ((c * largest[:, None, :]) @ b)
        + UNIT * np.abs(modal.through)
    )
    if states:
        q = (largest * (modal.coupling.sum(axis=1) * OUTWARD)).max(axis=1)
        sound &= q < 0.5
        q = np.where(sound, q, 0.0)
        more = into + (into.max(axis=1) * (q / (1 - q))[:, None])[:, None, :]
        radius = radius + out @ (modal.coupling @ more)
    radius = np.where(sound[:, None, None], np.minimum(radius * OUTWARD, NO_BOUND), NO_BOUND)
    return Models(P, radius), sound
