"""Exact propagation of a delay system over one step.

Within a step the delayed signals are known polynomials, so the state is a matrix exponential of
the system with the polynomials' own shift dynamics appended (Van Loan, IEEE Trans. Automatic
Control 23 (1978) 395-404). Nothing is approximated there, however stiff the system.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.model.errors import InvalidInputError
from solver.simulation.chebyshev import DEGREE, DIFFERENTIATION, NODES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.simulation.delay_system import DelaySystem

__all__ = ["MAX_WORK", "Propagator"]

MAX_WORK = 1e11  # floating-point operations in matrix exponentials: 10 to 40 seconds
_CACHED_STEPS = 64
_CACHED_VALUES = 10_000_000  # numbers in the operators that are kept, 80 MB


@dataclass(frozen=True)
class _Part:
    """What moves the states `rows` over a step: exponential (places, rows, columns) times `given`.

    `columns` are places in the start, the externals and the delayed polynomials, one after another.
    """

    rows: NDArray[np.int_]
    columns: NDArray[np.int_]
    exponential: NDArray[np.float64]


class Propagator:
    """State and signals of a delay system over steps of any length.

    Parameters
    ----------
    system : DelaySystem
        The system.

    Attributes
    ----------
    work : float
        Floating-point operations spent on matrix exponentials, roughly.

    """

    def __init__(self, system: DelaySystem) -> None:
        self.system = system
        self.work = 0.0
        self._parts = _independent_parts(system)
        self._sizes = np.abs(system.C).T, np.abs(system.D_external), np.abs(system.D_delayed).T
        self._operators: OrderedDict[float, list[_Part]] = OrderedDict()

    def states(
        self,
        length: float,
        start: NDArray[np.float64],
        external: NDArray[np.float64],
        delayed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """States at the nodes of a step, (DEGREE + 1, states).

        Parameters
        ----------
        length : float
            Length of the step, > 0.
        start : (states,) ndarray
            State at its beginning.
        external : (externals,) ndarray
            External signals, constant in the step.
        delayed : (DEGREE + 1, delays) ndarray
            Delayed signals at the nodes.

        Raises
        ------
        InvalidInputError
            More states act on each other than `MAX_WORK` allows.

        """
        # Steps that differ by rounding of their ends share one operator.
        key = float(f"{length:.12e}")
        operator = self._operators.get(key)
        if operator is None:
            operator = self._operator(length, NODES)
            self._operators[key] = operator
            values = sum(part.exponential.size for part in operator)
            while len(self._operators) > min(
                _CACHED_STEPS, max(_CACHED_VALUES // max(values, 1), 1)
            ):
                self._operators.popitem(last=False)
        else:
            self._operators.move_to_end(key)
        return self._apply(operator, start, external, delayed)

    def state_within(
        self,
        place: float,
        length: float,
        start: NDArray[np.float64],
        external: NDArray[np.float64],
        delayed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """State (states,) at `place` in 0..1 of a step; the rest as for `states`."""
        operator = self._operator(length, np.array([place]))
        state: NDArray[np.float64] = self._apply(operator, start, external, delayed)[0]
        return state

    def signals(
        self,
        states: NDArray[np.float64],
        external: NDArray[np.float64],
        delayed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Signals (k, signals) from states (k, states) and delayed signals (k, delays)."""
        system = self.system
        with np.errstate(over="ignore", invalid="ignore"):
            value: NDArray[np.float64] = (
                states @ system.C.T + system.D_external @ external + delayed @ system.D_delayed.T
            )
        return value

    def magnitudes(
        self,
        states: NDArray[np.float64],
        external: NDArray[np.float64],
        delayed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return `signals` with all terms positive: what their rounding is measured by."""
        of_states, of_external, of_delayed = self._sizes
        value: NDArray[np.float64] = (
            np.abs(states) @ of_states
            + of_external @ np.abs(external)
            + np.abs(delayed) @ of_delayed
        )
        return value

    def _operator(self, length: float, places: NDArray[np.float64]) -> list[_Part]:
        """Return what moves each part; all of them as one matrix would be zero for the most."""
        system = self.system
        states, externals = system.B_external.shape
        operator = []
        for rows, inputs, channels in self._parts:
            own, given = rows.size, inputs.size
            size = own + given + channels.size * (DEGREE + 1)
            # A Pade approximant and its squarings; small matrices cost as one of order 15.
            work = 25.0 * places.size * max(size, 15) ** 3
            if work > MAX_WORK:
                message = (
                    f"{own} states act on each other at once, which are too many to simulate: "
                    "take elements of lower order, or fewer loops"
                )
                raise InvalidInputError(message, "/plant")
            self.work += work
            matrix = np.zeros((size, size))
            matrix[:own, :own] = length * system.A[np.ix_(rows, rows)]
            matrix[:own, own : own + given] = length * system.B_external[np.ix_(rows, inputs)]
            columns = [*rows, *(states + inputs)]
            for index, channel in enumerate(channels):
                # The polynomial seen from tau on, held at the nodes: its first value drives the
                # state, and moving on by d tau differentiates it.
                first = own + given + index * (DEGREE + 1)
                block = slice(first, first + DEGREE + 1)
                matrix[:own, first] = length * system.B_delayed[rows, channel]
                matrix[block, block] = DIFFERENTIATION
                begin = states + externals + channel * (DEGREE + 1)
                columns.extend(range(begin, begin + DEGREE + 1))
            unit = self._units(rows, inputs, channels, length)
            # An unstable process may overflow in a step far too long: the integrator shortens it.
            with np.errstate(over="ignore", invalid="ignore"):
                scaled = matrix / unit[:, None] * unit
                exponential = scipy.linalg.expm(places[:, None, None] * scaled)[:, :own]
                exponential = exponential * unit[:own, None] / unit
            operator.append(_Part(rows, np.array(columns), exponential))
        return operator

    def _apply(
        self,
        operator: list[_Part],
        start: NDArray[np.float64],
        external: NDArray[np.float64],
        delayed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """States (places, states)."""
        given = np.concatenate([start, external, delayed.T.ravel()])
        if not operator:
            return np.zeros((delayed.shape[0], 0))
        states = np.empty((operator[0].exponential.shape[0], start.size))
        with np.errstate(over="ignore", invalid="ignore"):
            for part in operator:
                states[:, part.rows] = part.exponential @ given[part.columns]
        return states

    def _units(
        self,
        rows: NDArray[np.int_],
        inputs: NDArray[np.int_],
        channels: NDArray[np.int_],
        length: float,
    ) -> NDArray[np.float64]:
        """Units in which the matrix of one part, see `_operator`, has no needless large entries.

        The exponential is as accurate as the norm of its matrix allows; without this it would
        depend on the units of the plant's signals.
        """
        system = self.system
        gains = np.hstack(
            [
                system.A[np.ix_(rows, rows)],
                system.B_external[np.ix_(rows, inputs)],
                system.B_delayed[np.ix_(rows, channels)],
            ]
        )
        unit = natural_units(length * gains)
        held = rows.size + inputs.size
        return np.concatenate([unit[:held], np.repeat(unit[held:], DEGREE + 1)])


def natural_units(gains: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return units of states and inputs, powers of two, that make the rates alike.

    Those for which the logarithms of the rates |gains[i, j]| unit[j] / unit[i] from one to
    another have least squares: another choice of units of the signals, or of time, changes them by
    the same factors. Loops are then balanced.

    Parameters
    ----------
    gains : (states, states + inputs)
        Changes in a step, h x' = gains [x, r].

    Returns
    -------
    (states + inputs,) ndarray

    """
    states, size = gains.shape
    target, source = np.nonzero(gains)
    target, source = target[target != source], source[target != source]
    if not target.size:
        return np.ones(size)
    logs = np.log2(np.abs(gains[target, source]))
    incidence = np.zeros((target.size, size))
    edges = np.arange(target.size)
    incidence[edges, target] = 1.0
    incidence[edges, source] = -1.0
    # The common rate is a matter of the unit of time, which the signals' units cannot change.
    incidence = np.column_stack([incidence, np.ones(target.size)])
    unit: NDArray[np.float64] = np.exp2(
        np.round(np.linalg.lstsq(incidence, logs, rcond=None)[0][:-1])
    )
    scaled = gains * unit / unit[:states, None]
    _, (factors, _) = scipy.linalg.matrix_balance(scaled[:, :states], permute=False, separate=True)
    unit[:states] *= factors
    # An input needs no more than to be as strong as the strongest state, or to move it at all.
    strength = np.abs(gains[:, states:] / unit[:states, None]).max(axis=0, initial=0.0)
    rate = np.abs(scaled[:, :states]).max(initial=0.0)
    wanted = (rate or 1.0) / np.where(strength > 0, strength, rate or 1.0)
    unit[states:] = np.exp2(np.round(np.log2(wanted)))
    return unit


def _independent_parts(
    system: DelaySystem,
) -> list[tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.int_]]]:
    """States that do not act on each other within a step, with the inputs that act on them.

    Elements behind different dead times are such parts; one exponential of the whole would cost
    the cube of their number.
    """
    count, label = scipy.sparse.csgraph.connected_components(system.A != 0, directed=False)
    parts = []
    for part in range(count):
        rows = np.flatnonzero(label == part)
        inputs = np.flatnonzero(np.any(system.B_external[rows] != 0, axis=0))
        channels = np.flatnonzero(np.any(system.B_delayed[rows] != 0, axis=0))
        parts.append((rows, inputs, channels))
    return parts
