"""Uncertainty and performance weights as JSON."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

import solver.model.weights
from service.schemas.fields import SMALLEST, PositiveTime, RequestModel, Time, below
from service.schemas.plants import TransferFunction
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_UNITS
from solver.model.transfer_function import LARGEST
from solver.model.transfer_function import TransferFunction as Built
from solver.model.weights import Structure

__all__ = [
    "Performance",
    "Uncertainty",
    "UncertaintyOfError",
    "UncertaintyOfGainAndDeadTime",
    "UncertaintyOfWeight",
]

StructureName = Annotated[
    Literal["diagonal", "full"],
    Field(
        description="diagonal: the actuators err independently; full: they may err in concert.",
        examples=["diagonal"],
    ),
]


_Each = Field(min_length=1, max_length=MAX_UNITS)
Error = Annotated[float, Field(ge=SMALLEST, le=LARGEST, json_schema_extra={"x-unit": "1"})]
GainError = Annotated[float, Field(ge=SMALLEST, le=1, json_schema_extra={"x-unit": "1"})]


class _InputUncertainty(RequestModel):
    """Base of the forms of input uncertainty."""

    structure: StructureName = "diagonal"

    @property
    def given(self) -> solver.model.weights.Uncertainty:
        """The solver's uncertainty."""
        raise NotImplementedError

    def build(self, inputs: int) -> solver.model.weights.Uncertainty:
        """Return the solver's uncertainty for a plant of so many inputs.

        Raises
        ------
        InvalidInputError
            A list with another number of entries, by its pointer.

        """
        for name in type(self).model_fields:
            values = getattr(self, name)
            if isinstance(values, list) and len(values) != inputs:
                message = f"{len(values)} entries for {inputs} inputs: give one an input"
                raise InvalidInputError(message, f"/{name}")
        return self.given


class UncertaintyOfError(_InputUncertainty):
    """Input uncertainty by its steady-state error and the time scale at which it reaches 100 %."""

    epsilon: Error | Annotated[list[Error], _Each] = Field(
        description="Relative error of the inputs at steady state; 0.2 is 20 per cent. One for "
        "all, or a list with one an input.",
        examples=[0.2, [0.2, 0.1]],
    )
    theta: Time | Annotated[list[Time], _Each] = Field(
        description="The error reaches 100 per cent near the frequency 1/theta. Of a neglected "
        "dead time the weight covers about 0.7 theta; gain_error and dead_time_error cover all. "
        "One for all, or a list with one an input.",
        examples=[1.0, [1.0, 2.5]],
    )

    @property
    def given(self) -> solver.model.weights.Uncertainty:
        """The solver's uncertainty."""
        return solver.model.weights.Uncertainty.from_error(
            self.epsilon, self.theta, Structure(self.structure)
        )


class UncertaintyOfGainAndDeadTime(_InputUncertainty):
    """Input uncertainty that covers a gain error and a neglected dead time together."""

    gain_error: GainError | Annotated[list[GainError], _Each] = Field(
        description="Greatest relative error of an actuator's gain; 0.2 is 20 per cent. One for "
        "all, or a list with one an input.",
        examples=[0.2, [0.2, 0.1]],
    )
    dead_time_error: Time | Annotated[list[Time], _Each] = Field(
        description="Greatest dead time that the model leaves out. One for all, or a list with "
        "one an input.",
        examples=[1.0, [1.0, 2.5]],
    )

    @property
    def given(self) -> solver.model.weights.Uncertainty:
        """The solver's uncertainty."""
        return solver.model.weights.Uncertainty.from_gain_and_dead_time(
            self.gain_error, self.dead_time_error, Structure(self.structure)
        )


class UncertaintyOfWeight(_InputUncertainty):
    """Input uncertainty by its weight w_I(s)."""

    weight: TransferFunction | Annotated[list[TransferFunction], _Each] = Field(
        description="w_I(s), stable; its magnitude bounds the relative error of the inputs. One "
        "for all, or a list with one an input.",
        examples=[{"num": [1.0, 0.2], "den": [0.5, 1.0]}],
    )

    @property
    def given(self) -> solver.model.weights.Uncertainty:
        """The solver's uncertainty."""
        weight: Built | tuple[Built, ...]
        if isinstance(self.weight, list):
            each = []
            for index, own in enumerate(self.weight):
                with below(f"/weight/{index}"):
                    each.append(own.build())
            weight = tuple(each)
        else:
            with below("/weight"):
                weight = self.weight.build()
        return solver.model.weights.Uncertainty(weight, Structure(self.structure))


def _form(value: Any) -> str:  # noqa: ANN401 - whatever the caller sent
    """Tell the forms apart by a field that only one has."""
    if isinstance(value, dict):
        if "weight" in value:
            return "weight"
        return "both" if {"gain_error", "dead_time_error"} & set(value) else "error"
    if isinstance(value, UncertaintyOfGainAndDeadTime):
        return "both"
    return "weight" if isinstance(value, UncertaintyOfWeight) else "error"


Uncertainty = Annotated[
    Annotated[UncertaintyOfError, Tag("error")]
    | Annotated[UncertaintyOfGainAndDeadTime, Tag("both")]
    | Annotated[UncertaintyOfWeight, Tag("weight")],
    Discriminator(_form),
]


PermittedError = Annotated[
    float, Field(gt=0, le=LARGEST, json_schema_extra={"x-unit": "of the outputs"})
]


class Performance(RequestModel):
    """Bound on the sensitivity: w_P(s) = (1/M) (tau_p s + 1)/(tau_p s + A/M)."""

    max_peak: Annotated[float, Field(gt=1, le=LARGEST, json_schema_extra={"x-unit": "1"})] = Field(
        default=2.0,
        description="M: greatest permitted peak of the sensitivity.",
        examples=[2.0],
    )
    offset: Annotated[float, Field(ge=0, lt=1, json_schema_extra={"x-unit": "1"})] = Field(
        default=0.0, description="A: permitted relative steady-state offset.", examples=[0.0]
    )
    tau_p: PositiveTime | None = Field(
        default=None,
        description="tau_P: closed-loop time constant, the bandwidth omega_B is 1/(M tau_P); null "
        "where it is what the tuning seeks.",
        examples=[19.0],
    )
    output_scale: (
        Annotated[list[PermittedError], Field(min_length=1, max_length=MAX_UNITS)] | None
    ) = Field(
        default=None,
        description="Error that each output may have, in its own unit; only their ratios matter. "
        "null: the spans of the instruments where those tell them, else the outputs are compared "
        "as they come.",
        examples=[[1.0, 100.0]],
    )

    def build(self, spans: tuple[float, ...] | None = None) -> solver.model.weights.Performance:
        """Return the solver's performance demand; `spans` of the outputs are its default scales."""
        scales = spans if self.output_scale is None else tuple(self.output_scale)
        return solver.model.weights.Performance(self.max_peak, self.offset, self.tau_p, scales)
