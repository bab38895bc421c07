"""Combinations of signals that loops control and move, as JSON."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

import solver.model.mixing
from service.schemas.fields import RequestModel
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.transfer_function import LARGEST

__all__ = ["Mixing"]

_Row = Annotated[
    tuple[Annotated[float, Field(ge=-LARGEST, le=LARGEST)], ...],
    Field(min_length=1, max_length=MAX_MATRIX_SIZE),
]
_Rows = Annotated[
    tuple[_Row, ...],
    Field(min_length=1, max_length=MAX_MATRIX_SIZE, json_schema_extra={"x-unit": "gain"}),
]


class Mixing(RequestModel):
    """Combinations of outputs that the loops control, and of inputs that they move."""

    outputs: _Rows | None = Field(
        default=None,
        description="Square matrix: row i is the combination of outputs that loop i controls, as "
        "[[1, 1], [-1, 1]] for the sum and the difference. null: the outputs themselves.",
        examples=[[[1.0, 1.0], [-1.0, 1.0]]],
    )
    inputs: _Rows | None = Field(
        default=None,
        description="Square matrix: column i is how loop i moves the inputs; their uncertainty "
        "stays with each of them. null: loop i moves input i.",
        examples=[None, [[1.0, -1.0], [1.0, 1.0]]],
    )

    def build(self) -> solver.model.mixing.Mixing:
        """Return the solver's matrices."""
        return solver.model.mixing.Mixing(self.outputs, self.inputs)
