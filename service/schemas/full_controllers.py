"""Full (centralised) controllers as requests take them and results give them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, JsonValue

import solver.model.plants
import solver.model.state_space
from service.schemas.fields import Coefficient, RequestModel, below
from service.schemas.plants import TransferFunction
from solver.model.mode_controller import ModeController
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.state_space import MAX_STATES, from_transfer_matrix

__all__ = ["Built", "FullController", "full_controller_document", "full_state_space"]

_Row = Annotated[tuple[Coefficient, ...], Field(max_length=MAX_STATES)]
_Matrix = Annotated[tuple[_Row, ...], Field(max_length=MAX_STATES)]
_SCALAR: dict[str, JsonValue] = {"A": [[0.0]], "B": [[1.0]], "C": [[0.4]], "D": [[40.0]]}


class System(RequestModel):
    """A linear system x' = A x + B e, u = C x + D e."""

    A: _Matrix = Field(
        default=(), description="States by states.", examples=[[[0.0]]],
        json_schema_extra={"x-unit": "of the system"},
    )  # fmt: skip
    B: _Matrix = Field(
        default=(), description="States by inputs.", examples=[[[1.0]]],
        json_schema_extra={"x-unit": "of the system"},
    )  # fmt: skip
    C: _Matrix = Field(
        default=(), description="Outputs by states.", examples=[[[0.4]]],
        json_schema_extra={"x-unit": "of the system"},
    )  # fmt: skip
    D: Annotated[_Matrix, Field(min_length=1)] = Field(
        description="Outputs by inputs.", examples=[[[40.0]]],
        json_schema_extra={"x-unit": "of the system"},
    )  # fmt: skip

    def build(self) -> solver.model.state_space.StateSpace:
        """Return the solver's system.

        Raises
        ------
        InvalidInputError
            Matrices that do not fit together.

        """
        return solver.model.state_space.StateSpace(self.A, self.B, self.C, self.D)


class StateSpaceController(System):
    """A full controller u = C e in state space."""

    kind: Literal["state_space"] = Field(description="Kind.", examples=["state_space"])


class TransferMatrixController(RequestModel):
    """A full controller u = C e as a matrix of transfer functions."""

    kind: Literal["transfer_matrix"] = Field(description="Kind.", examples=["transfer_matrix"])
    elements: Annotated[
        tuple[Annotated[tuple[TransferFunction, ...], Field(max_length=MAX_MATRIX_SIZE)], ...],
        Field(min_length=1, max_length=MAX_MATRIX_SIZE),
    ] = Field(
        description="Row r, column c: from error c to input r.",
        examples=[[[{"num": [40.0, 0.4], "den": [1.0, 0.0], "dead_time": 0.0}]]],
    )

    def build(self) -> solver.model.plants.MatrixPlant:
        """Return the solver's matrix.

        Raises
        ------
        InvalidInputError
            No square matrix, or an element that is none.

        """
        rows = []
        for r, row in enumerate(self.elements):
            built = []
            for c, element in enumerate(row):
                with below(f"/elements/{r}/{c}"):
                    built.append(element.build())
            rows.append(built)
        return solver.model.plants.MatrixPlant(rows)


class ModesController(RequestModel):
    """A controller of a parallel plant: one on the mean of all errors, one on the rest of each."""

    kind: Literal["modes"] = Field(description="Kind.", examples=["modes"])
    total: System = Field(description="On the mean of all units' errors.", examples=[_SCALAR])
    difference: System = Field(
        description="On what remains of each unit's error.", examples=[_SCALAR]
    )

    def build(self) -> ModeController:
        """Return the solver's controller.

        Raises
        ------
        InvalidInputError
            Systems of more than one input or output.

        """
        parts = []
        for name in ("total", "difference"):
            with below(f"/{name}"):
                parts.append(getattr(self, name).build())
        return ModeController(*parts)


Built: TypeAlias = (
    solver.model.state_space.StateSpace | solver.model.plants.MatrixPlant | ModeController
)
FullController: TypeAlias = Annotated[
    StateSpaceController | TransferMatrixController | ModesController, Field(discriminator="kind")
]


def full_state_space(controller: Built, n: int) -> solver.model.state_space.StateSpace:
    """Return a controller of the solver as one system of n inputs and outputs.

    Raises
    ------
    InvalidInputError
        A transfer matrix with dead time.

    """
    if isinstance(controller, solver.model.plants.MatrixPlant):
        return from_transfer_matrix(controller)
    if isinstance(controller, solver.model.state_space.StateSpace):
        return controller
    return controller.full(n)


def full_controller_document(
    controller: solver.model.state_space.StateSpace | ModeController,
) -> dict[str, Any]:
    """Return a controller of the solver as a request takes it."""
    if isinstance(controller, solver.model.state_space.StateSpace):
        return {"kind": "state_space", **_matrices(controller)}
    return {
        "kind": "modes",
        "total": _matrices(controller.total),
        "difference": _matrices(controller.difference),
    }


def _matrices(system: solver.model.state_space.StateSpace) -> dict[str, Any]:
    return {name: getattr(system, name).tolist() for name in "ABCD"}
