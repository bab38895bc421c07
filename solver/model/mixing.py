"""Coupled objectives: loops that control combinations of the outputs by combinations of the inputs.

z = M_y y is what the loops control, u = M_u v what they move: total flow and differences of flows
(Skogestad, Lundstrom and Hovd 1989, section 2, "coupled control objectives"), sums and differences.
The inputs u are the physical valves, and their uncertainty stays with them: the loops see
M_y G (I + w_I Delta) M_u, Delta diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.model.validation import items, reals, settle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.plants import Plant

__all__ = ["Mixing", "mixed_outputs"]

ROUNDED = 1e-13  # of what a coefficient is summed from: zero but for rounding
SAME = 1e-12  # relative difference of coefficients that are one
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
    def of_inputs(self) -> Mixing | None:
        """What is left where the outputs are mixed already."""
        return None if self.inputs is None else replace(self, outputs=None)


def mixed_outputs(plant: Plant, mixing: Mixing) -> Plant:
    """Return the plant from its inputs to the combinations of outputs.

    Parameters
    ----------
    plant : Plant
        At most `MAX_MATRIX_SIZE` units.
    mixing : Mixing
        Fits it.

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
            [_sum([(factor, plant.element(k, c)) for k, factor in enumerate(row)], r) for c in size]
            for r, row in enumerate(mixing.outputs)
        ]
    )


def _sum(terms: Sequence[tuple[float, TransferFunction]], row: int) -> TransferFunction:
    """Return the sum of multiples of transfer functions."""
    terms = [(factor, e) for factor, e in terms if factor != 0 and not e.is_zero]
    if len({e.dead_time for _, e in terms}) > 1:
        message = (
            "a sum of elements with unlike dead times is no transfer function: give them one dead "
            "time, or the plant as frequency response"
        )
        raise UnsupportedPlantError(message, f"/mixing/outputs/{row}")
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
        raise InvalidInputError(message, f"/mixing/outputs/{row}") from None


def _added(one: NDArray[np.floating[Any]], other: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return the sum of two polynomials."""
    return np.asarray(np.polyadd(one, other), dtype=float)


def _is_singular(matrix: NDArray[np.float64]) -> bool:
    size = np.abs(matrix)
    if not (size.any(axis=0).all() and size.any(axis=1).all()):
        return True
    scaled = matrix / size.max(axis=1, keepdims=True)
    return bool(np.linalg.cond(scaled / np.abs(scaled).max(axis=0)) > REGULAR)
