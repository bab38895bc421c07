"""Plants: n identical interacting units (the parallel matrix), or a general square matrix.

The parallel matrix has g(s) on its diagonal and i(s) everywhere else: Skogestad, Lundstrom and
Hovd (1989), eq. 1. A plant has that form exactly where any of its units may change places; what
splits by that symmetry asks for a `ParallelPlant`, everything else for a `Plant`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST, TransferFunction, refuse_vanishing
from solver.model.validation import (
    frequencies,
    instance,
    instances,
    integer,
    items,
    real,
    settle,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.model.weights import Uncertainty

__all__ = [
    "MAX_MATRIX_SIZE",
    "MAX_UNITS",
    "MatrixPlant",
    "ParallelPlant",
    "PlacedElement",
    "Plant",
    "SumOfElements",
    "WeightedElement",
    "first_order",
]

MAX_UNITS = 10_000
MAX_MATRIX_SIZE = 10


class PlacedElement(NamedTuple):
    """Where a plant has an element: in words, and as a JSON pointer within the plant."""

    words: str
    pointer: str
    element: TransferFunction


class WeightedElement(NamedTuple):
    """A transfer function of the plant, and what it is multiplied by."""

    factor: float
    element: TransferFunction


@dataclass(frozen=True)
class SumOfElements:
    """A sum of transfer functions that need not be one: their dead times may differ."""

    terms: tuple[WeightedElement, ...]

    def __call__(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the value at complex points."""
        values = [factor * np.asarray(element(s)) for factor, element in self.terms]
        return np.asarray(sum(values, np.zeros(np.shape(s), dtype=complex)))

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Return the frequency response at `omega` (k,) rad per time unit, (k,)."""
        return self(1j * np.atleast_1d(np.asarray(omega, dtype=float)))

    @property
    def static_gain(self) -> float:
        """The value at s = 0; infinite with an integrator, of the sign of the fastest rise."""
        most = max((element.integrators for _, element in self.terms), default=0)
        rest = [(f, e) for f, e in self.terms if e.integrators == most]
        if not most:
            return float(sum(f * e.static_gain for f, e in rest))
        rise = sum(f * e.num[-1] / e.den[-1 - most] for f, e in rest)
        return math.copysign(math.inf, rise)

    @property
    def dead_time(self) -> float:
        """The shortest one: when anything begins."""
        return min((element.dead_time for _, element in self.terms), default=0.0)


class Plant(ABC):
    """A square plant, one loop a unit: what everything else needs to know of any of them."""

    if TYPE_CHECKING:

        @property
        def n(self) -> int:
            """Number of units, and of loops."""

    @property
    @abstractmethod
    def interchangeable(self) -> bool:
        """Whether any two units may change places without any effect."""

    @property
    @abstractmethod
    def places(self) -> tuple[PlacedElement, ...]:
        """The different elements, each where the description of the plant has it."""

    @property
    def elements(self) -> tuple[TransferFunction, ...]:
        """The elements of `places`."""
        return tuple(place.element for place in self.places)

    @property
    def longest_dead_time(self) -> float:
        """The longest dead time of the elements."""
        return max(element.dead_time for element in self.elements)

    @abstractmethod
    def element(self, row: int, column: int) -> TransferFunction:
        """Return the transfer function from input `column` to output `row`."""

    def terms(self, row: int, column: int) -> tuple[WeightedElement, ...]:
        """Return what acts from input `column` on output `row`, as a sum of its elements."""
        return (WeightedElement(1.0, self.element(row, column)),)

    def entry(self, row: int, column: int) -> TransferFunction | SumOfElements:
        """Return the same as one function."""
        return self.element(row, column)

    @abstractmethod
    def part(self, units: Sequence[int]) -> Plant:
        """Return the plant between the inputs and outputs of `units`, at least one."""

    def errors_of(self, uncertainty: Uncertainty, units: Sequence[int]) -> Uncertainty:
        """Return the uncertainty of `part(units)`, from that of the plant."""
        return uncertainty.of_units(units)

    @abstractmethod
    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> Plant:
        """Return the plant with every element changed."""

    @property
    def kinds(self) -> tuple[tuple[int, ...], ...]:
        """The units, those together that may change places."""
        units = tuple(range(self.n))
        return (units,) if self.interchangeable else tuple((unit,) for unit in units)

    @property
    def rows(self) -> tuple[tuple[TransferFunction, ...], ...]:
        """All n x n elements, row by row."""
        size = range(self.n)
        return tuple(tuple(self.element(row, column) for column in size) for row in size)

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` (k,) > 0, as (k, n, n) complex, in its order."""
        rows, s = self.rows, np.asarray(1j * frequencies(omega))
        values = {element: element(s) for row in rows for element in row}
        G = np.empty((s.size, self.n, self.n), dtype=complex)
        for index, row in enumerate(rows):
            for column, element in enumerate(row):
                G[:, index, column] = values[element]
        return G

    def static_gain(self) -> NDArray[np.float64]:
        """G(0), (n, n); infinite entries for integrating elements."""
        size = range(self.n)
        return np.array([[self.entry(row, column).static_gain for column in size] for row in size])


@dataclass(frozen=True)
class ParallelPlant(Plant):
    """n identical units, each disturbing every other one alike.

    Parameters
    ----------
    n : int
        Number of units, 1..`MAX_UNITS`.
    process : TransferFunction
        g(s): from a unit's input to its own output.
    interaction : TransferFunction
        i(s): from a unit's input to each other unit's output.

    """

    n: int
    process: TransferFunction
    interaction: TransferFunction

    def __post_init__(self) -> None:
        settle(self, n=integer(self.n, "/n"))
        instance(self.process, TransferFunction, "/process")
        instance(self.interaction, TransferFunction, "/interaction")
        if not 1 <= self.n <= MAX_UNITS:
            message = f"the number of units must lie in 1..{MAX_UNITS}"
            raise InvalidInputError(message, "/n")
        if self.process.is_zero:
            message = "the process is zero: its input has no effect on its output"
            raise InvalidInputError(message, "/process/num")

    @property
    def interchangeable(self) -> bool:
        """Whether any two units may change places without any effect: always."""
        return True

    @property
    def places(self) -> tuple[PlacedElement, ...]:
        """The process and, of two units or more, the interaction."""
        process = PlacedElement("process", "/process", self.process)
        if self.n == 1:
            return (process,)
        return process, PlacedElement("interaction", "/interaction", self.interaction)

    def element(self, row: int, column: int) -> TransferFunction:
        """Return the transfer function from input `column` to output `row`."""
        return self.process if row == column else self.interaction

    def part(self, units: Sequence[int]) -> ParallelPlant:
        """Return the plant between the inputs and outputs of `units`, at least one."""
        return ParallelPlant(len(units), self.process, self.interaction)

    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> ParallelPlant:
        """Return the plant with every element changed."""
        return ParallelPlant(self.n, change(self.process), change(self.interaction))


@dataclass(frozen=True)
class MatrixPlant(Plant):
    """A general square plant, at most `MAX_MATRIX_SIZE` x `MAX_MATRIX_SIZE`.

    Parameters
    ----------
    elements_by_row : sequence of sequences of TransferFunction
        Row r, column c: from input c to output r. Loop i connects output i to input i.

    """

    elements_by_row: tuple[tuple[TransferFunction, ...], ...]

    def __init__(self, elements_by_row: Sequence[Sequence[TransferFunction]]) -> None:
        rows = tuple(
            instances(row, TransferFunction, f"/elements/{index}")
            for index, row in enumerate(items(elements_by_row, "/elements"))
        )
        settle(self, elements_by_row=rows)
        if not 1 <= len(rows) <= MAX_MATRIX_SIZE:
            message = f"a matrix plant has 1..{MAX_MATRIX_SIZE} rows"
            raise InvalidInputError(message, "/elements")
        for index, row in enumerate(rows):
            if len(row) != len(rows):
                message = (
                    f"row {index + 1} has {len(row)} elements, the matrix has {len(rows)} rows"
                )
                raise InvalidInputError(message, f"/elements/{index}")

    @property
    def n(self) -> int:
        """Number of loops."""
        return len(self.elements_by_row)

    @property
    def interchangeable(self) -> bool:
        """Whether any two units may change places: nothing is said of it, so no."""
        return False

    @property
    def places(self) -> tuple[PlacedElement, ...]:
        """All elements, row by row."""
        return tuple(
            PlacedElement(f"element {row + 1}, {column + 1}", f"/elements/{row}/{column}", element)
            for row, elements in enumerate(self.elements_by_row)
            for column, element in enumerate(elements)
        )

    @property
    def elements(self) -> tuple[TransferFunction, ...]:
        """All elements, row by row."""
        return tuple(element for row in self.elements_by_row for element in row)

    def element(self, row: int, column: int) -> TransferFunction:
        """Return the transfer function from input `column` to output `row`."""
        return self.elements_by_row[row][column]

    def part(self, units: Sequence[int]) -> MatrixPlant:
        """Return the plant between the inputs and outputs of `units`, at least one."""
        return MatrixPlant([[self.element(row, column) for column in units] for row in units])

    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> MatrixPlant:
        """Return the plant with every element changed."""
        return MatrixPlant([[change(element) for element in row] for row in self.elements_by_row])


def first_order(
    n: int, gain: float, time_constant: float, interaction: float, dead_time: float = 0.0
) -> ParallelPlant:
    """Return the parallel plant k/(tau s + 1) [1, a; a, 1] exp(-dead_time s), SLH eq. 7.

    Parameters
    ----------
    n : int
        Number of units.
    gain : float
        Static gain k of a unit, not zero.
    time_constant : float
        tau >= 0, in the caller's time unit.
    interaction : float
        a: effect on a neighbour relative to the effect on itself.
    dead_time : float
        Dead time >= 0 in every element.

    Raises
    ------
    InvalidInputError
        A number out of range, or something else than a number, by name.

    """
    gain, interaction = real(gain, "/gain"), real(interaction, "/interaction")
    time_constant, dead_time = real(time_constant, "/time_constant"), real(dead_time, "/dead_time")
    for name, value in (("gain", gain), ("interaction", interaction)):
        if not (math.isfinite(value) and abs(value) <= LARGEST):
            message = f"must be finite and at most {LARGEST:g} in magnitude"
            raise InvalidInputError(message, f"/{name}")
    if gain == 0:
        message = "the gain is zero: the inputs have no effect"
        raise InvalidInputError(message, "/gain")
    if not 0 <= time_constant <= LARGEST:
        message = f"the time constant must lie in 0..{LARGEST:g}"
        raise InvalidInputError(message, "/time_constant")
    if not 0 <= dead_time <= LARGEST:
        message = f"the dead time must lie in 0..{LARGEST:g}"
        raise InvalidInputError(message, "/dead_time")
    refuse_vanishing(gain, "/gain")
    refuse_vanishing(time_constant, "/time_constant")
    refuse_vanishing(interaction, "/interaction")
    refuse_vanishing(gain * interaction, "/interaction")
    den = (time_constant, 1.0) if time_constant else (1.0,)
    if not abs(gain * interaction) <= LARGEST:
        message = f"gain times interaction must be at most {LARGEST:g} in magnitude"
        raise InvalidInputError(message, "/interaction")
    return ParallelPlant(
        n=n,
        process=TransferFunction((gain,), den, dead_time),
        interaction=TransferFunction((gain * interaction,), den, dead_time),
    )
