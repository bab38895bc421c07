"""A plant as loops see it that control combinations of its outputs and move such of its inputs.

z = M_y y is what the loops control, u = M_u v what they move: z = M_y G M_u v (Skogestad, Lundstrom
and Hovd 1989, section 2, "coupled control objectives").
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MatrixPlant, PlacedElement, Plant, SumOfElements, WeightedElement
from solver.model.transfer_function import TransferFunction

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.model.weights import Uncertainty

__all__ = ["MixedPlant", "shares_inputs", "summed"]

ROUNDED = 1e-13  # of what a coefficient is summed from: zero but for rounding
SAME = 1e-12  # relative difference of coefficients that are one

_Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class MixedPlant(Plant):
    """A plant as loops see it that control and move combinations: M_y G M_u.

    Parameters
    ----------
    plant : Plant
        G, from its inputs to its outputs.
    outputs : tuple of tuple of float
        M_y, (loops, outputs of the plant).
    inputs : tuple of tuple of float
        M_u, (inputs of the plant, loops).
    shared : bool
        Whether loops move several inputs, or several of them one. What errs is then the inputs of
        `plant`, of which the uncertainty tells (`solver.model.blocks`); else that of each loop.

    """

    plant: Plant
    outputs: _Rows
    inputs: _Rows
    shared: bool

    @property
    def n(self) -> int:
        """Number of loops."""
        return len(self.outputs)

    @property
    def interchangeable(self) -> bool:
        """Whether any two loops may change places: nothing is said of it, so no."""
        return False

    @property
    def places(self) -> tuple[PlacedElement, ...]:
        """Those of the plant."""
        return self.plant.places

    @cached_property
    def to_outputs(self) -> NDArray[np.float64]:
        """M_y, (loops, outputs of the plant)."""
        return np.array(self.outputs)

    @cached_property
    def to_inputs(self) -> NDArray[np.float64]:
        """M_u, (inputs of the plant, loops)."""
        return np.array(self.inputs)

    def acting(self, row: int, column: int) -> tuple[tuple[int, int], ...]:
        """Return where in the plant the terms are of what loop `column` does to loop `row`."""
        moved = np.flatnonzero(self.to_inputs[:, column]).tolist()
        return tuple(
            (output, each)
            for output in np.flatnonzero(self.to_outputs[row]).tolist()
            for each in moved
            if not self.plant.element(output, each).is_zero
        )

    def terms(self, row: int, column: int) -> tuple[WeightedElement, ...]:
        """Return what acts from what loop `column` moves on what loop `row` controls."""
        return tuple(
            WeightedElement(
                self.outputs[row][output] * self.inputs[each][column],
                self.plant.element(output, each),
            )
            for output, each in self.acting(row, column)
        )

    def element(self, row: int, column: int) -> TransferFunction:
        """Return the transfer function from what loop `column` moves to what loop `row` controls.

        Raises
        ------
        UnsupportedPlantError
            A sum of elements with unlike dead times, which is none.

        """
        return summed(self.terms(row, column), "/mixing")

    def entry(self, row: int, column: int) -> TransferFunction | SumOfElements:
        """Return the same, or a sum where it is none."""
        return self._entries[row][column]

    @cached_property
    def _entries(self) -> tuple[tuple[TransferFunction | SumOfElements, ...], ...]:
        def one(row: int, column: int) -> TransferFunction | SumOfElements:
            terms = self.terms(row, column)
            unlike = len({element.dead_time for _, element in terms}) > 1
            return SumOfElements(terms) if unlike else self.element(row, column)

        size = range(self.n)
        return tuple(tuple(one(row, column) for column in size) for row in size)

    def part(self, units: Sequence[int]) -> MixedPlant:
        """Return what the loops `units` see where the others stand still."""
        inputs = tuple(tuple(row[unit] for unit in units) for row in self.inputs)
        return replace(self, outputs=tuple(self.outputs[unit] for unit in units), inputs=inputs)

    def from_inputs(self) -> Plant:
        """Return the plant from its own inputs to what the loops control, M_y G, all in service.

        Raises
        ------
        UnsupportedPlantError
            A sum of elements with unlike dead times, which is no transfer function.

        """
        each = tuple(map(tuple, np.eye(self.plant.n).tolist()))
        if self.outputs == each:
            return self.plant
        return MatrixPlant(replace(self, inputs=each, shared=False).rows)

    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> MixedPlant:
        """Return the plant with every element changed."""
        return replace(self, plant=self.plant.mapped(change))

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` (k,) > 0, as (k, loops, loops) complex, in its order."""
        return np.asarray(self.to_outputs @ self.plant.response(omega) @ self.to_inputs)

    def errors_of(self, uncertainty: Uncertainty, units: Sequence[int]) -> Uncertainty:
        """Return the uncertainty of `part(units)`: that of shared inputs stays."""
        return uncertainty if self.shared else super().errors_of(uncertainty, units)


def shares_inputs(plant: Plant) -> TypeGuard[MixedPlant]:
    """Whether the errors are those of inputs that the loops share."""
    return isinstance(plant, MixedPlant) and plant.shared


def summed(given: Sequence[WeightedElement], field: str) -> TransferFunction:
    """Return the sum of multiples of transfer functions; `field` asks for it."""
    terms = [(factor, e) for factor, e in given if factor != 0 and not e.is_zero]
    if len({e.dead_time for _, e in terms}) > 1:
        message = (
            "a sum of elements with unlike dead times is no transfer function: give them one dead "
            "time, or the plant as frequency response"
        )
        raise UnsupportedPlantError(message, field)
    # Elements of one denominator add up by their numerators.
    parts: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]] = []
    for factor, e in terms:
        scale = e.den[0]
        num, den = factor * np.array(e.num) / scale, np.array(e.den) / scale
        for index, (known, total, sizes) in enumerate(parts):
            if known.size == den.size and np.allclose(known, den, rtol=SAME, atol=0):
                parts[index] = known, _added(total, num), _added(sizes, np.abs(num))
                break
        else:
            parts.append((den, num, np.abs(num)))
    parts = [
        (den, np.where(np.abs(num) > ROUNDED * sizes, num, 0.0), sizes) for den, num, sizes in parts
    ]
    parts = [part for part in parts if part[1].any()]
    if not parts:
        return TransferFunction((0.0,), (1.0,))
    num, den = np.zeros(1), np.ones(1)
    for own_den, own_num, _ in parts:
        num = _added(np.polymul(num, own_den), np.polymul(own_num, den))
        den = np.asarray(np.polymul(den, own_den), dtype=float)
    num = np.trim_zeros(num, "f")
    try:
        return TransferFunction(num.tolist(), den.tolist(), terms[0][1].dead_time)
    except InvalidInputError as error:
        message = f"the combination of elements is no plant: {error.message}"
        raise InvalidInputError(message, field) from None


def _added(one: NDArray[np.floating[Any]], other: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return the sum of two polynomials."""
    return np.asarray(np.polyadd(one, other), dtype=float)
