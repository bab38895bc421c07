"""Coupled objectives: loops that control combinations of the outputs by combinations of the inputs.

z = M_y y is what the loops control, u = M_u v what they move: total flow and differences of flows
(Skogestad, Lundstrom and Hovd 1989, section 2, "coupled control objectives"), sums and differences.
The inputs u are the physical valves, and their uncertainty stays with them: the loops see
M_y G (I + w_I Delta) M_u, Delta diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.model.deviations import change_gain
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.model.mixed_plant import MixedPlant, summed
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, Plant, WeightedElement
from solver.model.validation import items, reals, settle

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Mixing", "mixed", "summed_outputs"]

REGULAR = 1e12  # condition, rows and columns scaled, beyond which a matrix is singular

_Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Mixing:
    """Which combinations of outputs the loops control, and which of inputs they move.

    Parameters
    ----------
    outputs : sequence of sequences of float, or None
        M_y, (n, n): row i is what loop i controls. None: the outputs as they are.
    inputs : sequence of sequences of float, or None
        M_u, (n, n): column i is how loop i moves the inputs. None: each its own input.

    Raises
    ------
    InvalidInputError
        No square matrix, a singular one, or neither of the two.

    """

    outputs: _Rows | None = None
    inputs: _Rows | None = None

    def __post_init__(self) -> None:
        if self.outputs is None and self.inputs is None:
            message = "give outputs, inputs, or both"
            raise InvalidInputError(message, "")
        for name in ("outputs", "inputs"):
            given = getattr(self, name)
            if given is None:
                continue
            rows = tuple(
                reals(row, f"/{name}/{index}") for index, row in enumerate(items(given, f"/{name}"))
            )
            for index, row in enumerate(rows):
                if len(row) != len(rows):
                    message = f"row {index + 1} has {len(row)} entries, the matrix {len(rows)} rows"
                    raise InvalidInputError(message, f"/{name}/{index}")
            matrix = np.array(rows)
            if not matrix.size or not np.isfinite(matrix).all():
                message = "the entries must be finite numbers"
                raise InvalidInputError(message, f"/{name}")
            settle(self, **{name: rows})
            if _is_singular(matrix):
                message = "the matrix is singular: two loops would have one task"
                raise InvalidInputError(message, f"/{name}")

    def require_size(self, n: int, field: str) -> None:
        """Refuse matrices that do not fit a plant of n units; `field` is where they are given.

        Raises
        ------
        InvalidInputError
            So it is, or the plant is too large.

        """
        for name in ("outputs", "inputs"):
            given = getattr(self, name)
            if given is not None and len(given) != n:
                message = f"{len(given)} rows for a plant of {n} units"
                raise InvalidInputError(message, f"{field}/{name}")
        if n > MAX_MATRIX_SIZE:
            message = f"combinations of signals are for plants of up to {MAX_MATRIX_SIZE} units"
            raise InvalidInputError(message, field)

    @property
    def own_inputs(self) -> tuple[int, ...] | None:
        """The input of each loop where each moves one alone; None where some move several."""
        if self.inputs is None:
            return tuple(range(len(self.outputs or ())))
        there = np.array(self.inputs) != 0
        if (there.sum(axis=0) != 1).any():
            return None
        return tuple(there.argmax(axis=0).tolist())


def mixed(plant: Plant, mixing: Mixing) -> Plant:
    """Return the plant from what the loops move to what they control.

    Parameters
    ----------
    plant : Plant
        At most `MAX_MATRIX_SIZE` units.
    mixing : Mixing
        Of its size.

    Raises
    ------
    InvalidInputError
        It is of another size.
    UnsupportedPlantError
        Combinations of the inputs of a plant given as frequency response.

    """
    mixing.require_size(plant.n, "")
    own = mixing.own_inputs
    if mixing.inputs is not None and own is not None:
        plant = _with_own_inputs(plant, mixing.inputs, own)
    if isinstance(plant, MeasuredPlant):
        if own is None:
            message = (
                "loops that move combinations of inputs need a plant of transfer functions, not "
                "one given as frequency response"
            )
            raise UnsupportedPlantError(message, "/mixing/inputs")
        return summed_outputs(plant, mixing)
    if own is not None and (mixing.outputs is None or _is_identity(mixing.outputs)):
        return plant
    each = tuple(map(tuple, np.eye(plant.n).tolist()))
    inputs = mixing.inputs if own is None and mixing.inputs is not None else each
    return MixedPlant(plant, mixing.outputs or each, inputs, own is None)


def _is_identity(rows: _Rows) -> bool:
    return bool((np.array(rows) == np.eye(len(rows))).all())


def _with_own_inputs(plant: Plant, inputs: _Rows, own: tuple[int, ...]) -> Plant:
    """Return the plant whose loops have an input each: only its place and unit are others."""
    factors = [inputs[unit][loop] for loop, unit in enumerate(own)]
    if isinstance(plant, MeasuredPlant):
        return plant.paired(own).scaled(np.tile(factors, (plant.n, 1)))
    if own == tuple(range(plant.n)) and len(set(factors)) == 1:
        same = factors[0] == 1
        return plant if same else plant.mapped(partial(change_gain, factor=factors[0]))
    return MatrixPlant(
        [
            [
                change_gain(plant.element(row, unit), factor)
                for unit, factor in zip(own, factors, strict=True)
            ]
            for row in range(plant.n)
        ]
    )


def summed_outputs(plant: Plant, mixing: Mixing) -> Plant:
    """Return the plant from its inputs to the combinations of outputs, written out.

    Parameters: as for `mixed`.

    Raises
    ------
    UnsupportedPlantError
        A combination of elements with unlike dead times, which is no transfer function.

    """
    if mixing.outputs is None:
        return plant
    if isinstance(plant, MeasuredPlant):
        values = np.array(mixing.outputs) @ plant.values
        return MeasuredPlant(plant.omega, values, unstable_poles=plant.unstable_poles)
    size = range(plant.n)
    return MatrixPlant(
        [
            [
                summed(
                    [WeightedElement(f, plant.element(k, c)) for k, f in enumerate(row)],
                    f"/mixing/outputs/{r}",
                )
                for c in size
            ]
            for r, row in enumerate(mixing.outputs)
        ]
    )


def _is_singular(matrix: NDArray[np.float64]) -> bool:
    size = np.abs(matrix)
    if not (size.any(axis=0).all() and size.any(axis=1).all()):
        return True
    scaled = matrix / size.max(axis=1, keepdims=True)
    return bool(np.linalg.cond(scaled / np.abs(scaled).max(axis=0)) > REGULAR)
