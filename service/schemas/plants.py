"""Transfer functions and plants as JSON."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, JsonValue

import solver.model.from_state_space
import solver.model.measured
import solver.model.neighbours
import solver.model.plants
import solver.model.transfer_function
from service.schemas.fields import (
    WHOLE,
    Coefficients,
    Frequency,
    Gain,
    Ratio,
    RequestModel,
    Time,
    below,
)
from solver.model.errors import InvalidInputError
from solver.model.measured import MAX_POINTS, MIN_POINTS
from solver.model.neighbours import MAX_RING
from solver.model.plants import MAX_MATRIX_SIZE, MAX_UNITS
from solver.model.state_space import MAX_STATES
from solver.model.transfer_function import LARGEST

__all__ = [
    "BandedPlant",
    "CirculantPlant",
    "FirstOrderPlant",
    "MatrixPlant",
    "MeasuredPlant",
    "ParallelPlant",
    "Plant",
    "StateSpacePlant",
    "TransferFunction",
]

_LAG = {"num": [1.0], "den": [100.0, 1.0], "dead_time": 0.0}
_CROSS = {"num": [0.949], "den": [100.0, 1.0], "dead_time": 0.0}

Units = Annotated[
    int,
    Field(
        ge=1,
        le=MAX_UNITS,
        description="Number of identical parallel units.",
        examples=[2],
        json_schema_extra={"x-unit": "1"},
    ),
    WHOLE,
]


class TransferFunction(RequestModel):
    """A proper rational function of s times a dead time, num(s)/den(s) exp(-dead_time s)."""

    num: Coefficients = Field(
        description="Numerator coefficients in descending powers of s; [0] is the zero function.",
        examples=[[1.0]],
    )
    den: Coefficients = Field(
        description="Denominator coefficients in descending powers of s, the first not zero.",
        examples=[[100.0, 1.0]],
    )
    dead_time: Time = Field(default=0.0, description="Dead time.", examples=[0.0])

    def build(self) -> solver.model.transfer_function.TransferFunction:
        """Return the solver's transfer function."""
        return solver.model.transfer_function.TransferFunction(self.num, self.den, self.dead_time)


class ParallelPlant(RequestModel):
    """n identical units: g(s) from a unit's input to its own output, i(s) to every other one."""

    kind: Literal["parallel"] = Field(
        description="Identical units given by two transfer functions.", examples=["parallel"]
    )
    n: Units
    process: TransferFunction = Field(
        description="g(s): from a unit's input to its own output.", examples=[_LAG]
    )
    interaction: TransferFunction = Field(
        description="i(s): from a unit's input to each other unit's output.", examples=[_CROSS]
    )

    def build(self) -> solver.model.plants.ParallelPlant:
        """Return the solver's plant."""
        with below("/process"):
            process = self.process.build()
        with below("/interaction"):
            interaction = self.interaction.build()
        return solver.model.plants.ParallelPlant(self.n, process, interaction)


class FirstOrderPlant(RequestModel):
    """Identical first-order units: k/(tau s + 1) exp(-dead_time s) times [1, a; a, 1]."""

    kind: Literal["first_order"] = Field(
        description="Identical units with first-order dynamics.", examples=["first_order"]
    )
    n: Units
    gain: Gain = Field(description="Static gain k of a unit, not zero.", examples=[1.0])
    time_constant: Time = Field(description="Time constant tau of a unit.", examples=[100.0])
    interaction: Ratio = Field(
        description="a: effect on a neighbour relative to the effect on the unit itself.",
        examples=[0.949],
    )
    dead_time: Time = Field(default=0.0, description="Dead time in every element.", examples=[0.0])

    def build(self) -> solver.model.plants.ParallelPlant:
        """Return the solver's plant."""
        return solver.model.plants.first_order(
            self.n, self.gain, self.time_constant, self.interaction, self.dead_time
        )


Row = Annotated[tuple[TransferFunction, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)]


class MatrixPlant(RequestModel):
    """A general square plant; loop k connects output k to input k."""

    kind: Literal["matrix"] = Field(
        description="A square matrix of transfer functions.", examples=["matrix"]
    )
    elements: Annotated[tuple[Row, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)] = Field(
        description="Rows of transfer functions: row r, column c is from input c to output r.",
        examples=[[[_LAG, _CROSS], [_CROSS, _LAG]]],
    )

    def build(self) -> solver.model.plants.MatrixPlant:
        """Return the solver's plant."""
        rows = []
        for row_index, row in enumerate(self.elements):
            built = []
            for column_index, element in enumerate(row):
                with below(f"/elements/{row_index}/{column_index}"):
                    built.append(element.build())
            rows.append(built)
        return solver.model.plants.MatrixPlant(rows)


Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
_StateRows = Annotated[
    tuple[Annotated[tuple[Number, ...], Field(max_length=MAX_STATES)], ...],
    Field(max_length=MAX_STATES, json_schema_extra={"x-unit": "1/time, of the signals"}),
]


class StateSpacePlant(RequestModel):
    """A square plant in state space, x' = A x + B u, y = C x + D u; loop k connects y_k to u_k."""

    kind: Literal["state_space"] = Field(
        description="Matrices of a state-space model.", examples=["state_space"]
    )
    A: _StateRows = Field(
        description="Rows of A, r x r; without modes in the right half plane.",
        examples=[[[-0.01, 0.0], [0.0, -0.02]]],
    )
    B: _StateRows = Field(description="Rows of B, r x n.", examples=[[[0.01, 0.0], [0.0, 0.02]]])
    C: _StateRows = Field(description="Rows of C, n x r.", examples=[[[1.0, 0.5], [0.5, 1.0]]])
    D: _StateRows = Field(
        description="Rows of D, n x n; n is at most 10.", examples=[[[0.0, 0.0], [0.0, 0.0]]]
    )
    dead_time: Time = Field(default=0.0, description="Dead time in every element.", examples=[0.0])

    def build(self) -> solver.model.plants.Plant:
        """Return the solver's plant: elements with the frequency response of the model."""
        return solver.model.from_state_space.from_state_space(
            self.A, self.B, self.C, self.D, dead_time=self.dead_time
        )


_Neighbours = Annotated[tuple[TransferFunction, ...], Field(max_length=MAX_RING - 1)]
_SIDE = {"num": [0.3], "den": [50.0, 1.0], "dead_time": 1.0}


class NeighbourUnits(RequestModel):
    """Equal units, each disturbing those beside it by their distance."""

    process: TransferFunction = Field(
        description="From a unit's input to its own output.", examples=[_LAG]
    )
    ahead: _Neighbours = Field(
        description="From the inputs of the units 1, 2, .. places further on to a unit's output; "
        "all others have no effect.",
        examples=[[_SIDE]],
    )
    behind: _Neighbours | None = Field(
        default=None,
        description="The same of the units before it; null: as ahead.",
        examples=[None],
    )

    def _built(self, n: int, *, ring: bool) -> solver.model.plants.Plant:
        with below("/process"):
            process = self.process.build()
        sides: list[tuple[solver.model.transfer_function.TransferFunction, ...]] = []
        for name in ("ahead", "behind"):
            built = []
            for index, element in enumerate(getattr(self, name) or ()):
                with below(f"/{name}/{index}"):
                    built.append(element.build())
            sides.append(tuple(built))
        plant = solver.model.neighbours.NeighbourPlant(
            n, process, sides[0], None if self.behind is None else sides[1], ring=ring
        )
        # Of few units everything is computed and proven as of any matrix.
        few = n <= MAX_MATRIX_SIZE
        return solver.model.plants.MatrixPlant(plant.rows) if few else plant


class CirculantPlant(NeighbourUnits):
    """Equal units in a ring, the last beside the first: a circulant matrix."""

    kind: Literal["circulant"] = Field(
        description="Equal units in a ring, by the effects of their neighbours.",
        examples=["circulant"],
    )
    n: Annotated[int, Field(ge=2, le=MAX_RING, json_schema_extra={"x-unit": "1"}), WHOLE] = Field(
        description="Number of units.", examples=[24]
    )

    def build(self) -> solver.model.plants.Plant:
        """Return the solver's plant."""
        return self._built(self.n, ring=True)


class BandedPlant(NeighbourUnits):
    """Equal units in a row, as zones or lanes: a banded matrix."""

    kind: Literal["banded"] = Field(
        description="Equal units in a row, by the effects of their neighbours.",
        examples=["banded"],
    )
    n: Annotated[int, Field(ge=2, le=MAX_RING, json_schema_extra={"x-unit": "1"}), WHOLE] = Field(
        description="Number of units; more than 20 with the same neighbours on both sides, whose "
        "responses differ by factors alone.",
        examples=[12],
    )

    def build(self) -> solver.model.plants.Plant:
        """Return the solver's plant."""
        return self._built(self.n, ring=False)


Points = Annotated[
    tuple[Number, ...],
    Field(
        min_length=MIN_POINTS, max_length=MAX_POINTS, json_schema_extra={"x-unit": "of the signals"}
    ),
]


class MeasuredElement(RequestModel):
    """Frequency response of one element, at the frequencies of the plant."""

    re: Points = Field(description="Real parts.", examples=[[1.0, 0.5, 0.01]])
    im: Points = Field(description="Imaginary parts.", examples=[[-0.1, -0.5, -0.1]])


_MeasuredRow = Annotated[
    tuple[MeasuredElement, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)
]
_MEASURED: JsonValue = {"re": [0.9901, 0.5, 0.0099], "im": [-0.099, -0.5, -0.099]}


class MeasuredPlant(RequestModel):
    """A square plant given by its frequency response; loop k connects output k to input k."""

    kind: Literal["frequency_response"] = Field(
        description="Frequency response at some frequencies, for tuning and robustness there.",
        examples=["frequency_response"],
    )
    omega: Annotated[tuple[Frequency, ...], Field(min_length=MIN_POINTS, max_length=MAX_POINTS)] = (
        Field(description="Frequencies, ascending.", examples=[[0.001, 0.01, 0.1]])
    )
    elements: Annotated[
        tuple[_MeasuredRow, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)
    ] = Field(
        description="Rows of responses: row r, column c is from input c to output r.",
        examples=[[[_MEASURED]]],
    )
    unstable_poles: Annotated[int, Field(ge=0, json_schema_extra={"x-unit": "1"}), WHOLE] | None = (
        Field(
            default=None,
            description="Poles with a real part >= 0, which the data do not show: 0 says that the "
            "plant settles by itself. null: not known, and then nothing can be tuned.",
            examples=[0],
        )
    )

    def build(self) -> solver.model.measured.MeasuredPlant:
        """Return the solver's plant."""
        n, count = len(self.elements), len(self.omega)
        values = np.empty((count, n, n), dtype=complex)
        for r, row in enumerate(self.elements):
            if len(row) != n:
                message = f"row {r + 1} has {len(row)} elements, the matrix has {n} rows"
                raise InvalidInputError(message, f"/elements/{r}")
            for c, element in enumerate(row):
                for name in ("re", "im"):
                    given = len(getattr(element, name))
                    if given != count:
                        message = f"{given} values at {count} frequencies"
                        raise InvalidInputError(message, f"/elements/{r}/{c}/{name}")
                values[:, r, c] = np.array(element.re) + 1j * np.array(element.im)
        return solver.model.measured.MeasuredPlant(
            np.array(self.omega), values, unstable_poles=self.unstable_poles
        )


Plant = Annotated[
    ParallelPlant
    | FirstOrderPlant
    | MatrixPlant
    | StateSpacePlant
    | MeasuredPlant
    | CirculantPlant
    | BandedPlant,
    Field(discriminator="kind"),
]
