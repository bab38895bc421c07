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
        description="diagonal: the actuators err independently; full: their errors may depend on "
        "each other.",
        examples=["diagonal"],
    ),
]


_Each = Field(min_length=1, max_length=MAX_UNITS)
Error = Annotated[float, Field(ge=SMALLEST, le=LARGEST, json_schema_extra={"x-unit": "1"})]
GainError = Annotated[float, Field(ge=SMALLEST, le=1, json_schema_extra={"x-unit": "1"})]


class _Errors(RequestModel):
    """Base of the forms of uncertainty, that of inputs or of outputs."""

    @property
    def errors(self) -> solver.model.weights.Uncertainty:
        """The solver's uncertainty of what these numbers are given for, its parts independent."""
        raise NotImplementedError

    def require(self, count: int, each: str) -> None:
        """Refuse lists with another number of entries than `count`, by their pointer.

        Raises
        ------
        InvalidInputError
            So it is.

        """
        for name in type(self).model_fields:
            values = getattr(self, name)
            if isinstance(values, list) and len(values) != count:
                message = f"{len(values)} entries for {count} {each}s: give one an {each}"
                raise InvalidInputError(message, f"/{name}")


class _OfError(_Errors):
    """Uncertainty by its steady-state error and the time scale at which it reaches 100 %."""

    epsilon: Error | Annotated[list[Error], _Each] = Field(
        description="Relative error of the inputs, or outputs, at steady state; 0.2 is 20 per "
        "cent. One for all, or a list with one each.",
        examples=[0.2, [0.2, 0.1]],
    )
    theta: Time | Annotated[list[Time], _Each] = Field(
        description="The error reaches 100 per cent near the frequency 1/theta. Of a neglected "
        "dead time the weight covers about 0.7 theta, above the frequency 2.6/theta a tenth less; "
        "gain_error and dead_time_error cover all. "
        "One for all, or a list with one each.",
        examples=[1.0, [1.0, 2.5]],
    )

    @property
    def errors(self) -> solver.model.weights.Uncertainty:
        """As for the base."""
        return solver.model.weights.Uncertainty.from_error(self.epsilon, self.theta)


class _OfGainAndDeadTime(_Errors):
    """Uncertainty that covers a gain error and a neglected dead time together."""

    gain_error: GainError | Annotated[list[GainError], _Each] = Field(
        description="Greatest relative error of the gain of an actuator, or sensor; 0.2 is 20 "
        "per cent. One for all, or a list with one each.",
        examples=[0.2, [0.2, 0.1]],
    )
    dead_time_error: Time | Annotated[list[Time], _Each] = Field(
        description="Greatest dead time that the model leaves out. One for all, or a list with "
        "one each.",
        examples=[1.0, [1.0, 2.5]],
    )

    @property
    def errors(self) -> solver.model.weights.Uncertainty:
        """As for the base."""
        return solver.model.weights.Uncertainty.from_gain_and_dead_time(
            self.gain_error, self.dead_time_error
        )


class _OfWeight(_Errors):
    """Uncertainty by its weight w_I(s), of outputs w_O(s)."""

    weight: TransferFunction | Annotated[list[TransferFunction], _Each] = Field(
        description="w_I(s), stable; its magnitude bounds the relative error of the inputs; "
        "w_O(s) that of outputs. One for all, or a list with one each.",
        examples=[{"num": [1.0, 0.2], "den": [0.5, 1.0]}],
    )

    @property
    def errors(self) -> solver.model.weights.Uncertainty:
        """As for the base."""
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
        return solver.model.weights.Uncertainty(weight)


class OutputsOfError(_OfError):
    """Output uncertainty by its steady-state error and the time scale at which it reaches 100 %."""


class OutputsOfGainAndDeadTime(_OfGainAndDeadTime):
    """Output uncertainty that covers a gain error and a neglected dead time together."""


class OutputsOfWeight(_OfWeight):
    """Output uncertainty by its weight w_O(s)."""


_FORMS = {
    "own": {"weight"},
    "both": {"gain_error", "dead_time_error"},
    "error": {"epsilon", "theta"},
}


def _form(value: Any) -> str | None:  # noqa: ANN401 - whatever the caller sent
    """Tell the forms apart by the fields that only one has; None: those of several."""
    if isinstance(value, dict):
        given = [name for name, form in _FORMS.items() if form & set(value)]
        return None if len(given) > 1 else "".join(given) or "error"
    if isinstance(value, _OfGainAndDeadTime):
        return "both"
    return "own" if isinstance(value, _OfWeight) else "error"


_OneForm = Discriminator(
    _form,
    custom_error_type="two_forms",
    custom_error_message="two forms at once: give epsilon and theta, or gain_error and "
    "dead_time_error, or a weight",
)


OutputUncertainty = Annotated[
    Annotated[OutputsOfError, Tag("error")]
    | Annotated[OutputsOfGainAndDeadTime, Tag("both")]
    | Annotated[OutputsOfWeight, Tag("own")],
    _OneForm,
]


class _InputUncertainty(_Errors):
    """Base of the forms of input uncertainty, with that of the outputs beside it."""

    structure: StructureName = "diagonal"
    outputs: OutputUncertainty | None = Field(
        default=None,
        description="Uncertainty of the outputs, the errors of the sensors, in the same forms: "
        "(I + w_O Delta_O) G (I + w_I Delta_I), each output by itself. null: they are known.",
        examples=[None, {"epsilon": 0.02, "theta": 0.1}],
    )

    @property
    def given(self) -> solver.model.weights.Uncertainty:
        """The solver's uncertainty."""
        outputs = None
        if self.outputs is not None:
            with below("/outputs"):
                outputs = self.outputs.errors
        return solver.model.weights.Uncertainty(
            self.errors.weight, Structure(self.structure), outputs
        )

    def build(self, inputs: int) -> solver.model.weights.Uncertainty:
        """Return the solver's uncertainty for a plant of so many inputs, and as many outputs.

        Raises
        ------
        InvalidInputError
            A list with another number of entries, by its pointer.

        """
        self.require(inputs, "input")
        if self.outputs is not None:
            with below("/outputs"):
                self.outputs.require(inputs, "output")
        return self.given


class UncertaintyOfError(_InputUncertainty, _OfError):
    """Input uncertainty by its steady-state error and the time scale at which it reaches 100 %."""


class UncertaintyOfGainAndDeadTime(_InputUncertainty, _OfGainAndDeadTime):
    """Input uncertainty that covers a gain error and a neglected dead time together."""


class UncertaintyOfWeight(_InputUncertainty, _OfWeight):
    """Input uncertainty by its weight w_I(s)."""


Uncertainty = Annotated[
    Annotated[UncertaintyOfError, Tag("error")]
    | Annotated[UncertaintyOfGainAndDeadTime, Tag("both")]
    | Annotated[UncertaintyOfWeight, Tag("own")],
    _OneForm,
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
