"""Perturbations of the inputs as JSON: given actuators, or the worst case of an uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, JsonValue

import solver.model.transfer_function
import solver.model.weights
import solver.simulation.actuators
from service.schemas.fields import RequestModel, below
from service.schemas.plants import TransferFunction
from service.schemas.weights import Performance, Uncertainty
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_UNITS

__all__ = ["Perturbation", "WorstCasePerturbation"]

_ACTUATORS: JsonValue = [
    {"num": [1.2], "den": [1.0], "dead_time": 0.5},
    {"num": [0.8], "den": [1.0], "dead_time": 0.0},
]
_FACTOR: JsonValue = [{"num": [0.7], "den": [1.0]}, {"num": [-0.7], "den": [1.0]}]

Functions = Annotated[tuple[TransferFunction, ...], Field(min_length=1, max_length=MAX_UNITS)]


class ActuatorPerturbation(RequestModel):
    """Given actuators: actual over wanted input of each unit."""

    kind: Literal["actuators"] = Field(description="Given actuators.", examples=["actuators"])
    functions: Functions = Field(
        description="Stable transfer functions, one a unit.", examples=[_ACTUATORS]
    )

    def build(self) -> solver.simulation.actuators.OwnActuators:
        """Return the solver's actuators."""
        functions = _built(self.functions, "/functions")
        with below("/functions"):
            return solver.simulation.actuators.OwnActuators(functions)


class CoupledPerturbation(RequestModel):
    """Actuators whose errors depend on each other: actual inputs u + left w (right' u)."""

    kind: Literal["coupled"] = Field(
        description="Actuators whose errors depend on each other.", examples=["coupled"]
    )
    weight: TransferFunction = Field(
        description="w(s), stable.", examples=[{"num": [1.0, 0.2], "den": [0.5, 1.0]}]
    )
    left: Functions = Field(
        description="Stable transfer functions, one a unit.", examples=[_FACTOR]
    )
    right: Functions = Field(
        description="Stable transfer functions, one a unit.", examples=[_FACTOR]
    )

    def build(self) -> solver.simulation.actuators.CoupledActuators:
        """Return the solver's actuators."""
        with below("/weight"):
            weight = self.weight.build()
        return solver.simulation.actuators.CoupledActuators(
            weight, _built(self.left, "/left"), _built(self.right, "/right")
        )


class WorstCasePerturbation(RequestModel):
    """The perturbation within an uncertainty that is worst for robust performance."""

    kind: Literal["worst_case"] = Field(
        description="The worst case of an uncertainty.", examples=["worst_case"]
    )
    uncertainty: Uncertainty = Field(
        description="Uncertainty of the plant's inputs.",
        examples=[{"epsilon": 0.2, "theta": 1.0}],
    )
    performance: Performance = Field(
        description="The demand; tau_p is needed.", examples=[{"tau_p": 19.0}]
    )

    def build(
        self, units: int
    ) -> tuple[solver.model.weights.Uncertainty, solver.model.weights.Performance]:
        """Return the solver's weights for a plant of so many units."""
        with below("/uncertainty"):
            uncertainty = self.uncertainty.build(units)
        with below("/performance"):
            performance = self.performance.build()
        if performance.tau_p is None:
            message = "the worst case needs a time constant"
            raise InvalidInputError(message, "/performance/tau_p")
        return uncertainty, performance


Perturbation = Annotated[
    ActuatorPerturbation | CoupledPerturbation | WorstCasePerturbation,
    Field(discriminator="kind"),
]


def _built(
    functions: Sequence[TransferFunction], field: str
) -> tuple[solver.model.transfer_function.TransferFunction, ...]:
    built = []
    for index, function in enumerate(functions):
        with below(f"{field}/{index}"):
            built.append(function.build())
    return tuple(built)
