"""Linear signal flow with dead times: from connected blocks to one delay system.

A wiring collects states, algebraic signals, external signals, dead times and limited signals,
and the gains between them. `Wiring.build` eliminates the algebraic signals exactly, so loops
without dead time around biproper blocks are solved, not iterated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from solver.simulation.algebraic import solve_signals
from solver.simulation.delay_system import DelaySystem

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from solver.model.transfer_function import TransferFunction

__all__ = ["LimitedSignal", "Place", "Term", "Wiring"]


class Place(NamedTuple):
    """Where a value stands: `kind` is state, signal, external or delayed, `at` its index."""

    kind: str
    at: int


class Term(NamedTuple):
    """A value times a gain."""

    source: Place
    gain: float


@dataclass(frozen=True)
class LimitedSignal:
    """A signal clipped between two external values; all are indices of their kind."""

    raw: int
    limited: int
    low: int
    high: int


class Wiring:
    """Blocks and the gains between them.

    Attributes
    ----------
    limited : list of LimitedSignal
        The clipped signals, in the order of their creation.

    """

    def __init__(self) -> None:
        self.limited: list[LimitedSignal] = []
        self._sizes = {"state": 0, "signal": 0, "external": 0, "delayed": 0}
        self._gains: list[tuple[Place, Place, float]] = []
        self._delays: dict[tuple[int, float], Place] = {}
        self._chains: dict[tuple[Place, tuple[float, ...]], _Chain] = {}

    def state(self) -> Place:
        """Add a state; what is connected to it is its derivative."""
        return self._add("state")

    def signal(self) -> Place:
        """Add an algebraic signal: the sum of what is connected to it."""
        return self._add("signal")

    def external(self) -> Place:
        """Add a signal that is given from outside, constant between events."""
        return self._add("external")

    def connect(self, target: Place, terms: Iterable[Term]) -> None:
        """Add terms to a signal, or to the derivative of a state."""
        self._gains.extend((target, term.source, term.gain) for term in terms)

    def limit(self, raw: Place) -> Place:
        """Add and return the signal `raw` clipped to external limits, see `limited`."""
        limited, low, high = self.signal(), self.external(), self.external()
        self.limited.append(LimitedSignal(raw.at, limited.at, low.at, high.at))
        return limited

    def delayed(self, source: Place, dead_time: float) -> Place:
        """Return the signal `source` delayed by `dead_time`; the signal itself for zero."""
        if dead_time == 0:
            return source
        key = (source.at, dead_time)
        if key not in self._delays:
            self._delays[key] = self._add("delayed")
        return self._delays[key]

    def transfer(self, function: TransferFunction, source: Place) -> list[Term]:
        """Return the output of a transfer function driven by the signal `source`.

        Functions of one source with equal dead time and denominator share their states.
        """
        if function.is_zero:
            return []
        delayed = self.delayed(source, function.dead_time)
        leading = function.den[0]
        den = tuple(value / leading for value in function.den[1:])
        key = (delayed, den)
        if key not in self._chains:
            self._chains[key] = self._chain(delayed, den)
        chain = self._chains[key]
        num = np.zeros(len(function.den))
        num[len(function.den) - len(function.num) :] = function.num
        num /= leading
        through = num[0]
        output = (num[1:] - through * np.array(den)) * chain.scale
        terms = [Term(place, float(gain)) for place, gain in zip(chain.states, output, strict=True)]
        return [term for term in [*terms, Term(delayed, float(through))] if term.gain != 0]

    def build(self, mode: tuple[int, ...] = ()) -> DelaySystem:
        """Return the delay system.

        Parameters
        ----------
        mode : tuple of int
            For each limited signal 0 (free), 1 (at its high limit) or -1 (at its low limit);
            empty: all free.

        Raises
        ------
        InvalidInputError
            An algebraic loop has no solution: a loop without dynamics whose gain is exactly one.

        """
        count = self._sizes
        blocks = {
            (row, column): np.zeros((count[row], count[column]))
            for row in ("state", "signal")
            for column in count
        }
        for target, source, gain in [*self._gains, *self._clipping(mode)]:
            blocks[target.kind, source.kind][target.at, source.at] += gain
        columns = ("state", "external", "delayed")
        given = np.hstack([blocks["signal", column] for column in columns])
        solved = np.split(
            solve_signals(blocks["signal", "signal"], given),
            np.cumsum([count[column] for column in columns])[:-1],
            axis=1,
        )
        parts: dict[tuple[str, str], NDArray[np.float64]] = {}
        for column, part in zip(columns, solved, strict=True):
            parts["signal", column] = part
            parts["state", column] = blocks["state", column] + blocks["state", "signal"] @ part
        sources = list(self._delays)
        return DelaySystem(
            A=parts["state", "state"],
            B_external=parts["state", "external"],
            B_delayed=parts["state", "delayed"],
            C=parts["signal", "state"],
            D_external=parts["signal", "external"],
            D_delayed=parts["signal", "delayed"],
            delay_sources=np.array([signal for signal, _ in sources], dtype=int),
            dead_times=np.array([dead_time for _, dead_time in sources]),
        )

    def _clipping(self, mode: tuple[int, ...]) -> list[tuple[Place, Place, float]]:
        chosen = mode or (0,) * len(self.limited)
        gains = []
        for clip, position in zip(self.limited, chosen, strict=True):
            source = {
                0: Place("signal", clip.raw),
                1: Place("external", clip.high),
                -1: Place("external", clip.low),
            }[position]
            gains.append((Place("signal", clip.limited), source, 1.0))
        return gains

    def _add(self, kind: str) -> Place:
        place = Place(kind, self._sizes[kind])
        self._sizes[kind] += 1
        return place

    def _chain(self, source: Place, den: tuple[float, ...]) -> _Chain:
        """Add the states of 1/den in balanced companion form, driven by `source`."""
        order = len(den)
        if order == 0:
            return _Chain((), np.empty(0))
        companion = np.diag(np.ones(order - 1), -1)
        companion[0] = -np.array(den)
        # Powers of two, so balancing rounds nothing; without it the exponentials of a process
        # with widely different time constants lose digits.
        balanced, (factors, _) = scipy.linalg.matrix_balance(
            companion, permute=False, separate=True
        )
        scale = np.asarray(factors, dtype=np.float64)
        states = tuple(self.state() for _ in den)
        for row, target in enumerate(states):
            terms = [
                Term(place, float(gain)) for place, gain in zip(states, balanced[row], strict=True)
            ]
            self.connect(target, [term for term in terms if term.gain != 0])
        self.connect(states[0], [Term(source, float(1 / scale[0]))])
        return _Chain(states, scale)


@dataclass(frozen=True)
class _Chain:
    """States of 1/den and the factors by which balancing scaled them."""

    states: tuple[Place, ...]
    scale: NDArray[np.float64]
