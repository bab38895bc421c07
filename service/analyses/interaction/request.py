"""An interaction request as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, JsonValue

import solver.model.plants
from service.schemas.fields import (
    WHOLE,
    AnalysisRequest,
    Gain,
    RequestModel,
    below,
)
from service.schemas.frequencies import Frequencies, ascending
from service.schemas.loop_forms import GivenLoop
from service.schemas.plants import Plant
from solver.interaction.loop_effect_query import MAX_GAINS, LoopEffectQuery
from solver.model.errors import UnsupportedPlantError
from solver.model.plants import MAX_UNITS

__all__ = ["EXAMPLE", "InteractionRequest", "InteractionTask"]

_ROSENBROCK: JsonValue = {
    "kind": "matrix",
    "elements": [
        [{"num": [1.0], "den": [1.0, 1.0]}, {"num": [2.0], "den": [1.0, 3.0]}],
        [{"num": [1.0], "den": [1.0, 1.0]}, {"num": [1.0], "den": [1.0, 1.0]}],
    ],
}

_EFFECT: JsonValue = {
    "loop": 0,
    "other": 1,
    "gains": [0.0, 1.0, 2.0],
    "controller": {"gain": 2.0, "integral_time": 1.0, "derivative_time": None},
}

EXAMPLE: dict[str, JsonValue] = {"plant": _ROSENBROCK, "effect": _EFFECT}

LoopIndex = Annotated[
    int, Field(ge=0, lt=MAX_UNITS, json_schema_extra={"x-unit": "1", "x-index": True}), WHOLE
]


class EffectQuery(RequestModel):
    """Ask what a proportional gain in one loop does to another (plants without dead time)."""

    loop: LoopIndex = Field(description="The loop looked at, from 0.", examples=[0])
    other: LoopIndex = Field(
        description="The loop whose proportional gain is varied, from 0.", examples=[1]
    )
    gains: Annotated[tuple[Gain, ...], Field(min_length=1, max_length=MAX_GAINS)] = Field(
        description="Its gains.", examples=[[0.0, 1.0, 2.0]]
    )
    controller: GivenLoop | None = Field(
        default=None,
        description="Controller of the loop looked at; null leaves it open.",
        examples=[{"gain": 2.0, "integral_time": 1.0, "derivative_time": None}],
    )

    def build(self, plant: solver.model.plants.Plant) -> LoopEffectQuery:
        """Return the solver's query about `plant`."""
        controller = None
        if self.controller is not None:
            with below("/controller"):
                controller = self.controller.build()
        return LoopEffectQuery(plant, self.loop, self.other, self.gains, controller)


@dataclass(frozen=True)
class InteractionTask:
    """What to analyse: arguments of `analyse_interaction` and of `loop_effect`, or None."""

    plant: solver.model.plants.Plant
    omega: NDArray[np.float64] | None
    effect: LoopEffectQuery | None


class InteractionRequest(AnalysisRequest):
    """Ask how the loops of a plant interact, and how to pair them."""

    plant: Plant = Field(
        description="The process; loop k connects output k to input k.", examples=[_ROSENBROCK]
    )
    omega: Frequencies | None = Field(
        default=None,
        description="Frequencies of the curves, ascending; null: chosen from the plant.",
        examples=[None, [0.01, 0.1, 1.0]],
    )
    effect: EffectQuery | None = Field(
        default=None,
        description="Also: what the gain of one loop does to another.",
        examples=[_EFFECT],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> InteractionTask:
        """Return what to analyse."""
        with below("/plant"):
            plant = self.plant.build()
        effect = None
        if self.effect is not None:
            try:
                with below("/effect"):
                    effect = self.effect.build(plant)
            except UnsupportedPlantError as error:  # all else can be told of the plant
                raise UnsupportedPlantError(error.message, "/effect") from None
        return InteractionTask(plant, ascending(self.omega), effect)
